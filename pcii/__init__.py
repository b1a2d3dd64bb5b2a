"""Photon-counted integral imaging: reconstruct, remove what is out of focus, score.

Names are loaded when they are first used, so that importing this package takes no time worth noting.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
