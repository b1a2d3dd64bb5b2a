"""Findings on many draws of a distribution: scenes with one fault each, made by hand."""

from pathlib import Path
from typing import Any

import pytest

from pcii.base.errors import InputError
from simgen.check.linter import DRAWS, lint
from simgen.check.many_draws import draw_findings
from simgen.check.scene_facts import Finding
from simgen.check.targets import load_target
from simgen.spec.camera_grid import Grid
from simgen.spec.scene import Scene

GRID = Grid().camera_grid()
LIGHT = {"type": "uniform", "luminance_cd_m2": 100.0}
GREY = {"reflectance": [0.5, 0.5, 0.5]}


def thing(name: str, x: float, z: float, shape: dict[str, Any]) -> dict[str, Any]:
    return {"name": name, "position_mm": [x, 0.0, z], "shape": shape, "material": GREY}


def ball(name: str, x: float, z: float) -> dict[str, Any]:
    return thing(name, x, z, {"type": "sphere", "radius_mm": 10.0})


def scene(*objects: dict[str, Any], planes_mm: tuple[float, ...] = (500.0,)) -> Scene:
    return Scene.model_validate(
        {"title": "a", "objects": objects, "lights": [LIGHT], "planes_mm": list(planes_mm)}
    )


def verdicts(*scenes: Scene | InputError, z_mm: tuple[float, ...] = ()) -> dict[str, Finding]:
    found = draw_findings(dict(enumerate(scenes)), GRID, z_mm)
    return {f"{finding.verdict} {finding.subject}": finding for finding in found}


def test_draws_without_a_fault_are_ok() -> None:
    wall = thing("wall", 0, 511, {"type": "card", "width_mm": 900.0, "height_mm": 900.0})
    # In the sphere about the wall, but not in the wall.
    apart = scene(ball("a", -20, 500), ball("b", 20, 500), wall, planes_mm=(500.0, 511.0))
    assert verdicts(apart, apart).keys() == {"ok draws", "ok objects", "ok overlap", "ok focus"}


def test_objects_outside_the_film_are_counted_by_draw() -> None:
    # The film shows 180 mm to either side at 500 mm, and corner cameras 22.5 mm more.
    inside, outside = scene(ball("a", 205, 500)), scene(ball("b", 230, 500))
    found = verdicts(inside, outside, inside, outside)
    assert found["warn objects"].text == ("2 of 4 draws (1, 3) have objects outside all films, such as b")
    assert found["ok draws"].text == "2 of 4 have findings"


def test_objects_in_one_another_are_named() -> None:
    touching, overlapping = (scene(ball("a", 0, 500), ball("b", x, 500)) for x in (20, 19))
    assert "ok overlap" in verdicts(touching)
    assert "such as a and b" in verdicts(touching, overlapping)["note overlap"].text


def test_objects_must_reach_a_plane() -> None:
    # At 500 mm a blur of 2 px is 7.8 mm of depth; the ball reaches from 490 to 510 mm.
    for plane, verdict in ((500, "ok"), (515, "ok"), (519, "warn"), (485, "ok"), (481, "warn")):
        planes = (300.0, float(plane))
        assert f"{verdict} focus" in verdicts(scene(ball("a", 0, 500), planes_mm=planes)), plane
        # What the recipe names comes first.
        assert f"{verdict} focus" in verdicts(scene(ball("a", 0, 500)), z_mm=planes), plane
    assert "warn focus" in verdicts(scene(ball("a", 0, 500), planes_mm=()))


def test_a_draw_that_is_not_valid_is_bad() -> None:
    found = verdicts(scene(ball("a", 0, 500)), InputError("x, draw 1: 'title' is missing"))
    assert found["bad draws"].text == "1 of 2 draws (1) are not valid: x, draw 1: 'title' is missing"


@pytest.mark.parametrize("name", ["drawn_room", "drawn_solids", "drawn_foliage"])
def test_scenes_that_ship_are_drawn_without_a_warning(name: str) -> None:
    line, found = lint(name)
    assert line.startswith(f"{name}, draws 0 to {DRAWS - 1}: 10 x 10 views")
    assert {finding.verdict for finding in found} <= {"ok", "note"}


def test_a_recipe_with_several_values_is_looked_at_by_its_first_ones(tmp_path: Path) -> None:
    recipe = tmp_path / "many.toml"
    recipe.write_text(
        'scene = "drawn_plain"\nscene_number = { range = [30, 90] }\n[photons]\nbudget = [100, 300]\n'
    )
    line, _ = lint(str(recipe))
    assert line.startswith(f"drawn_plain, draws 30 to {30 + DRAWS - 1}: 10 x 10 views")
    assert line.endswith("; of photons.budget the first of 2 values, 100")
    target = load_target(str(recipe))
    assert target.recipe.scene_number == 30
    assert target.recipe.photons.budget == 100
    assert load_target(str(recipe), scene_number=3).recipe.scene_number == 3
    with pytest.raises(InputError, match="budget = -1"):
        lint(str(recipe), ["photons.budget=[100,-1]"])
