"""Physically based, photon-limited elemental images from recipes, with their truth.

    scene = simgen.load_scene("two_objects")
    counts, truth = simgen.draw_photons(scene, grid, budget=1000, cfa="GRBG", seed=1)
    manifest = simgen.generate(simgen.load_recipe("paper"), "out/paper")

Scenes can be made in Python too: `Scene`, its objects, lights, shapes and materials. Importing this package
loads no renderer: that happens when the first scene is rendered.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simgen.app.in_memory import draw_photons, render
    from simgen.app.library import Executor, generate, generate_collection, load_scene, preview
    from simgen.importing.scene_import import ImportedScene, import_scene
    from simgen.spec.lights import (
        AreaLight,
        DirectionalLight,
        EnvironmentLight,
        Level,
        PointLight,
        SpotLight,
        UniformLight,
    )
    from simgen.spec.materials import (
        Checks,
        Edge,
        Emission,
        Glass,
        Material,
        Matt,
        Metal,
        Noise,
        Plastic,
        Principled,
        Spectrum,
        Star,
        Stripes,
        Text,
    )
    from simgen.spec.recipe import CalibrationErrors, Lens, RecipeFile, Sensor, load_recipe
    from simgen.spec.scene import Backdrop, Scene, SceneObject
    from simgen.spec.shapes import Box, Card, Cylinder, Mesh, Sphere

__all__ = ["draw_photons", "import_scene", "render"]
__all__ += ["generate", "generate_collection", "load_recipe", "load_scene", "preview"]
__all__ += ["Backdrop", "Executor", "ImportedScene", "RecipeFile", "Scene", "SceneObject"]
__all__ += ["CalibrationErrors", "Lens", "Sensor"]
__all__ += ["Box", "Card", "Cylinder", "Mesh", "Sphere"]
__all__ += ["Emission", "Material", "Spectrum"]
__all__ += ["Glass", "Matt", "Metal", "Plastic", "Principled"]
__all__ += ["Checks", "Edge", "Noise", "Star", "Stripes", "Text"]
__all__ += ["AreaLight", "DirectionalLight", "PointLight", "SpotLight"]
__all__ += ["EnvironmentLight", "Level", "UniformLight"]
_MODULES = "app.library", "app.in_memory", "importing.scene_import", "spec.recipe", "spec.scene"
_MODULES += "spec.shapes", "spec.materials", "spec.lights"
"""Where the names are, looked for in this order: `load_scene` is that of `app`."""
__version__ = version("photon-integral-imaging")


def __getattr__(name: str) -> Any:
    if name in __all__:
        for module in (import_module(f"simgen.{where}") for where in _MODULES):
            if hasattr(module, name):
                return getattr(module, name)
    raise AttributeError(f"module 'simgen' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
