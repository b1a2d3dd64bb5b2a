"""Photons one by one: thinned from a majorant, and when counts are drawn from rendered views instead."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
