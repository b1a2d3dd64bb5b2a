"""Accuracy of estimates: masks, depth and photons against the truth, and bounds; independent of methods."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
