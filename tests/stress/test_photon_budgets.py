"""From no photon to 10^12 per view, and to the last photon that 64 bits hold: sums are exact, or refused."""

import numpy as np
import pytest
from twins import samples_of, unit_grid, variance_of

import pcii
from pcii.sections import view_samples
from pcii.types import LARGEST_COUNT, FocalPlanes

BUDGETS = [0, 1, 10**3, 10**6, 10**12]


def film_of(budget: int, shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    """Exactly so many photons in each view, wherever they fall."""
    K, L, H, W = shape
    rng = np.random.default_rng(seed)
    return rng.multinomial(budget, np.full(H * W, 1 / (H * W)), (K, L)).reshape(shape)


def as_events(film: np.ndarray, grid: pcii.CameraGrid, cfa: str | None = None) -> pcii.PhotonCounts:
    k, l, i, j = np.nonzero(film)
    return pcii.PhotonCounts.from_events(k, l, i, j, film[k, l, i, j], grid, cfa=cfa)


@pytest.mark.parametrize("budget", BUDGETS)
@pytest.mark.parametrize("cfa", [None, "GRBG"])
def test_sums_of_any_budget_are_those_of_python_integers(budget: int, cfa: str | None) -> None:
    grid = unit_grid(2, 3, 5, 4, (1.3, 0.7))
    film = film_of(budget, grid.shape_KLHW)
    expected = samples_of(film[..., None], grid, 1.1, cfa=cfa)
    for counts in (pcii.PhotonCounts.from_dense(film, grid, cfa=cfa), as_events(film, grid, cfa)):
        assert counts.total == budget * grid.view_count
        sections = pcii.reconstruct(counts, 1.1)
        assert sections.counts.sum(dtype=object) == sum(sum(each) for each in expected.values())
        for where, samples in expected.items():
            assert int(sections.counts[0][where]) == sum(samples)
            assert sections.coverage[0][where] == len(samples)
            assert sections.estimate[0][where] == sum(samples) / len(samples)
        assert np.isfinite(sections.estimate).all()


@pytest.mark.parametrize("count", [10**10, LARGEST_COUNT])
def test_variances_that_64_bits_cannot_make_exactly_are_refused(count: int) -> None:
    grid = unit_grid(2, 2, 2, 2)
    counts = pcii.PhotonCounts.from_dense(np.full(grid.shape_KLHW, count), grid)
    with pytest.raises(pcii.InputError, match=r"^variance: the counts are too large"):
        pcii.reconstruct(counts, 10.0, variance=True)


def test_more_than_2_to_the_53_photons_of_a_voxel_are_counted_to_the_last() -> None:
    """10 000 views of 2^40 - 1 photons each: double precision would miss 1808 of them."""
    grid = unit_grid(100, 100, 1, 1)
    counts = pcii.PhotonCounts.from_dense(np.full(grid.shape_KLHW, LARGEST_COUNT - 1), grid)
    assert int(pcii.reconstruct(counts, 1e6).counts[0, 0, 0, 0]) == 10_000 * (LARGEST_COUNT - 1)


def test_a_pixel_holds_2_to_the_40_photons_however_they_come() -> None:
    grid, zero = unit_grid(1, 1, 1, 1), np.zeros(2, int)
    most = pcii.PhotonCounts.from_events(zero, zero, zero, zero, np.array([LARGEST_COUNT - 1, 1]), grid)
    assert most.total == LARGEST_COUNT
    with pytest.raises(pcii.InputError, match=r"^n: more than 2\^40 photons in a pixel"):
        pcii.PhotonCounts.from_events(zero, zero, zero, zero, np.array([LARGEST_COUNT, 1]), grid)
    with pytest.raises(pcii.InputError, match=r"^counts: more than 2\^40 photons in a pixel"):
        pcii.PhotonCounts.from_dense(np.full((1, 1, 1, 1), LARGEST_COUNT + 1), grid)


@pytest.mark.parametrize("level", [10**3, 10**6, 10**9, 10**11])
@pytest.mark.parametrize("differing", [False, True])
def test_the_variance_over_views_is_right_in_bright_windows(level: int, differing: bool) -> None:
    """Squares of differences of 10^12 photons are 10^24: added up in 64 bits they would be noise."""
    grid = unit_grid(3, 3, 4, 4)
    film = np.random.default_rng(2).poisson(level, grid.shape_KLHW)
    if differing:  # as where surfaces are out of focus
        film *= np.arange(1, 10).reshape(3, 3, 1, 1)
    counts = pcii.PhotonCounts.from_dense(film, grid)
    found = view_samples(counts, FocalPlanes.at_depths(grid, 1e6), 0, cell_px=4, window_cells=1)
    samples = [int(total) for total in film.sum(axis=(2, 3)).ravel()]
    assert found.number.item() == 9
    np.testing.assert_allclose(found.mean.item(), np.mean(samples), rtol=4e-16)
    np.testing.assert_allclose(found.variance.item(), variance_of(samples), rtol=1e-14)
