"""`simgen check`: what a scene or recipe will give, found without rendering it, but for one coarse probe."""

from collections.abc import Sequence

from simgen.check.costs import cost_findings, hopeless
from simgen.check.depths import depth_findings
from simgen.check.expected_photons import photon_findings
from simgen.check.scene_facts import Facts, Finding
from simgen.check.scene_probe import probe_scene
from simgen.check.sight import sight_findings
from simgen.check.targets import load_target
from simgen.dataset.prepared import needs_of


def lint(name_or_path: str, overrides: Sequence[str] = ()) -> tuple[str, list[Finding]]:
    """A line that says what was checked, and all findings. Raises `InputError` for invalid files."""
    target = load_target(name_or_path, overrides)
    recipe, grid = target.recipe, target.recipe.grid
    views = f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels"
    pitch = f"pitch {grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm"
    line = f"{recipe.title or target.scene.title}: {views}, {pitch}, {recipe.sensor.cfa}"
    return line, hopeless(needs_of(recipe)) or findings(probe_scene(target))


def findings(facts: Facts) -> list[Finding]:
    """All findings, in the order in which one would mend them."""
    return [
        *sight_findings(facts),
        *depth_findings(facts),
        *photon_findings(facts),
        *cost_findings(facts),
    ]
