"""Depth errors on maps small enough to count by hand, and the bound on depth against a numerical one."""

from typing import Any

import numpy as np
import pytest
from twins import unit_grid

from pcii.base import InputError
from pcii.metrics import calibration, depth_bound_px, depth_errors, hci_errors, object_bounds
from pcii.sections import reconstruct
from pcii.types import (
    CameraGrid,
    DepthMap,
    PhotonTruth,
    Truth,
    Views,
    depth_of_total_disparity_mm,
    total_disparity_px,
)

GRID = unit_grid(3, 3, 40, 50)  # disparity 1 / z px, total disparity 2 / z px


def errors(true: np.ndarray, estimate: np.ndarray, grid: CameraGrid = GRID) -> dict[str, float | None]:
    """The metrics of two maps of disparity; NaN in an estimate is no answer, 0 in the truth is nothing."""
    with np.errstate(divide="ignore"):
        z = 1 / true
    truth = Truth(z, np.zeros(z.shape, dtype=int), {})
    return hci_errors(grid, DepthMap(1 / estimate, np.ones(z.shape)), truth, np.isfinite(z))


def test_bad_pixels_mean_square_and_quartile_are_counted_by_hand() -> None:
    true = np.full((40, 50), 2.0)
    estimate = true.copy()
    # Inside the border of 15 px are 10 x 20 = 200 pixels; 20 of them are off by 0.02, 40 by 0.05, 60 by 0.1.
    inner = estimate[15:25, 15:35]
    inner[0], inner[1:3], inner[3:6] = 2.02, 1.95, 2.1
    estimate[:15] = 9.0  # in the border, which does not count
    found = errors(true, estimate)
    assert found["badpix_007"] == 0.3
    square = (20 * 0.02**2 + 40 * 0.05**2 + 60 * 0.1**2) / 200
    assert found["mse_x100"] == pytest.approx(100 * square)
    assert found["q25_x100"] == pytest.approx(0.0, abs=1e-12)


def test_a_missing_answer_is_bad_and_left_out_of_means() -> None:
    true = np.full((40, 50), 2.0)
    estimate = true + 0.02
    estimate[15:20] = np.nan
    found = errors(true, estimate)
    assert found["badpix_007"] == 0.5
    assert found["mse_x100"] == pytest.approx(0.04)
    assert found["q25_x100"] == pytest.approx(2.0)
    nothing = errors(true, np.full((40, 50), np.nan))
    assert nothing["badpix_007"] == 1.0
    assert nothing["mse_x100"] is nothing["q25_x100"] is None
    # So far away that no depth at all would be a good guess.
    far = errors(np.full((40, 50), 0.005), np.full((40, 50), np.nan))
    assert far["badpix_007"] == 1.0


def test_all_pixels_and_those_of_objects_are_distinguished() -> None:
    z = np.full((40, 50), 0.5)
    ids = np.zeros((40, 50), dtype=int)
    ids[20:] = 1  # of the 10 rows inside the border the lower 5
    estimate = np.where(ids > 0, 0.5, np.nan)
    found = depth_errors(GRID, DepthMap(estimate, np.ones(z.shape)), Truth(z, ids, {1: "slab"}))
    assert found["hci"]["badpix_007"] == 0.5
    assert found["hci_objects"]["badpix_007"] == 0.0
    assert found["coverage"] == 1.0
    nameless = Truth(np.where(ids > 0, z, np.inf), np.zeros_like(ids), {})  # then all that is hit is judged
    alike = depth_errors(GRID, DepthMap(estimate, np.ones(z.shape)), nameless)
    assert alike["hci"] == alike["hci_objects"]
    assert [alike[key] for key in ("coverage", "median_mm", "bad_1px")] == [1.0, 0.0, 0.0]


def test_bias_is_the_median_of_signed_errors_and_above_0_for_too_far() -> None:
    wall_mm = np.full((40, 50), 0.5)
    truth = Truth(wall_mm, np.ones(wall_mm.shape, dtype=int), {1: "wall"})
    for error_px in (-0.5, 0.5):
        total_px = total_disparity_px(GRID, wall_mm) - error_px
        total_px[:15] += 2 * error_px  # fewer are off the other way, as far
        depth = DepthMap(depth_of_total_disparity_mm(GRID, total_px), np.ones(wall_mm.shape))
        found = depth_errors(GRID, depth, truth)
        assert found["bias_px"] == pytest.approx(error_px)
        assert found["median_px"] == pytest.approx(0.5)


