"""What everything rests on: keyed random streams, strict models of TOML files, where files are."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
