"""`simgen check`: what a scene or recipe will give, found without rendering it, but for one coarse probe."""

import json
from collections.abc import Sequence

from simgen.check.costs import cost_findings, hopeless
from simgen.check.depths import depth_findings
from simgen.check.expected_photons import photon_findings
from simgen.check.scene_facts import Facts, Finding
from simgen.check.scene_probe import probe_scene
from simgen.check.sight import sight_findings
from simgen.check.targets import target_of, target_sweep
from simgen.dataset.prepared import needs_of
from simgen.spec.sweeps import Sweep


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
    found = hopeless(needs_of(target.recipe)) or findings(probe_scene(target))
    return f"{line}{_first_values(sweep)}", found


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
