from itertools import product

import numpy as np
import pytest
from property_settings import mostly_slow
from twins import bayer_photons, blocky_texture, even_light, patch_views, unit_grid

from pcii.evidence.half_agreement import Halves, Products, halves_of, least_agreement
from pcii.types.bayer import colour_cells
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

DISPARITIES_PX = (1, 2, 3, 4, 5, 6)
SIDES_CELLS = (1, 2, 4, 8)  # blocks of 4, 8, 16 and 32 px, cells being of 4 px


def at(halves: Halves, plane: int, shape: tuple[int, int]) -> np.ndarray:
    return halves.agree(np.full(shape, plane), np.ones(shape, dtype=bool))


def products(p: np.ndarray) -> Products:
    return Products(p, np.zeros(p.shape), np.ones(p.shape, bool))


def planes_of(grid: CameraGrid) -> FocalPlanes:
    return FocalPlanes.at_total_disparity(grid, (max(grid.rows, grid.cols) - 1.0) * np.array(DISPARITIES_PX))


def test_a_surface_is_agreed_on_where_it_is():
    grid, rng = unit_grid(5, 7, 128, 160), np.random.default_rng(0)
    rates = patch_views(0.05 * blocky_texture(rng, 64, 64), 32, 48, 3, grid)
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", seed=0), grid, cfa="GRBG")
    halves = halves_of(counts, planes_of(grid), out_of_focus=True)
    least = least_agreement(halves.planes)
    own = at(halves, DISPARITIES_PX.index(3), (32, 40))
    assert own[10:22, 14:26].mean() > 0.95
    assert halves.agreement_of_film() > least


def test_what_one_camera_alone_shows_is_not_agreed_on():
    # A texture in full light in one view and noise in the others.
    grid, rng = unit_grid(3, 3, 96, 96), np.random.default_rng(1)
    film = rng.poisson(0.5, grid.shape_KLHW)
    film[1, 2] = rng.poisson(50 * blocky_texture(rng, 96, 96)[..., 0])
    halves = halves_of(PhotonCounts.from_dense(film, grid, cfa=None), planes_of(grid), out_of_focus=True)
    least = least_agreement(len(DISPARITIES_PX))
    assert not any(at(halves, plane, (24, 24)).any() for plane in range(6))
    assert halves.agreement_of_film() < least


@pytest.mark.parametrize(
    ("rate", "views"),
    mostly_slow(
        product((0.003, 0.1, 1.0, 1e4), ((2, 1), (3, 4))),
        quick=[(0.003, (3, 4)), (1.0, (2, 1))],
    ),
)
def test_noise_agrees_as_seldom_as_is_said(rate, views):
    grid = unit_grid(*views, 64, 80)
    above = []
    for seed in range(10):
        halves = halves_of(even_light(grid, rate, seed), planes_of(grid), out_of_focus=True)
        above.append(np.any([at(halves, plane, (16, 20)) for plane in range(6)], axis=0).mean())
    assert np.mean(above) <= 1 / 1000  # of places, as is said


def test_halves_that_are_the_same_agree_on_noise():
    # The planted fault: of each camera of one half there is a copy in the other.
    grid = unit_grid(2, 1, 64, 80)
    film = np.repeat(np.random.default_rng(0).poisson(1.0, (1, 1, 64, 80)), 2, axis=0)
    film[1, 0, :-1] = film[1, 0, 1:]  # at the disparity 1
    halves = halves_of(PhotonCounts.from_dense(film, grid, cfa=None), planes_of(grid), out_of_focus=True)
    assert at(halves, 0, (16, 20)).mean() > 0.9


@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_products_are_those_of_the_formula(cfa):
    grid, rng = unit_grid(3, 2, 23, 38), np.random.default_rng(2)
    film = rng.poisson(2.0, grid.shape_KLHW)
    halves = halves_of(
        PhotonCounts.from_dense(film, grid, cfa=cfa), FocalPlanes.at_total_disparity(grid, 4.0)
    )
    h, w = 6, 10
    for side, products in zip(SIDES_CELLS, halves.inside, strict=True):
        expected = np.ones((-(-h // side), -(-w // side)))
        for half in (0, 1):
            photons, samples = np.zeros((2, *expected.shape))
            for k, l, i, j in np.ndindex(*grid.shape_KLHW):
                # Disparity 2: shifts of whole blocks of 2 px down, of half a block across.
                row, col = i + 2 * (k - 1), j + (2 * l - 1)
                rows, cols = row - row % 2 + np.arange(2), col - col % 2 + np.arange(2)
                whole = all(0 <= at < 23 and 0 <= at - 2 * (k - 1) < 23 for at in rows)
                whole &= all(0 <= at < 38 and 0 <= at - (2 * l - 1) < 38 for at in cols)
                if whole and (k + l) % 2 == half:
                    block = row // 4 // side, col // 4 // side
                    photons[block] += film[k, l, i, j]
                    samples[block] += 1
            smooth = np.zeros_like(photons)
            for a, b in np.ndindex(*photons.shape):
                near = np.s_[max(a - 1, 0) : a + 2, max(b - 1, 0) : b + 2]
                around, views = photons[near].sum() - photons[a, b], samples[near].sum() - samples[a, b]
                smooth[a, b] = samples[a, b] * around / views if views * samples[a, b] > 0 else 0.0
                photons[a, b] = photons[a, b] if views * samples[a, b] > 0 else 0.0
            scale = smooth + smooth.mean() + (smooth.mean() == 0)
            expected *= (photons - smooth) / scale
        np.testing.assert_allclose(products.p[0], expected, rtol=1e-5, atol=1e-7)


def test_agreement_of_the_film_is_that_of_the_formula():
    p = np.random.default_rng(3).normal(size=(2, 8, 8))
    p[:, 4] = 0  # where there is nothing to compare with
    nothing = [products(np.zeros((2, 8 // side, 8 // side))) for side in SIDES_CELLS]
    compared = np.ones(p.shape, bool)
    compared[:, 4] = False
    own = [Products(p, 0 * p, compared), *nothing[1:]]
    halves = Halves(own, nothing)
    t = max(one.sum() / np.sqrt((one**2).sum()) for one in p)
    assert halves.agreement_of_film() == pytest.approx(max(t, 0.0))


@pytest.mark.parametrize("count", [1, 3, 2**40])
@pytest.mark.parametrize("size", [(1, 1), (4, 9), (64, 64)])
def test_even_light_is_no_light_to_agree_on(count, size):
    grid = unit_grid(2, 3, *size)
    counts = PhotonCounts.from_dense(np.full(grid.shape_KLHW, count), grid, cfa="GRBG")
    shape = -(-size[0] // 4), -(-size[1] // 4)
    assert not at(
        halves_of(counts, FocalPlanes.at_total_disparity(counts.grid, [2.0, 4.0]), out_of_focus=True),
        1,
        shape,
    ).any()


def test_bayer_colours_do_not_pass_for_light():
    grid = unit_grid(3, 3, 64, 64)
    colours = np.tile(colour_cells("GRBG"), (32, 32))
    rates = np.array([0.2, 5.0, 40.0])[colours] * np.ones(grid.shape_KLHW)
    film = np.random.default_rng(4).poisson(rates)
    halves = halves_of(PhotonCounts.from_dense(film, grid, cfa="GRBG"), planes_of(grid), out_of_focus=True)
    assert not any(at(halves, plane, (16, 16)).any() for plane in range(6))
