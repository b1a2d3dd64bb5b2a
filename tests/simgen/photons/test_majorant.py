"""The majorant's book-keeping: every path has one owner, and no place is ever written off as black."""

from dataclasses import replace

import numpy as np
import pytest

from pcii.types import CameraGrid
from simgen.base import take_rows
from simgen.photons import MAX_RAYS, Majorant, Samples, fit, layers_for, tile_px_for

GRID = CameraGrid(rows=3, cols=4, pitch_mm=(8.0, 5.0), focal_mm=50.0, pixel_mm=0.5, height=96, width=128)
DIM = np.array([0.02, 0.01, 0.03])


def pilot(seed: int, number: int = 4000) -> Samples:
    """Paths that hit three depths: a red surface, a blue one, and a black wall far away."""
    rng = np.random.default_rng(seed)
    which = rng.integers(0, 3, number)
    colour = np.array([[5.0, 0.0, 0.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]])[which]
    light = colour * rng.uniform(0.5, 1.2, (number, 1))
    light[number // 2 :] = np.nan
    places = (rng.integers(0, size, number) for size in GRID.shape_KLHW)
    return Samples(*places, np.array([300.0, 420.0, np.inf])[which], np.maximum(colour, 1e-9), light)


@pytest.fixture
def majorant() -> Majorant:
    samples = pilot(1)
    return fit(GRID, layers_for(GRID, tile_px_for(GRID, MAX_RAYS), samples.z_mm), samples, DIM)


def test_each_path_belongs_to_one_entry_whose_tile_holds_its_pixel(majorant: Majorant) -> None:
    samples, layers = pilot(2), majorant.layers
    entry = majorant.owner_of(samples)
    side, layer = majorant.side_px[entry], majorant.layer[entry]
    down = np.where(layer < 0, 0, layers.row_shift[layer, samples.k])
    right = np.where(layer < 0, 0, layers.col_shift[layer, samples.l])
    np.testing.assert_array_equal((samples.row + down) // side, majorant.row[entry])
    np.testing.assert_array_equal((samples.col + right) // side, majorant.col[entry])
    assert (layer[np.isfinite(samples.z_mm)] >= 0).mean() > 0.9


def test_bounds_hold_what_was_found_and_are_never_black(majorant: Majorant) -> None:
    samples = pilot(1)
    known = take_rows(samples, samples.followed)
    bound = majorant.bound[majorant.owner_of(known)]
    assert (known.light <= bound * (1 + 1e-6)).all()  # bounds are found in single precision
    assert (majorant.bound >= DIM).all()
    majorant.scale(1e-6)
    assert (majorant.bound >= DIM).all()


@pytest.mark.parametrize("shear_px", [(0.0, 0.0), (9.5, -6.0)])
def test_tiles_of_a_layer_stay_on_the_same_piece_of_surface(shear_px: tuple[float, float]) -> None:
    # A point at 300 mm, seen by all cameras where the contract says.
    sheared = replace(GRID, shear_px=shear_px)
    layers = layers_for(sheared, tile_px_for(GRID, MAX_RAYS), np.array([300.0, 420.0, np.inf]))
    assert layers.row_shift.min() == layers.col_shift.min() == 0
    k, l = (index.ravel() for index in np.indices((3, 4)))
    row = 47.5 + shear_px[1] * (k - 1) + 100 * (10.0 - (k - 1) * 5.0) / 300
    col = 63.5 + shear_px[0] * (l - 1.5) + 100 * (-20.0 - (l - 1.5) * 8.0) / 300
    layer = layers.layer_of(np.array([300.0]))[0]
    at_row = (row + layers.row_shift[layer, k]) / layers.tile_px
    at_col = (col + layers.col_shift[layer, l]) / layers.tile_px
    # Half a tile of blur by the layer's thickness, and shifts are even: half of 2 px more.
    assert np.ptp(at_row) <= 1 + 2 / layers.tile_px
    assert np.ptp(at_col) <= 1 + 2 / layers.tile_px


def test_a_gap_in_a_surface_is_listed_with_the_bound_of_what_is_around_it() -> None:
    # One camera, one depth; rays everywhere but in a square of 3 x 3 tiles.
    grid = replace(GRID, rows=1, cols=1)
    tile_px = tile_px_for(grid, MAX_RAYS)
    row, col = (part.ravel() for part in np.mgrid[0:96, 0:128])
    gap = (row // tile_px >= 20) & (row // tile_px < 23) & (col // tile_px >= 30) & (col // tile_px < 33)
    row, col = row[~gap], col[~gap]
    zero, light = np.zeros_like(row), np.ones((row.size, 3))
    samples = Samples(zero, zero, row, col, np.full(row.size, 300.0), light, light)
    majorant = fit(grid, layers_for(grid, tile_px, samples.z_mm), samples, DIM)
    middle = np.array([21 * tile_px]), np.array([31 * tile_px])
    inside = Samples(zero[:1], zero[:1], *middle, np.array([300.0]), light[:1], light[:1])
    (entry,) = majorant.owner_of(inside)
    assert majorant.layer[entry] >= 0
    np.testing.assert_allclose(majorant.bound[entry], 1.0, rtol=1e-6)
