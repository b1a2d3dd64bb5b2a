"""What is on disk: datasets, collections and results, written whole, listed with hashes, and verified."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