def calibrated(total_px: np.ndarray, confidence: np.ndarray, true_px: np.ndarray) -> dict[str, Any]:
    """`calibration` of maps of total disparity; NaN: no answer, 0 in the truth: nothing is hit."""
    with np.errstate(divide="ignore"):
        z = 2 / true_px
    grid = unit_grid(3, 3, *z.shape)
    truth = Truth(z, np.isfinite(z).astype(int), {1: "wall"})
    return calibration(grid, DepthMap(2 / total_px, confidence), truth)


def test_reliability_is_counted_by_hand() -> None:
    # 1 px off is still right, and more is not; the fifth is of nothing, and the last is no answer.
    true = np.array([[8.0, 8.0, 8.0, 8.0, 0.0, 8.0]])
    estimate = np.array([[8.0, 9.0, 6.75, 8.5, 0.5, np.nan]])
    confidence = np.array([[0.75, 0.75, 0.75, 1.0, 0.25, 0.0]])
    found = calibrated(estimate, confidence, true)
    bins = found["reliability"]
    assert list(bins) == [f"0.{n}-{(n + 1) / 10}" for n in range(10)]
    assert bins["0.7-0.8"] == {"share": 0.6, "confidence": 0.75, "correct": pytest.approx(2 / 3)}
    assert bins["0.9-1.0"] == {"share": 0.2, "confidence": 1.0, "correct": 1.0}
    assert bins["0.2-0.3"] == {"share": 0.2, "confidence": 0.25, "correct": 0.0}
    assert bins["0.0-0.1"] == {"share": 0.0, "confidence": None, "correct": None}
    assert found["ece"] == pytest.approx(0.6 * (0.75 - 2 / 3) + 0.2 * 0.25)


def test_a_map_that_is_as_often_right_as_it_says_is_calibrated_and_an_overconfident_one_is_not() -> None:
    rng = np.random.default_rng(5)
    stated = rng.random((400, 500))
    true = np.full(stated.shape, 8.0)
    estimate = np.where(rng.random(stated.shape) < stated, 8.4, 11.0)
    # Each of ten bins of 20 000 pixels is off by 0.003 at most, as a standard deviation.
    assert calibrated(estimate, stated, true)["ece"] < 0.004
    # Planted: who always says 1 is right half the time; who says sqrt(p) is over by 2/3 - 1/2 on average.
    assert calibrated(estimate, np.ones(stated.shape), true)["ece"] == pytest.approx(0.5, abs=0.005)
    over = calibrated(estimate, np.sqrt(stated), true)
    assert over["ece"] == pytest.approx(1 / 6, abs=0.005)
    assert all(one["correct"] < one["confidence"] for one in over["reliability"].values())


def test_the_quadratic_score_is_largest_for_the_true_probability_and_missing_answers_are_errors() -> None:
    """Of 100 pixels 70 are right; confidence is the same everywhere."""
    truth = Truth(np.full((10, 10), 0.5), np.ones((10, 10), dtype=int), {1: "wall"})
    z = np.full((10, 10), 0.5)
    z[:3] = 1.0

    def scored(confidence: float, z_mm: np.ndarray = z) -> dict[str, Any]:
        return depth_errors(unit_grid(3, 3, 10, 10), DepthMap(z_mm, np.full(z.shape, confidence)), truth)

    scores = {c / 10: scored(c / 10)["quadratic_score"] for c in range(11)}
    assert max(scores, key=scores.__getitem__) == 0.7
    assert scores[0.7] == pytest.approx(0.7**2)
    assert (scores[0.0], scores[1.0]) == (0.0, pytest.approx(0.7 - 0.3))
    assert scored(0.7)["brier"] == pytest.approx(0.7 * 0.3**2 + 0.3 * 0.7**2)
    partly = np.where(z == 0.5, z, np.nan)
    partly[3:6] = np.nan  # 40 answers of 100, all right
    assert scored(1.0, partly)["quadratic_score"] == 0.4
    assert (scored(1.0, partly)["median_px"], scored(1.0, z)["median_px"]) == (None, 0.0)


def test_a_confidence_that_is_no_probability_is_refused() -> None:
    confidence = np.array([[0.5, np.nan]])
    with pytest.raises(InputError, match=r"^confidence: expected probabilities"):
        calibrated(np.full((1, 2), 8.0), confidence, np.full((1, 2), 8.0))


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
