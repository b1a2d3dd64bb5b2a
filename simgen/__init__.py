"""Physically based, photon-limited elemental images from recipes, with their truth."""

from pcii import __version__

__all__ = ["__version__"]
