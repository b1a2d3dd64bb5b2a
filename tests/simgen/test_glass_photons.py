"""Photons that come through glass: one by one they must be as many as in rendered views."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import lit_views
import numpy as np
import pytest
from lit_views import SCALAR, card, film, seen, sky, surprise, thinned

from simgen.renderer import RenderScene

pytestmark = pytest.mark.renders
DEPTH = 8
EVENLY = {"type": "uniform", "luminance_cd_m2": 1.0}
CHECKS = {"type": "checks", "rows": 7, "columns": 5, "colours": [[0.9, 0.9, 0.9], [0.1, 0.2, 0.6]]}
BEHIND = card(600.0, 500.0, {"texture": CHECKS})
GLASS = {"finish": {"type": "glass"}}
BALL = {
    "name": "ball",
    "position_mm": (-70.0, 20.0, 400.0),
    "shape": {"type": "sphere", "radius_mm": 55.0},
    "material": GLASS,
}
PANE = {
    "name": "pane",
    "position_mm": (70.0, 0.0, 450.0),
    "rotation_deg": (0.0, 40.0, 0.0),
    "shape": {"type": "card", "width_mm": 120.0, "height_mm": 180.0},
    "material": GLASS,
}
GRID = film()


@pytest.mark.parametrize(("thing", "index"), [(BALL, 1.5), (PANE, 2.0)], ids=["ball", "pane"])
def test_glass_reflects_what_fresnel_says(thing: dict[str, Any], index: float) -> None:
    glass = thing | {"position_mm": (0.0, 0.0, 400.0), "rotation_deg": (0.0, 0.0, 0.0)}
    glass["material"] = {"finish": {"type": "glass", "refractive_index": index}}
    black = card(600.0, 5000.0, {"reflectance": [0, 0, 0]})
    # Right in the middle, where both surfaces are met at right angles: R and, from inside, again and again.
    view = seen(lit_views.made([black, glass], [EVENLY], max_depth=DEPTH), film(4, 4, focal_mm=5000.0), 16384)
    once = ((index - 1) / (index + 1)) ** 2
    # A quarter of a million paths, each of which brings 0 or 1.
    both = 2 * once / (1 + once)
    assert abs(view.mean() - both) < 4 * np.sqrt(both / 262_144)


@pytest.mark.parametrize(("light", "depth"), [("uniform", DEPTH), ("an image", 4)])
def test_photons_through_glass_are_those_of_rendered_views(light: str, depth: int, tmp_path: Path) -> None:
    # Glass gathers no uniform light, and of an image as smooth as this not much: rendered views are clean.
    pixels = np.linspace(1.6, 0.4, 16)[:, None, None] * np.ones((16, 32, 3))
    lamp = EVENLY if light == "uniform" else sky(tmp_path, pixels)

    def made(objects: Sequence[dict[str, Any]], max_depth: int) -> RenderScene:
        return lit_views.made(objects, [lamp], max_depth=max_depth, folder=tmp_path)

    built = made([BEHIND, BALL, PANE], max_depth=depth)
    view = seen(built, GRID, 512)
    gain = (20_000 if SCALAR else 40_000) / view.sum() * 3
    photons, log = thinned(built, GRID, gain)
    assert abs(surprise(photons, view, GRID, gain)) < 5
    assert log["paths_above_bound"] <= max(1e-3 * photons.k.size, 3)
    # The faults: what is seen through the pane, or upside down in the ball, is that without glass.
    bare = seen(made([BEHIND], max_depth=depth), GRID, 128)
    for half in (slice(0, 16), slice(16, 32)):
        without = view.copy()
        without[:, half] = bare[:, half]
        assert surprise(photons, without, GRID, gain) > 5
    # The fault: paths that are too short to leave the glass.
    short = seen(made([BEHIND, BALL, PANE], max_depth=3), GRID, 128)
    assert surprise(photons, np.maximum(short, 1e-3), GRID, gain) > 5
