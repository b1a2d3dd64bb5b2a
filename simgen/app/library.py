"""What the commands do, as functions: scenes and recipes by name, datasets, pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.base.progress import Report, silent
from simgen.dataset import generation
from simgen.figures.preview_picture import write_preview
from simgen.spec import recipe as recipes
from simgen.spec import scene as scenes
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene


@dataclass(frozen=True)
class SceneFile:
    """A scene as its TOML file says, and the folder that its assets are in."""

    scene: Scene
    folder: Path


@dataclass(frozen=True)
class RecipeFile:
    """A recipe as its TOML file and overrides say, and the folder beside which its scene is looked up."""

    recipe: Recipe
    folder: Path


def load_scene(name_or_path: str | Path) -> SceneFile:
    """A scene by the name of one that ships, or by the path of its folder or scene.toml.

    Raises `pcii.InputError` for a scene that is missing or wrong, with the field at fault.

    >>> load_scene("two_objects").scene.title
    'Tricoloured ball and toy bird'
    """
    return SceneFile(*scenes.load_scene(str(name_or_path)))


def load_recipe(name_or_path: str | Path, overrides: Sequence[str] = ()) -> RecipeFile:
    """A recipe by the name of one that ships or by path; `overrides` such as "photons.budget=300".

    Raises `pcii.InputError` for a recipe that is missing or wrong, with the field at fault.

    >>> load_recipe("paper", ["photons.budget=300"]).recipe.photons.budget
    300.0
    """
    return RecipeFile(*recipes.load_recipe(str(name_or_path), overrides))


def generate(recipe: RecipeFile, out: str | Path, report: Report = silent) -> dict[str, Any]:
    """Make the dataset of a recipe in the folder `out`, or go on with it; its manifest.

    What `simgen generate` does: an unfinished dataset of the same recipe is resumed, a finished one is
    checked and left alone. `report(stage, done, total)` is called as the work goes on.

    Raises `pcii.InputError` for a folder that holds something else, and for a recipe that this machine cannot
    hold.
    """
    return generation.generate(recipe.recipe, recipe.folder, Path(out), report)


def preview(name_or_path: str | Path, out: str | Path, samples_per_pixel: int = 32) -> None:
    """Write a picture (PNG or JPEG) of a scene or recipe from the virtual centre, with depth and objects.

    Raises `pcii.InputError` for a bad scene or recipe, or a picture that cannot be written.
    """
    write_preview(str(name_or_path), Path(out), samples_per_pixel)
