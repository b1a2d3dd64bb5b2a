"""Scenes that Python functions draw: ten kinds to judge methods on, and ten to train networks on.

Each is an entry point of the group `simgen.scenes`, as scenes of other packages are, and a scene is the same
for all time. Depths, sizes, shapes, colours, textures and lights differ.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
