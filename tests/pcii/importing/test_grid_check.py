"""Whether a wrong order or pitch of views is found, and a right one never warned about."""

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pytest
from property_settings import mostly_slow
from rendered_cards import Card, render

from pcii.core.camera_grid import CameraGrid
from pcii.importing.camera_order import ViewOrder
from pcii.importing.grid_check import ORDERS, GridCheck, check_grid

GRID = CameraGrid(rows=3, cols=3, pitch_mm=(4, 4), focal_mm=35, pixel_mm=36 / 120, height=90, width=120)
CARDS = [Card(180, seed=1), Card(80, (0.2, 0.8, 0.1, 0.5), 2), Card(50, (0.3, 0.8, 0.6, 0.95), 3)]
RANGES = [(30.0, 250.0), None]


def light(views: np.ndarray) -> Callable[[int, int], np.ndarray]:
    return lambda k, l: views[k, l].mean(axis=2)


def stored_so_that(views: np.ndarray, mended_by: ViewOrder, *, counted: bool = False) -> np.ndarray:
    """Views as somebody stored them who has to be told `mended_by`, read as if in the usual order."""
    K, L = views.shape[:2]
    stored = np.empty_like(views.reshape(K * L, *views.shape[2:]))
    stored[mended_by.numbers(K, L).ravel()] = views.reshape(stored.shape)
    rows, cols = (L, K) if mended_by.swap_axes and not counted else (K, L)
    return stored.reshape(rows, cols, *views.shape[2:])


@pytest.fixture(scope="module")
def views() -> np.ndarray:
    return render(GRID, CARDS, cell=8)


@pytest.mark.parametrize("z_range", RANGES)
def test_right_views_are_not_warned_about_and_their_depths_are_found(views, z_range) -> None:
    found = check_grid(light(views), GRID, z_range)
    assert found == GridCheck(found.z_mm)
    # To half a pixel of total disparity, 933 px mm / z: nearest shifts tell no more.
    total = 35 * 4 * 2 / 0.3
    assert [total / z for z in found.z_mm] == pytest.approx([total / z for z in (50, 80, 180)], abs=0.5)


@pytest.mark.parametrize("z_range", [(300.0, 1200.0), None])
def test_surfaces_at_neighbouring_planes_of_the_reduced_views_are_told_apart(z_range) -> None:
    grid = CameraGrid(rows=5, cols=5, pitch_mm=(4, 4), focal_mm=35, pixel_mm=0.048, height=200, width=300)
    cards = [Card(900, seed=1), Card(600, (0.1, 0.8, 0.1, 0.45), 2), Card(400, (0.2, 0.7, 0.55, 0.85), 3)]
    found = check_grid(light(render(grid, cards, cell=8)), grid, z_range)
    # Total disparities of 13.0, 19.4 and 29.2 px: 1.6 and 2.4 of the reduced views' 4 px apart.
    total = 35 * 4 * 4 / 0.048
    assert [total / z for z in found.z_mm] == pytest.approx([total / z for z in (400, 600, 900)], abs=0.5)


@pytest.mark.parametrize(("mended_by", "z_range"), [*zip(ORDERS[1:], cycle(RANGES), strict=False)], ids=str)
def test_every_wrong_order_is_found(views, mended_by, z_range) -> None:
    found = check_grid(light(stored_so_that(views, mended_by)), GRID, z_range)
    assert found.order == mended_by
    assert found.z_mm == ()


@pytest.mark.parametrize("told", [ORDERS[1], ORDERS[4], ORDERS[6]], ids=str)
def test_what_mends_is_said_of_the_stored_views_whatever_was_told(views, told) -> None:
    right = stored_so_that(views, ViewOrder())
    wrong = told.arranged(right)
    assert check_grid(light(wrong), GRID, (30, 250), order=told).order == ViewOrder()


@pytest.mark.parametrize("counted", [True, False])
def test_rows_and_columns_exchanged_in_a_grid_that_is_not_square(counted) -> None:
    grid = replace(GRID, rows=2, cols=4)
    swapped = ViewOrder(swap_axes=True)
    stored = stored_so_that(render(grid, CARDS, cell=8), swapped, counted=counted)
    told = replace(grid, rows=stored.shape[0], cols=stored.shape[1])
    assert check_grid(light(stored), told, (30, 250), counted=counted).order == swapped
    right = render(grid, CARDS, cell=8)
    assert check_grid(light(right), grid, (30, 250), counted=counted).order is None


