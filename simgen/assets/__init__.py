"""A scene's files, decoded and checked once; shapes and patterns as arrays."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
