"""What is true of a scene: depth, objects, normals, coverage of pixels, visible cameras, and their file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
