"""Physically based, photon-limited elemental images from recipes, with their truth.

    scene = simgen.load_scene("two_objects")
    counts, truth = simgen.draw_photons(scene, grid, budget=1000, cfa="GRBG", seed=1)
    manifest = simgen.generate(simgen.load_recipe("paper"), "out/paper")

Importing this package loads no renderer: that happens when the first scene is rendered.
"""

from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simgen.app.library import (
        Executor,
        RecipeFile,
        SceneFile,
        generate,
        generate_collection,
        load_recipe,
        load_scene,
        preview,
    )
    from simgen.app.photons_in_memory import draw_photons

__all__ = [
    "Executor",
    "RecipeFile",
    "SceneFile",
    "draw_photons",
    "generate",
    "generate_collection",
    "load_recipe",
    "load_scene",
    "preview",
]
__version__ = version("photon-integral-imaging")


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'simgen' has no attribute {name!r}")
    from simgen.app import library, photons_in_memory

    return getattr(photons_in_memory if name == "draw_photons" else library, name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
