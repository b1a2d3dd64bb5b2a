"""Evidence of depth in photon counts: at which plane texture is sharp, and whether depth is shown at all."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
