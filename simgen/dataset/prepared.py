"""A recipe with all that it names: its scene, that scene's folder, its camera's sensitivities."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene, build
from simgen.sensor.mosaic import sensitivities
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene, load_scene


@dataclass(frozen=True, eq=False)
class Prepared:
    """What a dataset is made from. `curves` (C, N) are None in RGB mode (see `spectra`)."""

    recipe: Recipe
    scene: Scene
    folder: Path
    curves: np.ndarray | None

    def render_scene(self) -> RenderScene:
        """The scene in the renderer, in the variant that the recipe needs."""
        mi = backend.load(spectral=self.recipe.is_spectral)
        return build(mi, self.scene, self.folder, self.recipe.render.max_depth, self.curves)


def prepare(recipe: Recipe, near: Path | None) -> Prepared:
    """Look up what a recipe of the folder `near` names; `InputError` if it is missing or wrong."""
    scene, folder = load_scene(recipe.scene, near)
    return Prepared(recipe, scene, folder, sensitivities(recipe, near or Path()))
