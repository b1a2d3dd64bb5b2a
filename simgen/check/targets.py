"""`simgen check`, and what it and `preview` look at: a scene or a recipe, by name or path."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pcii.base.errors import InputError
from simgen.base.locations import recipe_roots
from simgen.base.strict_models import suggestion
from simgen.check.costs import cost_findings, hopeless
from simgen.check.depths import depth_findings
from simgen.check.expected_photons import photon_findings
from simgen.check.scene_facts import Facts, Finding
from simgen.check.scene_probe import probe_scene
from simgen.check.sight import sight_findings
from simgen.dataset.prepared import Prepared, prepare, prepare_scene
from simgen.spec.materials import is_clear
from simgen.spec.recipe import Recipe, Render
from simgen.spec.scene import Scene
from simgen.spec.scene_lookup import drawn_scenes, is_drawn, is_scene, scene_names
from simgen.spec.sweeps import Sweep, load_sweep

GLASS_DEPTH = 8
"""Longest light path with which a scene with glass is looked at: through a ball or a pane and back."""


def lint(
    name_or_path: str,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    *,
    trust_python: bool = False,
) -> tuple[str, list[Finding]]:
    """A line that says what was checked, and all findings. Raises `InputError` for invalid files.

    `scene_number` says which drawn scene is looked at, the first unless it says so. Of other fields with
    several values the first is taken. `trust_python` runs a Python function that a recipe names.
    """
    sweep, recipe_folder = target_sweep(name_or_path, overrides, trust_python=trust_python)
    recipe = sweep.recipe(0)
    views = (
        f"{recipe.grid.rows} x {recipe.grid.cols} views of {recipe.grid.height} x {recipe.grid.width} pixels"
    )
    pitch = f"pitch {recipe.grid.pitch_mm[0]:g} x {recipe.grid.pitch_mm[1]:g} mm"
    target = target_of(sweep, recipe_folder, scene_number)
    line = f"{target.recipe.title or target.scene.title}: {views}, {pitch}, {recipe.sensor.cfa}"
    all_findings = hopeless(target.needs) or findings(probe_scene(target))
    return f"{line}{_first_values(sweep)}", all_findings


def _first_values(sweep: Sweep) -> str:
    """Says which values of fields with several are looked at."""
    return "".join(
        f"; of {axis.field} the first of {len(axis.values)} values, {json.dumps(axis.values[0])}"
        for axis in sweep.axes
    )


def findings(facts: Facts) -> list[Finding]:
    """All findings, in the order in which one would mend them."""
    return [
        *sight_findings(facts),
        *depth_findings(facts),
        *photon_findings(facts),
        *cost_findings(facts),
    ]


def load_target(
    name_or_path: str,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    *,
    trust_python: bool = False,
) -> Prepared:
    """A recipe with its scene, from the name or path of either; `scene_number` says which drawn scene.

    A scene is looked at as by a recipe that says nothing else: with the paper's camera grid, and with
    longer light paths if there is glass in it. A name of both a scene and a recipe means the scene; with
    .toml at its end, the recipe. Of fields with several values the first is taken. Raises `InputError` for
    what is missing or not valid.
    """
    return target_of(*target_sweep(name_or_path, overrides, trust_python=trust_python), scene_number)


def target_of(sweep: Sweep, recipe_folder: Path | None, scene_number: int | None = None) -> Prepared:
    """The recipe of a sweep's first values with its scene; see `load_target`."""
    recipe = sweep.recipe(0)
    if scene_number is None and recipe.scene_number is None and is_drawn(recipe.scene, recipe_folder):
        scene_number = 0
    if scene_number is not None:
        recipe = recipe.model_copy(update={"scene_number": scene_number})
    target = prepare(recipe, recipe_folder)
    return _with_long_paths(target) if recipe_folder is None else target


def target_of_scene(scene: Scene) -> Prepared:
    """A scene, looked at as `load_target` says; raises `InputError` for a file that it names and lacks."""
    return _with_long_paths(prepare_scene(Recipe(scene="as given"), scene))


def _with_long_paths(target: Prepared) -> Prepared:
    """The same, with longer light paths if there is glass in the scene."""
    if not any(is_clear(thing.material.finish) for thing in target.scene.objects):
        return target
    longer = target.recipe.model_copy(update={"render": Render(max_depth=GLASS_DEPTH)})
    return replace(target, recipe=longer)


def target_sweep(
    name_or_path: str, overrides: Sequence[str] = (), *, trust_python: bool = False
) -> tuple[Sweep, Path | None]:
    """The recipe that a name or path means, and its folder; of a scene one that says nothing else, and None.

    Raises `InputError` for what is missing or not valid.
    """
    if not is_scene(name_or_path):
        _check_name(name_or_path)
        sweep = load_sweep(name_or_path, overrides, trust_python=trust_python)
        return sweep, sweep.recipe_folder
    if overrides:
        raise InputError(f"--set: {name_or_path!r} is a scene, seen by the paper's cameras; name a recipe")
    return Sweep({"scene": name_or_path}, (), name_or_path, Path()), None


def _check_name(name_or_path: str) -> None:
    path = Path(name_or_path)
    names = {file.stem for root in recipe_roots() for file in root.glob("*.toml")}
    if not path.is_file() and not (path.parent == Path() and path.name.removesuffix(".toml") in names):
        hint = suggestion(path.stem, {*names, *scene_names(), *drawn_scenes()})
        raise InputError(f"there is no scene or recipe {name_or_path!r}{hint}")
