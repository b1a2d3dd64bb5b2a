"""`simgen check`: what a scene or recipe will give, told without rendering it, but for one coarse probe."""

from collections.abc import Sequence

from simgen.check_cost import cost_findings
from simgen.check_depth import depth_findings
from simgen.check_photons import photon_findings
from simgen.check_sight import sight_findings
from simgen.facts import Facts, Finding
from simgen.probe_scene import probe_scene
from simgen.targets import load_target


def check(name_or_path: str, overrides: Sequence[str] = ()) -> tuple[str, list[Finding]]:
    """A line that says what was checked, and all findings. Raises `InputError` for invalid files."""
    recipe, scene, folder = load_target(name_or_path, overrides)
    grid = recipe.grid
    line = (
        f"{recipe.title or scene.title}: {grid.rows} x {grid.cols} views of {grid.height} x {grid.width} "
        f"pixels, pitch {grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm, {recipe.sensor.cfa}"
    )
    return line, findings(probe_scene(recipe, scene, folder))


def findings(facts: Facts) -> list[Finding]:
    """All findings, in the order in which one would mend them."""
    return [
        *sight_findings(facts),
        *depth_findings(facts),
        *photon_findings(facts),
        *cost_findings(facts),
    ]
