"""Types of data, and what they rest on: Bayer patterns, camera geometry, focal planes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
