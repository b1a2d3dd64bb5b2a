import math

import numpy as np
import pytest
from twins import unit_grid

from pcii.sections.photon_statistics import (
    ViewSamples,
    entropy_bits,
    pooled_estimate,
    region_entropy_bits,
    truncated_poisson_variance,
    view_samples,
)
from pcii.sections.reconstruction import reconstruct
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

PAPER_RATE = 1000 * 3.4e-4

# Entropy, Eq. 9


@pytest.mark.parametrize(("values", "top"), [([], 1.0), ([0.0] * 5, 0.0), ([1.0] * 7, 1.0)])
def test_one_grey_level_or_none_has_no_entropy(values, top):
    entropy = entropy_bits(np.array(values), top)
    assert entropy == 0.0
    assert not np.signbit(entropy)


def test_entropy_by_hand():
    for bits in (1, 4, 8):  # shares are powers of two, and their logarithms whole numbers
        levels = (np.arange(2**bits) + 0.5) / 2**bits
        assert entropy_bits(np.repeat(levels, 3), top=1.0) == bits
    same, apart = np.array([0.5, 1.4]), np.array([0.5, 1.5])
    assert entropy_bits(same / 256 * 8, top=8.0) == 1.0  # levels 0 and 1
    assert entropy_bits(apart / 512 * 8, top=8.0) == 0.0  # both level 0
    assert entropy_bits(np.array([8.0, 255.5 / 256 * 8]), top=8.0) == 0.0  # the top is level 255


def test_region_entropy_is_the_mean_of_its_colours_inside_the_region():
    pooled = np.zeros((1, 4, 2))
    pooled[0, :, 0] = [0.1, 0.9, 0.5, 0.7]
    region = np.array([[True, True, False, False]])
    assert region_entropy_bits(pooled, region, np.array([1.0, 1.0])) == (1.0 + 0.0) / 2


# Pooling


@pytest.mark.parametrize("window", [1, 5])
@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_a_pooled_voxel_is_photons_over_samples_of_its_window(window, cfa):
    grid = unit_grid(3, 2, 8, 9, pitch_mm=(2.0, 1.0))
    dense = np.random.default_rng(3).poisson(0.3, size=grid.shape_KLHW)
    sections = reconstruct(PhotonCounts.from_dense(dense, grid, cfa=cfa), [1.0, 2.0])
    pooled = pooled_estimate(sections, window)
    half = window // 2
    for z, i, j, c in np.ndindex(*sections.counts.shape):
        here = (z, slice(max(i - half, 0), i + half + 1), slice(max(j - half, 0), j + half + 1), c)
        samples = sections.coverage[here].sum()
        expected = sections.counts[here].sum() / samples if samples else 0.0
        # Running sums of a few dozen terms below 100: 1e-13 relative, and 1e-10 leaves room.
        assert pooled[z, i, j, c] == pytest.approx(expected, rel=1e-10, abs=0)


def test_pooling_leaves_the_dark_exactly_dark():
    grid = unit_grid(2, 2, 20, 20)
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    # Running sums carry a residue of bright and unequal numbers into the dark beside them.
    dense[..., :6, :6] = np.random.default_rng(0).integers(1, 10**9, size=(2, 2, 6, 6))
    pooled = pooled_estimate(reconstruct(PhotonCounts.from_dense(dense, grid), 1.0), 3)
    assert not pooled[0, 8:, :].any()
    assert not pooled[0, :, 8:].any()
    assert pooled[0, :5, :5].all()


# Samples of the views, Eq. 7


def samples_at(counts: PhotonCounts, z_mm: float, *, cell_px: int, window_cells: int) -> ViewSamples:
    planes = FocalPlanes.at_depths(counts.grid, z_mm)
    return view_samples(counts, planes, 0, cell_px=cell_px, window_cells=window_cells)


def test_views_that_agree_at_the_planted_shift_have_no_variance_there():
    grid = unit_grid(1, 3, 8, 16, pitch_mm=(2.0, 1.0))
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    for l in range(3):
        dense[0, l, 4, 8 - 2 * (l - 1)] = 5  # further right sees it further left
    counts = PhotonCounts.from_dense(dense, grid)
    focused = samples_at(counts, 1.0, cell_px=1, window_cells=1)
    assert (focused.number[4, 8], focused.mean[4, 8], focused.variance[4, 8]) == (3, 5.0, 0.0)
    assert focused.number.sum() == 3
    assert samples_at(counts, 2.0, cell_px=1, window_cells=1).number.max() == 1


# What Poisson noise alone would give


def non_zero_moments(rate: float) -> tuple[float, float, float]:
    """P(C >= 1), mean and variance of the non-zero samples, by adding up the probabilities."""
    last = int(rate + 40 * math.sqrt(rate) + 40)
    p = [math.exp(c * math.log(rate) - rate - math.lgamma(c + 1)) for c in range(1, last)]
    non_zero = math.fsum(p)
    mean = math.fsum(c * q for c, q in enumerate(p, start=1)) / non_zero
    variance = math.fsum((c - mean) ** 2 * q for c, q in enumerate(p, start=1)) / non_zero
    return non_zero, mean, variance


@pytest.mark.parametrize("rate", [1e-4, 0.34, 1.59, 7.0, 300.0])
def test_the_truncated_variance_is_that_of_the_probabilities(rate):
    _, mean, variance = non_zero_moments(rate)
    # m (1 + r - m) loses 1 / r of the 16 digits at small rates, and the mean itself is one rounding off.
    tolerance = 1e-14 / min(rate, 1.0) ** 2 + 1e-12
    assert truncated_poisson_variance(np.array(mean)) == pytest.approx(variance, rel=tolerance)
    np.testing.assert_array_equal(truncated_poisson_variance(np.array([0.0, 0.5, 1.0])), 0.0)  # no light


def variance_excess(dense: np.ndarray, grid: CameraGrid) -> tuple[float, float]:
    """Mean and standard error of variance over its Poisson expectation at rate 0.34, over the cells."""
    samples = samples_at(PhotonCounts.from_dense(dense, grid), 1e9, cell_px=4, window_cells=1)
    _, _, expected = non_zero_moments(PAPER_RATE)
    ratio = samples.variance[samples.number > 1] / expected
    return float(ratio.mean()), float(ratio.std() / math.sqrt(ratio.size))


def test_samples_of_a_flat_scene_have_the_variance_of_poisson_noise():
    grid = unit_grid(8, 8, 80, 80)
    rng = np.random.default_rng(5)
    flat = rng.poisson(PAPER_RATE / 16, size=grid.shape_KLHW)  # 4 x 4 pixels a cell
    mean, error = variance_excess(flat, grid)
    assert abs(mean - 1) < 4 * error  # the variance is unbiased for any number of samples; 400 cells
    # The planted fault: views of different surfaces, half of them twice as bright.
    brighter = np.where(np.arange(8) % 2, 1.6, 0.4)[:, None, None, None]
    uneven = rng.poisson(PAPER_RATE / 16 * brighter, size=grid.shape_KLHW)
    mean, error = variance_excess(uneven, grid)
    assert mean - 1 > 4 * error
