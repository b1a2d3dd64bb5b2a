"""What the commands do, as functions: scenes and recipes by name, datasets, pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Report, silent
from pcii.exporting.card_files import write_card
from pcii.io.collection import Collection, open_collection
from simgen.collection import whole_collection as collections
from simgen.dataset import generation
from simgen.figures.preview_picture import write_preview
from simgen.spec import recipe as recipes
from simgen.spec import scene as scenes
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene
from simgen.spec.sweeps import load_sweep


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


def load_scene(name_or_path: str | Path, number: int | None = None) -> SceneFile:
    """A scene by the name of one that ships, or by the path of its folder or scene.toml.

    Of a distribution of scenes `number` says which one. Raises `pcii.InputError` for a scene that is missing
    or wrong, with the field at fault.

    >>> load_scene("two_objects").scene.title
    'Tricoloured ball and toy bird'
    >>> len(load_scene("drawn_room", 17).scene.objects)
    5
    """
    return SceneFile(*scenes.load_scene(str(name_or_path), number=number))


def load_recipe(name_or_path: str | Path, overrides: Sequence[str] = ()) -> RecipeFile:
    """A recipe by the name of one that ships or by path; `overrides` such as "photons.budget=300".

    Raises `pcii.InputError` for a recipe that is missing or wrong, with the field at fault.

    >>> load_recipe("paper", ["photons.budget=300"]).recipe.photons.budget
    300.0
    """
    return RecipeFile(*recipes.load_recipe(str(name_or_path), overrides))


def generate(recipe: RecipeFile | str | Path, out: str | Path, report: Report = silent) -> dict[str, Any]:
    """Make the dataset of a recipe in the folder `out`, or go on with it; its manifest.

    What `simgen generate` does: `recipe` is one that was loaded, a path, the name of one that ships, or that
    of a scene, which the paper's cameras then see. An unfinished dataset of the same recipe is resumed, a
    finished one is checked and left alone. `report(stage, done, total)` is called as the work goes on.

    Raises `pcii.InputError` for a recipe that is missing or wrong, whose fields have several values, or that
    this machine cannot hold, and for a folder that holds something else.
    """
    loaded = _loaded(recipe)
    manifest = generation.generate(loaded.recipe, loaded.folder, Path(out), report)
    write_card(Path(out), loaded.recipe.publication.terms())
    return manifest


def _loaded(recipe: RecipeFile | str | Path) -> RecipeFile:
    if isinstance(recipe, RecipeFile):
        return recipe
    if not isinstance(recipe, str | Path):
        raise InputError(
            "recipe: expected the name or path of a recipe, or what simgen.load_recipe gives, got a "
            f"{type(recipe).__name__}"
        )
    sweep = load_sweep(str(recipe))
    if sweep.axes:
        fields = ", ".join(axis.field for axis in sweep.axes)
        raise InputError(
            f"{sweep.source}: several values of {fields} make datasets each: use simgen.generate_collection"
        )
    return RecipeFile(sweep.recipe(0), sweep.recipe_folder)


def generate_collection(
    name_or_path: str | Path,
    out: str | Path,
    overrides: Sequence[str] = (),
    *,
    seeds: int | None = None,
    scenes: int | None = None,
    executor: Executor = ALONE,
    report: Report = silent,
) -> Collection:
    """Make all datasets of a recipe whose fields have several values in the folder `out`, and open them.

    What `simgen generate` does of such a recipe, with its options; `executor` does the work. Raises
    `pcii.InputError` for a recipe that is wrong or has one value for each field, for a folder that holds
    something else, and, once all others are made, for a dataset that could not be made.

    >>> collection = generate_collection("paper", "out/dimmer", ["photons.budget=[100,300]"], seeds=5,
    ...                                  executor=Executor(workers=2))                      # doctest: +SKIP
    >>> [dataset.counts.total for dataset in collection.where(budget=100)]          # doctest: +SKIP
    """
    sweep = load_sweep(str(name_or_path), overrides, seeds=seeds, scenes=scenes)
    if not sweep.axes:
        raise InputError(f"{sweep.source}: no field has several values; use simgen.generate for one dataset")
    faults = collections.generate_collection(sweep, Path(out), executor, report)
    write_card(Path(out), sweep.recipe(0).publication.terms())
    if faults:
        raise InputError(
            f"{len(faults)} of {len(sweep)} datasets were not made, the first because {faults[0]}"
        )
    return open_collection(out)


def preview(
    name_or_path: str | Path, out: str | Path, samples_per_pixel: int = 32, scene_number: int | None = None
) -> None:
    """Write a picture (PNG or JPEG) of a scene or recipe from the virtual centre, with depth and objects.

    Of a distribution of scenes `scene_number` says which one.

    Raises `pcii.InputError` for a bad scene or recipe, or a picture that cannot be written.
    """
    write_preview(str(name_or_path), Path(out), samples_per_pixel, scene_number=scene_number)
