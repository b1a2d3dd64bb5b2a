"""What comes in and goes out: images made by others are read, datasets are written for other tools."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
