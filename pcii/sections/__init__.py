"""Sections of the scene: Eqs. 2 and 3 from events and from images, demosaicing (Eqs. 4-6), statistics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
