"""`simgen check`: what a scene or recipe will give, found without rendering it, but for one coarse probe."""

import json
from collections.abc import Sequence
from pathlib import Path

from pcii.base.errors import InputError
from simgen.check.costs import cost_findings, hopeless
from simgen.check.depths import depth_findings
from simgen.check.expected_photons import photon_findings
from simgen.check.many_draws import draw_findings
from simgen.check.scene_facts import Facts, Finding
from simgen.check.scene_probe import probe_scene
from simgen.check.sight import sight_findings
from simgen.check.targets import target_of, target_sweep
from simgen.dataset.prepared import needs_of
from simgen.spec.scene import Scene, is_scene_distribution, load_scene
from simgen.spec.sweeps import Sweep

DRAWS = 20
"""So many draws of a distribution of scenes are looked at."""


def lint(
    name_or_path: str, overrides: Sequence[str] = (), scene_number: int | None = None
) -> tuple[str, list[Finding]]:
    """A line that says what was checked, and all findings. Raises `InputError` for invalid files.

    `scene_number` says which draw of a distribution of scenes is looked at; without it, the first few are,
    less closely. Of other fields with several values the first is taken.
    """
    sweep, recipe_folder = target_sweep(name_or_path, overrides)
    recipe = sweep.recipe(0)
    views = (
        f"{recipe.grid.rows} x {recipe.grid.cols} views of {recipe.grid.height} x {recipe.grid.width} pixels"
    )
    pitch = f"pitch {recipe.grid.pitch_mm[0]:g} x {recipe.grid.pitch_mm[1]:g} mm"
    seen_by = f"{views}, {pitch}, {recipe.sensor.cfa}{_first_values(sweep)}"
    numbers = _draws(sweep)
    if scene_number is None and numbers and is_scene_distribution(recipe.scene, recipe_folder):
        scenes = {number: _draw(recipe.scene, recipe_folder, number) for number in numbers}
        line = f"{recipe.title or recipe.scene}, draws {numbers[0]} to {numbers[-1]}: {seen_by}"
        return line, draw_findings(scenes, recipe.grid.camera_grid(), recipe.analysis.z_mm)
    target = target_of(sweep, recipe_folder, scene_number)
    line = f"{target.recipe.title or target.scene.title}: {seen_by}"
    return line, hopeless(needs_of(target.recipe)) or findings(probe_scene(target))


def _draws(sweep: Sweep) -> Sequence[int]:
    """The first draws of its scene that a recipe has datasets of, any if it names none, or else nothing."""
    for axis in sweep.axes:
        if axis.field == "scene_number":
            return axis.values[:DRAWS]
    return range(DRAWS) if sweep.recipe(0).scene_number is None else ()


def _first_values(sweep: Sweep) -> str:
    """Says which values of fields with several are looked at, but for the draws of a scene."""
    return "".join(
        f"; of {axis.field} the first of {len(axis.values)} values, {json.dumps(axis.values[0])}"
        for axis in sweep.axes
        if axis.field != "scene_number"
    )


def _draw(name_or_path: str, recipe_folder: Path | None, number: int) -> Scene | InputError:
    """A draw of a distribution of scenes, or what is wrong with it."""
    try:
        return load_scene(name_or_path, recipe_folder, number)[0]
    except InputError as fault:
        return fault


def findings(facts: Facts) -> list[Finding]:
    """All findings, in the order in which one would mend them."""
    return [
        *sight_findings(facts),
        *depth_findings(facts),
        *photon_findings(facts),
        *cost_findings(facts),
    ]
