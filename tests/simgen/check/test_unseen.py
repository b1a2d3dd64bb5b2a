"""`simgen check` tells in plain words why an object is not seen."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pcii.core.camera_grid import CameraGrid
from simgen.check.scene_facts import Finding
from simgen.check.scene_probe import on_film, probe_scene
from simgen.check.targets import findings
from simgen.dataset.prepared import Prepared
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene

pytestmark = pytest.mark.renders
FILM = {"rows": 3, "cols": 3, "height": 64, "width": 64, "pixel_mm": 0.5632}  # 180 mm to each side at 500 mm
LAMP = {
    "type": "area",
    "position_mm": (0.0, 0.0, 300.0),
    "target_mm": (0.0, 0.0, 600.0),
    "width_mm": 100.0,
    "height_mm": 100.0,
    "luminance_cd_m2": 100.0,
}


def card(x_mm: float, z_mm: float, *, name: str = "card", side_mm: float = 40.0) -> dict[str, Any]:
    return {
        "name": name,
        "position_mm": (x_mm, 0.0, z_mm),
        "shape": {"type": "card", "width_mm": side_mm, "height_mm": side_mm},
        "material": {"reflectance": (0.5, 0.5, 0.5)},
    }


def ball(z_mm: float, radius_mm: float) -> dict[str, Any]:
    return card(0.0, z_mm) | {"shape": {"type": "sphere", "radius_mm": radius_mm}}


def looked_at(*objects: dict[str, Any], lamps: tuple = (), wall_mm: float = 900.0) -> list[Finding]:
    around = {"type": "uniform", "luminance_cd_m2": 10.0}
    values = {"title": "t", "objects": objects, "lights": [around, *lamps], "backdrop": {"z_mm": wall_mm}}
    recipe = Recipe.model_validate({"scene": "-", "grid": FILM, "photons": {"budget": 100}})
    target = Prepared(recipe, Scene.model_validate(values), Path(), None)
    subjects = ("objects", "backdrop")
    return [one for one in findings(probe_scene(target)) if one.verdict == "bad" and one.subject in subjects]


@pytest.mark.parametrize(
    ("objects", "lamps", "reason"),
    [
        ([card(0, 500)], (LAMP,), "something hides it"),
        ([card(0, 500), card(0, 400, name="sign")], (), "something hides it"),
        ([card(0, 901)], (), "it is behind the backdrop at 900 mm"),
        ([card(400, 500)], (), "it is outside the field of view, which at 500 mm reaches 180 mm"),
        ([card(100, 500, side_mm=1)], (), "it is smaller than a pixel (0.18 px)"),
        ([card(0, 0)], (), "it is in the plane of the cameras: Z runs forward"),
        ([card(0, -90)], (), "it is behind the cameras (z up to -90 mm): Z runs forward"),
    ],
)
def test_why_an_object_is_not_seen(objects: list, lamps: tuple, reason: str) -> None:
    (finding,) = looked_at(*objects, lamps=lamps)
    assert finding.text == "no camera sees card"
    assert finding.remedy.startswith(reason)


@pytest.mark.parametrize(
    "thing", [card(0, 0.48), card(0, 0.48, side_mm=0.04), ball(0.48, 30), ball(0.48, 0.03)]
)
def test_metres_are_told(thing: dict[str, Any]) -> None:
    told = next(one for one in looked_at(thing) if one.subject == "objects")
    assert told.text == "card stands at z = 0.48 mm, right before the cameras"
    assert told.remedy == "did you mean 480 mm? lengths are in millimetres"


def test_a_backdrop_in_metres_is_told() -> None:
    told = next(one for one in looked_at(card(0, 500), wall_mm=0.9) if one.subject == "backdrop")
    assert told.remedy == "did you mean 900 mm? lengths are in millimetres"


def test_what_is_near_on_purpose_is_not_taken_for_metres() -> None:
    assert looked_at(card(0, 60, side_mm=20)) == []


def test_a_box_on_the_film_by_hand() -> None:
    grid = CameraGrid(**FILM, focal_mm=50.0, pitch_mm=(5.0, 5.0))
    box = np.array([[0.0, -20.0, 400.0], [40.0, 20.0, 500.0]])
    per_mm = 50 / 0.5632  # px at a depth of 1 mm
    found = on_film(box, grid)
    assert found.size_px == pytest.approx((40 / 400 * per_mm, 40 / 400 * per_mm))
    assert found.in_view
    # The film's right border sees X = 0.36 Z; the corner camera at X = 5 mm sees 5 mm further.
    assert on_film(box + np.array([0.36 * 500 + 4, 0, 0]), grid).in_view
    assert not on_film(box + np.array([0.36 * 500 + 6, 0, 0]), grid).in_view
    assert on_film(box - np.array([0, 0, 450]), grid).in_view  # it reaches behind the cameras
