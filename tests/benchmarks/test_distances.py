"""Figures of single studies, on arrays small enough to know the answer."""

import numpy as np
import pytest

from benchmarks.photon_distance import Rates, distances
from benchmarks.studies import demosaicing, radiance_images, section_growth, sections, skips
from benchmarks.studies.depth_and_focus import BOUND, DEPTH, REMOVAL, _ratios, _rows
from benchmarks.studies.photon_images import CROSSOVERS, THINNING, _crossovers, dense_name
from pcii.evaluation.rows import frame_of
from pcii.evaluation.summary import means

RATES = np.random.default_rng(5).uniform(0.2, 1.8, (2, 64, 64)) / 64**2
BUDGET = 5.0 * 64**2


def counts_of(rates: np.ndarray, repeats: int, noise: float) -> np.ndarray:
    """Poisson counts (R, V, H, W) whose rates are off by this standard deviation relative to them."""
    rng = np.random.default_rng(7)
    size = repeats, *rates.shape
    off = rng.gamma(1 / noise**2, noise**2, size) if noise else np.ones(size)
    return rng.poisson(BUDGET * rates * off)


def test_poisson_counts_have_no_distance() -> None:
    found = distances(counts_of(RATES, 8, 0), Rates(RATES, 0 * RATES), BUDGET)
    # Standard errors: 2 x 64 x 64 x 7 degrees of freedom give 0.6 %, 256 tiles-and-repeats some 6 %.
    assert found["dispersion"].value == pytest.approx(1, abs=0.03)
    assert found["tile_chi_square"].value == pytest.approx(1, abs=0.25)
    assert found["rmse_of_mean"].value == pytest.approx(1, abs=0.05)
    low, high = found["dispersion"].low, found["dispersion"].high
    assert low is not None
    assert high is not None
    assert low < 1.01
    assert high > 0.99


def test_noise_of_rendering_shows() -> None:
    found = distances(counts_of(RATES, 8, 0.5), Rates(RATES, 0 * RATES), BUDGET)
    # Variance of a rate r is 0.25 r^2 more, and the mean of r^2 over that of r is 5 (1 + 0.8^2 / 3) = 6.07.
    assert found["dispersion"].value == pytest.approx(1 + 0.25 * 6.07, rel=0.05)


def test_wrong_rates_show_in_tiles_and_noise_of_the_truth_does_not() -> None:
    wrong = RATES.copy()
    wrong[:, :32] *= 1.2
    counts = counts_of(RATES, 4, 0)
    assert distances(counts, Rates(wrong, 0 * RATES), BUDGET)["tile_chi_square"].value > 5
    allowed = distances(counts, Rates(wrong, (0.2 * wrong) ** 2 * 256), BUDGET)
    assert allowed["tile_chi_square"].value < 1


def test_crossovers_lie_between_the_budgets_that_were_tried() -> None:
    seconds = {(THINNING, 10.0): [1.0], (THINNING, 1000.0): [4.0]}
    seconds |= {(dense_name(n), b): [t] for n, t in ((1, 0.5), (4, 2.0), (16, 8.0)) for b in (10.0, 1000.0)}
    found = _crossovers("matt", (1, 4, 16), seconds)
    assert [row.parameters["where"] for row in found] == ["below", "at", "above"]
    assert all(row.table == CROSSOVERS for row in found)
    # Half way in logarithms, of time and of photons.
    assert found[1].values["photons_per_view"].value == pytest.approx(100)


def test_exponents_are_slopes_of_logarithms() -> None:
    numbers = [1, 10, 100]
    found = section_growth._slope(numbers, [[0.1 * n**1.5] * 6 for n in numbers])
    assert found.value == pytest.approx(1.5)


def test_errors_of_sections_are_relative_to_the_contrast() -> None:
    truth = np.full((64, 64, 1), 0.5)
    found = truth + 0.03
    found[20, 20] = np.nan
    told = sections.errors(found, truth, 8)
    assert told["rmse_percent"].value == pytest.approx(20)
    assert told["covered_percent"].value == pytest.approx(100 * (1 - 1 / 48**2))


def test_errors_of_colours_by_hand() -> None:
    truth = np.full((16, 16, 3), 0.5)
    told = demosaicing.errors(truth + 0.1, truth)
    assert told["cpsnr_db"].value == pytest.approx(20)
    assert demosaicing.errors(truth, truth)["ciede2000"].value == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("black_rows", [0, 500])
def test_bias_is_told_from_noise_on_what_is_lit(black_rows: int) -> None:
    rng, truth = np.random.default_rng(3), np.zeros((32 + black_rows, 32, 3))
    truth[:32] = 1
    noisy = truth + truth * rng.normal(0, 0.5, (8, *truth.shape))
    told = radiance_images.errors(noisy.astype(np.float32), truth)
    assert told["rmse_percent"].value == pytest.approx(50, rel=0.03)
    assert told["bias_percent"].value < 4
    assert radiance_images.errors((noisy + 0.2 * truth).astype(np.float32), truth)[
        "bias_percent"
    ].value == pytest.approx(20, rel=0.1)


def test_a_difference_of_one_byte_is_a_difference() -> None:
    one = {"a": np.array([1.0, np.nan]), "b": np.zeros(2, np.int64)}
    assert skips.are_same(one, {name: each.copy() for name, each in one.items()})
    assert not skips.are_same(one, one | {"b": np.array([0, 1])})
    assert not skips.are_same(one, {"a": one["a"]})


def test_results_of_an_evaluation_become_rows() -> None:
    head = {"title": "balls", "recipe": "r", "identity": "1", "dataset": "balls", "budget": 100.0}
    head |= {"seed": 1, "photons_per_view": 100.0, "seconds": 0.5}
    planes = [{"z_mm": 1.0, "truth": "object", "object": "ball", "iou": 0.8}]
    measured = [
        {"method": "depth:posterior", "depth": {"bad_1px": 0.1, "median_px": None}, "bound_px": 0.25},
        {"method": "depth:variance-sweep", "depth": {"bad_1px": 0.4}},
        {"method": "likelihood", "planes": planes, "objects": []},
    ]
    rows = _rows(means(frame_of([head | row for row in measured])))
    assert [row.table for row in rows] == [DEPTH, DEPTH, REMOVAL, BOUND]
    assert (rows[0].values["time_ms"].value, rows[0].values["time_ms"].high) == (500, None)
    assert rows[0].values["bad_1px_percent"].value == 10
    assert "median_px" not in rows[0].values
    assert rows[3].values["sigma_px"].value == 0.25
    (ratio,) = _ratios(rows)
    assert ratio.name == "balls, 100 photons: errors of the better sweep against depth:posterior"
    assert ratio.ratio.value == pytest.approx(4)
