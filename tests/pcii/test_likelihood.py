import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import xlogy
from twins import bayer_photons, blocky_texture, patch_views, unit_grid

from pcii.likelihood import (
    LARGEST_RATE,
    cell_shape,
    cells_to_pixels,
    flat_deviation,
    flat_information,
    focus_scores,
)
from pcii.photon_counts import PhotonCounts
from pcii.reconstruct import reconstruct

DISPARITIES = np.arange(1, 9)  # z = 1 / d mm on a unit grid


def information_twin(rate: float) -> float:
    """E[K log K], by adding up the probabilities of every count that matters."""
    last = int(rate + 40 * math.sqrt(rate) + 40)
    terms = (
        math.exp(k * math.log(rate) - rate - math.lgamma(k + 1)) * k * math.log(k) for k in range(2, last)
    )
    return math.fsum(terms)


@pytest.mark.parametrize("rate", [1e-4, 0.01, 0.34, 1.0, 1.37, 7.7, 30.3, 63.99])
def test_information_of_a_flat_patch_is_the_sum_over_its_counts(rate):
    # The table is linear between rates r = s^2 with steps h = 8 / 4095 of s, where the curvature is at
    # most 1 / r from rates of 1 on: the error is at most (2 s h)^2 / (8 r) = h^2 / 2 = 1.9e-6.
    assert float(flat_information(np.array(rate))) == pytest.approx(information_twin(rate), abs=2e-6)


@pytest.mark.parametrize("rate", [LARGEST_RATE, 65.0, 100.0, 1e3])
def test_information_above_the_table_follows_its_expansion(rate):
    # The expansion goes on with 1 / (12 r^2) and smaller terms; at 1000 the twin's exponent, near 7000,
    # rounds at 1e-12, which 6908 nats turn into 1e-8.
    error = float(flat_information(np.array(rate))) - information_twin(rate)
    assert error == pytest.approx(-1 / (12 * rate**2), rel=0.1, abs=2e-8)


def test_no_light_has_no_information():
    assert flat_information(np.array(0.0)) == 0.0


def test_information_grows_without_a_step_where_the_table_ends():
    rates = np.linspace(60, 68, 81)
    slope = np.diff(flat_information(rates)) / 0.1
    # The slope is 1 + log r + ..., so 0.1 in rate changes it by 0.0016; the step of 2e-5 adds 2e-4.
    assert np.all(np.abs(np.diff(slope)) < 0.0025)


def flat_scene_scores(rate: float, seeds: int, photons_each: int) -> np.ndarray:
    """Mean score over the middle of the picture for each seed, of a scene without any texture."""
    grid = unit_grid(5, 5, 128, 128, pitch_mm=(3.0, 2.0))
    margin = 8  # cells of 4 px: a window of 4 x 5 px and shifts of 6 px stay inside the picture
    means = []
    for seed in range(seeds):
        dense = photons_each * np.random.default_rng(seed).poisson(rate, size=grid.shape_KLHW)
        counts = PhotonCounts.from_dense(dense, grid, cfa="GRBG")
        score = focus_scores(counts, np.array([1.0]), sigma_px=5.0)[0]
        means.append(score[margin:-margin, margin:-margin].mean())
    return np.array(means)


@pytest.mark.parametrize("rate", [0.02, 0.2, 2.0])
def test_a_flat_scene_scores_zero_on_average(rate):
    means = flat_scene_scores(rate, seeds=30, photons_each=1)
    error = means.std() / math.sqrt(means.size)
    # The window's mean is estimated from its own photons, which costs at most 1/4 nat a colour: half the
    # relative variance 1 / (4 pi s^2) of a mean over a window of 2 pi s^2 weight.
    assert abs(means.mean()) < 4 * error + 3 / 4
    # The planted fault: every photon counted twice is no longer Poisson.
    doubled = flat_scene_scores(rate, seeds=4, photons_each=2)
    assert abs(doubled.mean()) > 4 * error + 3 / 4


@pytest.mark.parametrize("true_disparity", [2, 3, 6])
@pytest.mark.parametrize("cfa", ["GRBG", "BGGR", None])
def test_a_textured_plane_scores_highest_at_its_depth(true_disparity, cfa):
    grid = unit_grid(5, 7, 96, 96)
    texture = 0.1 * blocky_texture(np.random.default_rng(0), 96, 96)
    rates = patch_views(texture, 0, 0, true_disparity, grid)
    if cfa is None:
        counts = PhotonCounts.from_dense(np.random.default_rng(1).poisson(rates[..., 1]), grid)
    else:
        counts = PhotonCounts.from_dense(bayer_photons(rates, cfa, 1), grid, cfa=cfa)
    scores = focus_scores(counts, 1 / DISPARITIES, sigma_px=8.0)
    middle = DISPARITIES[np.argmax(scores, axis=0)][10:14, 10:14]
    assert set(middle.ravel()) == {true_disparity}


