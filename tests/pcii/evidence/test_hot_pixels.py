import numpy as np
import pytest
from twins import even_light, unit_grid

from pcii.evidence import without_hot_pixels
from pcii.types import FocalPlanes, PhotonCounts

PLACES = [(0, 0), (5, 1), (5, 9), (9, 11)]
DISPARITIES_PX = [4.0, 5.0, 6.0]  # from camera to camera


def cleaned(counts: PhotonCounts) -> tuple[PhotonCounts, int]:
    steps = max(counts.grid.rows, counts.grid.cols) - 1
    planes = FocalPlanes.at_total_disparity(counts.grid, steps * np.array(DISPARITIES_PX))
    return without_hot_pixels(counts, planes)


@pytest.mark.parametrize(("cfa", "step"), [("GRBG", 2), (None, 1)])
@pytest.mark.parametrize("views", [(2, 1), (3, 3)])
def test_a_hot_pixel_has_what_its_neighbour_of_the_same_colour_has(cfa, step, views):
    grid = unit_grid(*views, 10, 12)
    film = np.random.default_rng(0).poisson(1.0, grid.shape_KLHW)
    expected = film.copy()
    for i, j in PLACES:
        film[:, :, i, j] = 10**4
        expected[:, :, i, j] = expected[:, :, i, j - step if j >= step else j + step]
    with pytest.warns(UserWarning, match="4 of 120 pixels are at least twice as bright"):
        found, replaced = cleaned(PhotonCounts.from_dense(film, grid, cfa=cfa))
    assert replaced == 4
    for k, l in np.ndindex(views):
        np.testing.assert_array_equal(found.view(k, l), expected[k, l])
    assert found.cfa == cfa


def test_what_is_hot_in_half_of_the_views_stays():
    grid = unit_grid(2, 2, 10, 12)
    film = np.random.default_rng(0).poisson(1.0, grid.shape_KLHW)
    film[0, :, 5, 5] = 10**4
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    assert cleaned(counts)[0] is counts


@pytest.mark.parametrize("rate", [0.0, 0.01, 1.0, 1e4])
@pytest.mark.parametrize("size", [(1, 1), (1, 2), (60, 80)])
def test_noise_has_no_hot_pixels(rate, size):
    grid = unit_grid(2, 1, *size)
    counts = even_light(grid, rate, 0, "GRBG")
    if rate < 1e4 or size != (1, 1):
        assert cleaned(counts)[0] is counts


@pytest.mark.parametrize(("shear_px", "is_kept"), [(0.0, False), (2.5, False), (3.5, True), (5.2, True)])
def test_what_stands_still_is_hot_unless_the_films_rest_among_the_planes(shear_px, is_kept):
    # With three cameras in a row a point less than 1 px from rest stays in its pixel in most of the views.
    grid = unit_grid(1, 3, 30, 30, shear_px=(shear_px, 0.0))
    film = np.ones(grid.shape_KLHW, dtype=int)
    film[:, :, 15, 15] = 10**4
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    assert (cleaned(counts)[0] is counts) == is_kept
