"""Photons that come through glass: one by one they must be as many as in rendered views."""

import numpy as np
import pytest
from lit_views import SCALAR, card, film, in_scalar_mode, made, seen, surprise, thinned

from simgen import backend

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


def test_photons_through_glass_are_those_of_rendered_views() -> None:
    # In uniform light glass gathers none, and rendered views are clean.
    backend.load()
    built = made([BEHIND, BALL, PANE], [EVENLY], max_depth=DEPTH)
    view = seen(built, GRID, 512 if SCALAR else 8192)
    gain = (20_000 if SCALAR else 200_000) / view.sum() * 3
    photons = thinned(built, GRID, DEPTH, gain)
    assert abs(surprise(photons, view, GRID, gain)) < 5
    assert photons.log["overshoot_photons"] <= max(1e-4 * photons.k.size, 3)
    # The faults: what is seen through the pane, or upside down in the ball, is that without glass.
    bare = seen(made([BEHIND], [EVENLY], max_depth=DEPTH), GRID, 256)
    for half in (slice(0, 16), slice(16, 32)):
        without = view.copy()
        without[:, half] = bare[:, half]
        assert surprise(photons, without, GRID, gain) > 5
    # The fault: paths that are too short to leave the glass.
    short = seen(made([BEHIND, BALL, PANE], [EVENLY], max_depth=3), GRID, 256)
    assert surprise(photons, np.maximum(short, 1e-3), GRID, gain) > 5


def test_scalar_mode_passes_the_tests_of_this_file() -> None:
    in_scalar_mode(__file__)