def per_pixel_scores(counts: PhotonCounts) -> np.ndarray:
    """The planted fault: the same likelihood ratio on single pixels, over the middle of the picture."""
    scores = []
    for disparity in DISPARITIES:
        section = reconstruct(counts, 1 / disparity)
        K = section.counts[0, 48:-48, 48:-48].astype(float)
        V = section.coverage[0, 48:-48, 48:-48].astype(float)
        mean = V * K.sum(axis=(0, 1)) / V.sum(axis=(0, 1))
        ratio = xlogy(K, K) - xlogy(K, V) - flat_information(mean) + xlogy(mean, V)
        scores.append(ratio.sum())
    return np.array(scores)


def test_depths_whose_shifts_are_all_even_do_not_attract_texture():
    true_disparity = 3  # its neighbours 2 and 4 shift each of the 7 x 7 views by an even number of pixels
    grid = unit_grid(7, 7, 160, 160)
    # Smooth texture changes little under the blur of a neighbouring depth, so partners count for more.
    noise = gaussian_filter(np.random.default_rng(3).normal(size=(160, 160)), 8, mode="wrap")
    texture = np.exp(0.8 * noise / noise.std())[..., None] * np.ones(3)
    rates = 0.05 * patch_views(texture, 0, 0, true_disparity, grid)
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", 1), grid, cfa="GRBG")
    scores = focus_scores(counts, 1 / DISPARITIES, sigma_px=10.0)
    middle = DISPARITIES[np.argmax(scores, axis=0)][16:24, 16:24]
    assert set(middle.ravel()) == {true_disparity}
    assert DISPARITIES[np.argmax(per_pixel_scores(counts))] in (2, 4)


@pytest.mark.parametrize("cfa", ["GRBG", None])
@pytest.mark.parametrize("size", [(1, 1), (3, 5), (8, 9)])
def test_scores_of_no_photons_are_zero_on_cells_rounded_up(cfa, size):
    grid = unit_grid(2, 2, *size)
    counts = PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, dtype=int), grid, cfa=cfa)
    scores = focus_scores(counts, np.array([1.0, 2.0]), sigma_px=8.0)
    assert scores.shape == (2, math.ceil(size[0] / 4), math.ceil(size[1] / 4)) == (2, *cell_shape(counts))
    assert not scores.any()


def test_scores_of_the_largest_counts_are_finite():
    grid = unit_grid(3, 3, 16, 16)
    counts = PhotonCounts.from_dense(np.full(grid.shape_KLHW, 10**9), grid, cfa="GRBG")
    assert np.all(np.isfinite(focus_scores(counts, np.array([0.5, 1.0]), sigma_px=8.0)))


def test_a_cell_is_four_by_four_pixels_cut_at_the_frame():
    grid = unit_grid(1, 1, 5, 6)
    counts = PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, dtype=int), grid)
    pixels = cells_to_pixels(np.array([[1, 2], [3, 4]]), counts)
    np.testing.assert_array_equal(pixels[:4], [[1, 1, 1, 1, 2, 2]] * 4)
    np.testing.assert_array_equal(pixels[4:], [[3, 3, 3, 3, 4, 4]])


@pytest.mark.parametrize("rate", [0.02, 0.2, 2.0])
def test_chance_scores_of_a_flat_scene_spread_as_predicted(rate):
    grid = unit_grid(5, 5, 96, 96)
    drawn = [np.random.default_rng(seed).poisson(rate, grid.shape_KLHW) for seed in range(60)]
    scenes = [PhotonCounts.from_dense(counts, grid) for counts in drawn]
    scores = [focus_scores(counts, np.array([1.0]), sigma_px=10.0)[0][8:16, 8:16] for counts in scenes]
    predicted = flat_deviation(scenes[0], 1.0, sigma_px=10.0)[12, 12]
    # 60 scenes with some 2 independent windows each: a standard deviation is good to 1 / sqrt(240),
    # 6.5 %; three times that.
    assert np.std(scores) == pytest.approx(predicted, rel=0.2)


def test_no_bias_at_the_borders_of_a_flat_scene():
    # Views leave the frame there: windows are partly empty and blocks covered by fewer views.
    grid = unit_grid(5, 5, 96, 96)
    drawn = [np.random.default_rng(seed).poisson(2.0, grid.shape_KLHW) for seed in range(40)]
    scenes = [PhotonCounts.from_dense(counts, grid) for counts in drawn]
    scores = [focus_scores(counts, np.array([1 / 3]), sigma_px=10.0)[0] for counts in scenes]
    spread = flat_deviation(scenes[0], 1 / 3, sigma_px=10.0).max()
    # A mean of 40 is good to 1/6 of the spread; the coverage within a window is taken as its mean,
    # which leaves less than the spread itself. Unequal treatment of borders gave 500 times that.
    assert np.abs(np.mean(scores, axis=0)).max() < spread
