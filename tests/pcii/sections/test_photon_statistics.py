import math

import numpy as np
import pytest
from scipy import stats
from twins import unit_grid

import pcii
from pcii.sections import (
    ViewSamples,
    entropy_bits,
    pooled_estimate,
    reconstruct,
    region_entropy_bits,
    truncated_poisson_variance,
    view_samples,
)
from pcii.sections.photon_statistics import saturation_loss
from pcii.types import CameraGrid, FocalPlanes, PhotonCounts

PAPER_RATE = 1000 * 3.4e-4


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


GRID = unit_grid(2, 2, 64, 50)


def saturated(rate: float, frames: int, bits: int) -> tuple[PhotonCounts, float]:
    """Counts of light that changes over some tens of pixels, and the expected share of lost photons."""
    i, j = np.indices(GRID.shape_HW)
    light, most = 1.2 + np.sin(i / 9) * np.cos(j / 7), 2**bits - 1
    rates = rate * light / light.mean() / frames
    photons = np.random.default_rng(1).poisson(rates, (frames, *GRID.shape_KLHW))
    counts = np.minimum(photons, most).sum(axis=0)
    held = sum(stats.poisson.sf(n, rates) for n in range(most))
    lost = float(1 - np.sum(held) / rates.sum())
    return PhotonCounts.from_dense(counts, GRID, cfa="GRBG", frames=frames, bits=bits), lost


@pytest.mark.parametrize(
    ("rate", "frames", "bits"), [(0.01, 1, 1), (1.0, 1, 1), (3.0, 20, 1), (2.0, 1, 2), (20.0, 4, 3)]
)
def test_the_loss_is_found_from_the_counts(rate: float, frames: int, bits: int) -> None:
    counts, lost = saturated(rate, frames, bits)
    # Pairs of photons in one block are what it is found from: some 20 in the darkest case.
    assert saturation_loss(counts) == pytest.approx(lost, rel=0.1, abs=2e-3)


def test_depth_and_removal_warn_beyond_two_per_cent(recwarn: pytest.WarningsRecorder) -> None:
    few, _ = saturated(0.02, 1, 1)
    pcii.segment(few, z_mm=[1.0], method="brightness")
    pcii.estimate_depth(few, (0.5, 2.0), method="variance-sweep")
    assert not recwarn.list
    many, _ = saturated(0.3, 1, 1)
    with pytest.warns(UserWarning, match=r"saturation removed about 1\d% of the photons"):
        pcii.segment(many, z_mm=[1.0], method="brightness")
    with pytest.warns(UserWarning, match="take more frames or less light"):
        pcii.estimate_depth(many, (0.5, 2.0), method="variance-sweep")
