"""Physically based, photon-limited elemental images from recipes, with their truth."""

from importlib.metadata import version

__all__ = ["__version__"]
__version__ = version("photon-integral-imaging")
