"""The share of photons that saturation removed, told from the counts alone; and the warning beyond 2 %."""

import numpy as np
import pytest
from scipy import stats
from twins import unit_grid

import pcii
from pcii.sections.photon_statistics import saturation_loss
from pcii.types.photon_counts import PhotonCounts

GRID = unit_grid(2, 2, 64, 50)


def uneven_rate() -> np.ndarray:
    """Light (H, W) that changes over some tens of pixels, its mean 1."""
    i, j = np.indices(GRID.shape_HW)
    light = 1.2 + np.sin(i / 9) * np.cos(j / 7)
    return light / light.mean()


def read(rate: float, frames: int, bits: int) -> tuple[PhotonCounts, float]:
    """Counts, and the share of the photons that is expected to be lost."""
    rates, most = rate * uneven_rate() / frames, 2**bits - 1
    photons = np.random.default_rng(1).poisson(rates, (frames, *GRID.shape_KLHW))
    counts = np.minimum(photons, most).sum(axis=0)
    held = sum(stats.poisson.sf(n, rates) for n in range(most))
    return (
        PhotonCounts.from_dense(counts, GRID, cfa="GRBG", frames=frames, bits=bits),
        float(1 - np.sum(held) / rates.sum()),
    )


@pytest.mark.parametrize(
    ("rate", "frames", "bits"),
    [(0.01, 1, 1), (1.0, 1, 1), (3.0, 20, 1), (2.0, 1, 2), (20.0, 4, 3)],
)
def test_the_loss_is_found_from_the_counts(rate: float, frames: int, bits: int) -> None:
    counts, lost = read(rate, frames, bits)
    # Pairs of photons in one block are what it is found from: some 20 in the darkest case.
    assert saturation_loss(counts) == pytest.approx(lost, rel=0.1, abs=2e-3)


def test_a_lone_photon_says_nothing_of_saturation() -> None:
    lone = PhotonCounts.from_events(*np.array([[0], [0], [5], [5], [1]]), GRID, frames=1, bits=1)
    assert saturation_loss(lone) == pytest.approx(0, abs=1e-12)
    dark = PhotonCounts.from_dense(np.zeros(GRID.shape_KLHW, int), GRID, bits=1)
    assert saturation_loss(dark) == 0
    without_limit = PhotonCounts.from_dense(np.full(GRID.shape_KLHW, 9), GRID, frames=3)
    assert saturation_loss(without_limit) == 0
    full = PhotonCounts.from_dense(np.full(GRID.shape_KLHW, 9), GRID, frames=3, bits=2)
    assert 0.5 < saturation_loss(full) < 1


def test_depth_and_removal_warn_beyond_two_per_cent(recwarn: pytest.WarningsRecorder) -> None:
    few, _ = read(0.02, 1, 1)
    pcii.segment(few, z_mm=[1.0], method="brightness")
    pcii.estimate_depth(few, (0.5, 2.0), method="variance-sweep")
    assert not recwarn.list
    many, _ = read(0.3, 1, 1)
    with pytest.warns(UserWarning, match=r"saturation removed about 1\d% of the photons"):
        pcii.segment(many, z_mm=[1.0], method="brightness")
    with pytest.warns(UserWarning, match="take more frames or less light"):
        pcii.estimate_depth(many, (0.5, 2.0), method="variance-sweep")
