"""The bound on depth against a numerical one."""

import numpy as np
import pytest
from twins import unit_grid

from pcii.metrics import depth_bound_px, object_bounds
from pcii.sections import reconstruct
from pcii.types import CameraGrid, PhotonTruth, Truth, Views


@pytest.mark.parametrize("grid", [unit_grid(10, 10, 64, 64), unit_grid(4, 6, 64, 64, pitch_mm=(1.0, 2.5))])
def test_the_bound_is_one_over_the_root_of_a_numerical_fisher_information(grid: CameraGrid) -> None:
    """Rates of every view as formulas, differentiated by the spread; one axis has more texture."""
    y, x = np.mgrid[:64, :64] * (2 * np.pi / 64)

    def rate(dx: float, dy: float) -> np.ndarray:
        return 0.02 * np.exp(0.8 * np.sin(3 * (x - dx)) + 0.4 * np.sin(2 * (y - dy) + 1))

    longer = max((grid.cols - 1) * grid.pitch_mm[0], (grid.rows - 1) * grid.pitch_mm[1])
    information, photons, step_px = 0.0, 0.0, 1e-3
    unit = 2 * np.pi / 64
    for k, l in np.ndindex(grid.rows, grid.cols):
        a = (l - (grid.cols - 1) / 2) * grid.pitch_mm[0] / longer
        b = (k - (grid.rows - 1) / 2) * grid.pitch_mm[1] / longer
        ahead, behind = (rate(u * a * unit, u * b * unit) for u in (step_px, -step_px))
        information += (((ahead - behind) / (2 * step_px)) ** 2 / rate(0, 0)).sum()
        photons += rate(0, 0).sum()
    g_x = 0.8 * 3 * np.cos(3 * x) * unit
    g_y = 0.4 * 2 * np.cos(2 * y + 1) * unit
    weight = rate(0, 0) / rate(0, 0).sum()
    squares = float((weight * g_x**2).sum()), float((weight * g_y**2).sum())
    # Central differences of 1e-3 px are exact to their square.
    assert depth_bound_px(grid, photons, squares) == pytest.approx(information**-0.5, rel=1e-5)


def test_without_information_on_depth_there_is_no_bound() -> None:
    grid = unit_grid(3, 3, 4, 4)
    assert depth_bound_px(grid, 0, (0.1, 0.1)) is None
    assert depth_bound_px(grid, 100, (0.0, 0.0)) is None
    assert depth_bound_px(unit_grid(1, 1, 4, 4), 100, (0.1, 0.1)) is None


def test_objects_have_bounds_where_light_texture_and_photons_are_known() -> None:
    grid = unit_grid(3, 5, 60, 80)  # texture along rows and down columns tells depth differently well
    ids = np.zeros((60, 80), dtype=int)
    ids[:, :40], ids[:, 45:] = 1, 2
    z = np.where(ids == 1, 0.5, np.where(ids == 2, 1.0, np.inf))
    n = 400
    zero = np.zeros(n, dtype=int)
    photons = PhotonTruth(zero, zero, zero, zero, np.repeat([1, 0], n // 2), np.full(n, 0.5))
    true = Truth(z, ids, {1: "sloped", 2: "flat", 3: "unseen"}, photons)
    light = np.ones((*grid.shape_KLHW, 1))
    columns = np.arange(80)
    for l in range(5):  # at z = 0.5 the disparity is 2 px: column j of the centre is j - 2 (l - 2) here
        light[:, l, :, :, 0] = np.exp(0.05 * np.minimum(columns + 2 * (l - 2), 39))
    full = reconstruct(Views(light, grid), [0.5, 1.0])
    rows = object_bounds(true, full, None)
    assert [(row["name"], row["photons"]) for row in rows] == [("sloped", 200), ("flat", 0), ("unseen", 0)]
    assert rows[0]["log_gradient_per_px"] == pytest.approx(0.05, rel=1e-2)
    c_x = (5 + 1) / (12 * (5 - 1))
    assert rows[0]["depth_sigma_px"] == pytest.approx(1 / np.sqrt(c_x * 200 * 0.05**2), rel=1e-2)
    assert rows[1]["depth_sigma_px"] is rows[2]["depth_sigma_px"] is None
    assert {row["depth_sigma_px"] for row in object_bounds(true, None, None)} == {None}
