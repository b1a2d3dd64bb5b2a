"""What the commands do, as functions: scenes and recipes by name, datasets, pictures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent
from pcii.store import Collection, DatasetManifest, open_collection, write_card
from simgen.app.pictures import Preview, check_picture_path, draw_preview
from simgen.check import load_target
from simgen.dataset import dataset_collection as collections
from simgen.dataset import generation
from simgen.spec import RecipeFile, Scene, Sweep, load_sweep, scene_lookup, scene_of


def load_scene(
    scene: str | Path | dict[str, Any], number: int | None = None, *, folder: str | Path | None = None
) -> Scene:
    """A scene by the name of one that ships, by the path of its folder or scene.toml, or by its values.

    Values are a dict with the fields of a scene.toml; files that they name are in `folder`. Of a scene that a
    Python function draws, by its registered name or as "module:function" or "file.py:function", `number` says
    which one. Raises `pcii.InputError` for a scene that is missing or wrong, with the field at fault.

    >>> load_scene("two_objects").title
    'Tricoloured ball and toy bird'
    >>> len(load_scene("drawn_room", 17).objects)
    5
    >>> load_scene({"title": "Fog", "lights": [{"type": "uniform", "luminance_cd_m2": 100}]}).title
    'Fog'
    """
    if isinstance(scene, dict):
        return scene_of(scene, None if folder is None else Path(folder), "scene")
    return scene_lookup.load_scene(str(scene), number=number)


def generate(recipe: RecipeFile | str | Path, out: str | Path, report: Report = silent) -> DatasetManifest:
    """Make the dataset of a recipe in the folder `out`, or go on with it; its manifest.

    What `simgen generate` does: `recipe` is one that was loaded, a path, the name of one that ships, or that
    of a scene, which the paper's cameras then see. An unfinished dataset of the same recipe is resumed, a
    finished one is checked and left alone. `report(stage, done, total)` is called as the work goes on.

    Raises `pcii.InputError` for a recipe that is missing or wrong, whose fields have several values, or that
    this machine cannot hold, and for a folder that holds something else.
    """
    if not isinstance(recipe, RecipeFile):
        sweep = load_sweep(str(recipe))
        if sweep.axes:
            fields = ", ".join(sweep.fields)
            raise InputError(f"{sweep.source}: {fields}: several values; use simgen.generate_collection")
        recipe = RecipeFile(sweep.recipe(0), sweep.recipe_folder)
    manifest = generation.generate(recipe.recipe, recipe.folder, Path(out), report)
    write_card(Path(out), recipe.recipe.publication.terms())
    return manifest


def generate_collection(
    name_or_path: str | Path,
    out: str | Path,
    overrides: Sequence[str] = (),
    *,
    seeds: int | None = None,
    scenes: int | None = None,
    trust_python: bool = False,
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> Collection:
    """Make all datasets of a recipe whose fields have several values in the folder `out`, and open them.

    What `simgen generate` does of such a recipe, with its options; `executor` does the work. Raises
    `pcii.InputError` for a recipe that is wrong or has one value for each field, for a folder that holds
    something else, and, once all others are made, for a dataset that could not be made.

    >>> collection = generate_collection("paper", "out/dimmer", ["photons.budget=[100,300]"], seeds=5,
    ...                                  executor=Executor(workers=2))                      # doctest: +SKIP
    >>> [dataset.counts.total for dataset in collection]                                 # doctest: +SKIP
    """
    sweep = load_sweep(str(name_or_path), overrides, seeds=seeds, scenes=scenes, trust_python=trust_python)
    if not sweep.axes:
        raise InputError(f"{sweep.source}: no field has several values; use simgen.generate for one dataset")
    faults = generate_sweep(sweep, Path(out), executor, report)
    if faults:
        raise InputError(
            f"{len(faults)} of {len(sweep)} datasets were not made, the first because {faults[0]}"
        )
    return open_collection(out)


def generate_sweep(sweep: Sweep, out: Path, executor: Executor, report: Report) -> list[str]:
    """Make all datasets of a sweep and their card; a sentence for each that could not be made."""
    faults = collections.generate_collection(sweep, out, executor, report)
    write_card(out, sweep.recipe(0).publication.terms())
    return faults


def preview(
    scene: Scene | str | Path,
    out: str | Path | None = None,
    samples_per_pixel: int = 32,
    scene_number: int | None = None,
    *,
    overrides: Sequence[str] = (),
    trust_python: bool = False,
) -> Preview:
    """A picture of a scene from the virtual centre, with depth and objects, which notebooks show.

    With `out` it is written too, as PNG or JPEG. The scene, or a recipe with its scene, may be given by name
    or path, with `overrides` and `trust_python` as of `load_recipe`; of a drawn scene `scene_number` says
    which one. It takes seconds.

    Raises `pcii.InputError` for a bad scene or recipe, or a picture that cannot be written.

    >>> preview(load_scene("two_objects").move("bird", by_mm=(0, -20, 0)))           # doctest: +SKIP
    """
    if out is not None:
        check_picture_path(Path(out))
    target = load_target(scene, overrides, scene_number, trust_python=trust_python)
    picture = draw_preview(target, samples_per_pixel)
    if out is not None:
        picture.write(out)
    return picture
