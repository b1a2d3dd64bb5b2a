"""`simgen check`, and what it and `preview` look at: a scene or a recipe, by name or path."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pcii.base import InputError
from simgen.base import suggestion
from simgen.check.depths import depth_findings
from simgen.check.facts import Facts, Finding
from simgen.check.light import cost_findings, photon_findings
from simgen.check.scene_probe import probe_scene
from simgen.check.sight import sight_findings
from simgen.dataset import Prepared, available_bytes, prepare, prepare_scene, shortage
from simgen.spec import (
    Recipe,
    Render,
    Scene,
    Sweep,
    drawn_scenes,
    is_clear,
    is_drawn,
    is_scene,
    load_sweep,
    recipe_file,
    recipe_names,
    scene_names,
)

GLASS_DEPTH = 8
"""Longest light path with which a scene with glass is looked at: through a ball or a pane and back."""


def lint(
    name_or_path: str,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    *,
    trust_python: bool = False,
) -> tuple[str, list[Finding]]:
    """A line that says what was checked, and all findings; see `load_target` for the parameters.

    Raises `InputError` for files that are not valid.
    """
    sweep, recipe_folder = _sweep_of(name_or_path, overrides, trust_python)
    target = _target_of(sweep, recipe_folder, scene_number)
    grid, sensor = target.recipe.grid, target.recipe.sensor
    views = f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels"
    pitch = f"pitch {grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm"
    first = f"; of {', '.join(sweep.fields)} the first value" if sweep.axes else ""
    line = f"{target.recipe.title or target.scene.title}: {views}, {pitch}, {sensor.bayer or 'mono'}{first}"
    # So that it cannot even be looked at:
    if lack := shortage(target.recipe, None, available_bytes(), target.map_counts):
        return line, [Finding("bad", "memory", lack)]
    return line, findings(probe_scene(target))


def findings(facts: Facts) -> list[Finding]:
    """All findings, in the order in which one would mend them."""
    return [*sight_findings(facts), *depth_findings(facts), *photon_findings(facts), *cost_findings(facts)]


def load_target(
    target: Scene | str | Path,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    *,
    trust_python: bool = False,
) -> Prepared:
    """A recipe with its scene, from a scene or from the name or path of either.

    A scene is looked at as by a recipe that says nothing else: with the paper's camera grid, and with
    longer light paths if there is glass in it. A name of both a scene and a recipe means the scene; with
    .toml at its end, the recipe. `scene_number` says which drawn scene is meant, the first unless it says so;
    of other fields with several values the first is taken. `trust_python` runs a Python function that a
    recipe file names. Raises `InputError` for what is missing or not valid.
    """
    if isinstance(target, Scene):
        return _with_long_paths(prepare_scene(Recipe(scene="as given"), target))
    return _target_of(*_sweep_of(str(target), overrides, trust_python), scene_number)


def _target_of(sweep: Sweep, recipe_folder: Path | None, scene_number: int | None) -> Prepared:
    """The recipe of a sweep's first values with its scene; of a bare scene the folder is None."""
    recipe = sweep.recipe(0)
    if scene_number is None and recipe.scene_number is None and is_drawn(recipe.scene, recipe_folder):
        scene_number = 0
    if scene_number is not None:
        recipe = recipe.model_copy(update={"scene_number": scene_number})
    target = prepare(recipe, recipe_folder)
    return _with_long_paths(target) if recipe_folder is None else target


def _with_long_paths(target: Prepared) -> Prepared:
    """The same, with longer light paths if there is glass in the scene."""
    if not any(is_clear(thing.material.finish) for thing in target.scene.objects):
        return target
    return replace(target, recipe=target.recipe.model_copy(update={"render": Render(max_depth=GLASS_DEPTH)}))


def _sweep_of(name_or_path: str, overrides: Sequence[str], trust_python: bool) -> tuple[Sweep, Path | None]:
    """The recipe that a name or path means, and its folder; of a scene one without other fields, and None."""
    if is_scene(name_or_path):
        if overrides:
            raise InputError(f"--set: {name_or_path!r} is a scene, without cameras of its own; name a recipe")
        return Sweep({"scene": name_or_path}, (), name_or_path, Path()), None
    if recipe_file(name_or_path) is None:
        hint = suggestion(Path(name_or_path).stem, {*recipe_names(), *scene_names(), *drawn_scenes()})
        raise InputError(f"there is no scene or recipe {name_or_path!r}{hint}")
    sweep = load_sweep(name_or_path, overrides, trust_python=trust_python)
    return sweep, sweep.recipe_folder
