"""Scenes of other programs: glTF files and meshes are translated, Mitsuba scenes referred to."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
