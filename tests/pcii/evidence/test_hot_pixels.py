import numpy as np
import pytest
from twins import even_light, unit_grid

from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.types.photon_counts import PhotonCounts

PLACES = [(0, 0), (5, 1), (5, 9), (9, 11)]


@pytest.mark.parametrize(("cfa", "step"), [("GRBG", 2), (None, 1)])
@pytest.mark.parametrize("views", [(2, 1), (3, 3)])
def test_a_hot_pixel_has_what_its_neighbour_of_the_same_colour_has(cfa, step, views):
    grid = unit_grid(*views, 10, 12)
    film = np.random.default_rng(0).poisson(1.0, grid.shape_KLHW)
    expected = film.copy()
    for i, j in PLACES:
        film[:, :, i, j] = 10**4
        expected[:, :, i, j] = expected[:, :, i, j - step if j >= step else j + step]
    found = without_hot_pixels(PhotonCounts.from_dense(film, grid, cfa=cfa))
    for k, l in np.ndindex(views):
        np.testing.assert_array_equal(found.view(k, l), expected[k, l])
    assert found.cfa == cfa


def test_what_is_hot_in_half_of_the_views_stays():
    grid = unit_grid(2, 2, 10, 12)
    film = np.random.default_rng(0).poisson(1.0, grid.shape_KLHW)
    film[0, :, 5, 5] = 10**4
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    assert without_hot_pixels(counts) is counts


@pytest.mark.parametrize("rate", [0.0, 0.01, 1.0, 1e4])
@pytest.mark.parametrize("size", [(1, 1), (1, 2), (60, 80)])
def test_noise_has_no_hot_pixels(rate, size):
    grid = unit_grid(2, 1, *size)
    counts = even_light(grid, rate, 0, "GRBG")
    if rate < 1e4 or size != (1, 1):
        assert without_hot_pixels(counts) is counts


def test_what_parallax_moves_is_not_hot():
    grid = unit_grid(3, 3, 30, 30)
    film = np.zeros(grid.shape_KLHW, dtype=int)
    for k, l in np.ndindex(3, 3):
        film[k, l, 15 - k, 15 - l] = 10**4
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    assert without_hot_pixels(counts) is counts