@pytest.mark.parametrize(
    ("rows_cols", "noise"),
    mostly_slow(
        product([(1, 5), (5, 1), (2, 2), (4, 3)], [0.0, 0.1]),
        quick=[((1, 5), 0.1), ((5, 1), 0.1), ((2, 2), 0.0), ((4, 3), 0.1)],
    ),
)
def test_grids_of_any_shape_also_with_noise(rows_cols, noise) -> None:
    grid = replace(GRID, rows=rows_cols[0], cols=rows_cols[1])
    rng = np.random.default_rng(4)
    clean = render(grid, CARDS, cell=8)
    views = np.maximum(clean + noise * rng.normal(size=clean.shape), 0)
    found = check_grid(light(views), grid, (30, 250))
    assert found == GridCheck(found.z_mm)
    turned = check_grid(light(views[::-1, ::-1]), grid, (30, 250)).order
    assert turned is not None
    assert turned.flip_cols or grid.cols == 1
    assert turned.flip_rows or grid.rows == 1


def test_a_sheared_grid_is_judged_like_any_other() -> None:
    shear = 35 * 4 / (0.3 * 90)  # stands still at 90 mm: disparities of both signs
    grid = replace(GRID, shear_px=(shear, shear))
    views = render(grid, CARDS, cell=8)
    found = check_grid(light(views), grid, (30, 250))
    assert found.order is None
    assert len(found.z_mm) == 3
    assert check_grid(light(views[:, ::-1]), grid, (30, 250)).order == ViewOrder(flip_cols=True)


def test_exchanged_pitches_are_found() -> None:
    grid = replace(GRID, pitch_mm=(3.0, 5.0))
    views = render(grid, CARDS, cell=8)
    wrong = replace(grid, pitch_mm=(5.0, 3.0))
    assert check_grid(light(views), wrong, (30, 250)).pitches_exchanged
    assert not check_grid(light(views), grid, (30, 250)).pitches_exchanged


@pytest.mark.parametrize("factor", [0.1, 0.13, 3, 10])
def test_a_pitch_far_off_is_found_where_the_range_is_known(views, factor) -> None:
    # All of the scene is between 50 and 180 mm; with another pitch it seems to be that times the factor.
    told = replace(GRID, pitch_mm=(4 * factor, 4 * factor))
    found = check_grid(light(views), told, (45, 200))
    assert found.outside_mm is not None
    assert (found.outside_mm > 200) == (factor > 1)


@pytest.mark.parametrize("pattern", ["blank", "noise", "columns"])
def test_what_cannot_be_judged_is_not(views, pattern) -> None:
    grey = {
        "blank": np.ones_like(views),
        "noise": np.random.default_rng(1).random(views.shape),
        "columns": np.broadcast_to(render(GRID, CARDS[:1])[:1, :, :1], views.shape),
    }[pattern]
    found = check_grid(light(grey), GRID, (30, 250))
    if pattern != "columns":
        assert found.z_mm == ()
    else:  # rows that are all alike tell nothing of the order of rows
        grey = grey[::-1]
        found = check_grid(light(grey), GRID, (30, 250))
    assert (found.order, found.pitches_exchanged) == (None, False)


def test_few_or_small_views_are_not_judged() -> None:
    tiny = replace(GRID, height=8, width=8)
    assert check_grid(light(np.ones((3, 3, 8, 8, 3))), tiny) == GridCheck()
    single = replace(GRID, rows=1, cols=1)
    assert check_grid(light(np.ones((1, 1, 90, 120, 3))), single) == GridCheck()


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("rows_cols", "z_range"), [((1, 7), None), ((2, 3), RANGES[0]), ((3, 3), None)])
def test_shuffled_views_are_told_from_those_in_order(rows_cols, z_range, seed) -> None:
    grid = replace(GRID, rows=rows_cols[0], cols=rows_cols[1])
    right = render(grid, CARDS, cell=8)
    flat = right.reshape(-1, *right.shape[2:])
    shuffled = flat[np.random.default_rng(seed).permutation(len(flat))].reshape(right.shape)
    assert check_grid(light(shuffled), grid, z_range).in_no_order
