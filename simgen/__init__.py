"""Physically based, photon-limited elemental images from recipes, with their truth.

    scene = simgen.load_scene("two_objects")
    counts, truth = simgen.draw_photons(scene, grid, budget=1000, cfa="GRBG", seed=1)
    manifest = simgen.generate(simgen.load_recipe("paper"), "out/paper")

Scenes can be made in Python too: `Scene`, its objects, lights, shapes and materials. Importing this package
loads no renderer: that happens when the first scene is rendered.
"""

from importlib.metadata import version

import lazy_loader

__version__ = version("photon-integral-imaging")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
