"""Whether a wrong order, shift or pitch of views is found, and right ones are never warned about."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from property_settings import mostly_slow
from rendered_cards import Card, render

from pcii import CameraGrid, PhotonCounts, ViewOrder, Views, check_grid, limit_photons
from pcii.evidence import CameraFit

GRID = CameraGrid(rows=3, cols=3, pitch_mm=(4, 4), focal_mm=35, pixel_mm=36 / 120, height=90, width=120)
CARDS = [Card(180, seed=1), Card(80, (0.2, 0.8, 0.1, 0.5), 2), Card(50, (0.3, 0.8, 0.6, 0.95), 3)]
PARALLAX_PX = 35 * 4 / 0.3
"""From camera to camera, of 1 mm of depth: 9.3, 5.8 and 2.6 px of the cards."""
ORDERS = [
    ViewOrder(swap_axes=swap, flip_rows=rows, flip_cols=cols)
    for swap, rows, cols in product((False, True), repeat=3)
]


def stored_so_that(views: np.ndarray, mended_by: ViewOrder) -> np.ndarray:
    """Views as somebody stored them who has to be told `mended_by`, read as if in the usual order."""
    K, L = views.shape[:2]
    table = (L, K) if mended_by.swap_axes else (K, L)
    numbers = mended_by.arrange(np.arange(K * L).reshape(table))
    stored = np.empty_like(views.reshape(K * L, *views.shape[2:]))
    stored[numbers.ravel()] = views.reshape(stored.shape)
    return stored.reshape(*table, *views.shape[2:])


@pytest.fixture(scope="module")
def views() -> np.ndarray:
    return render(GRID, CARDS, cell=8)


def test_right_views_are_not_warned_about_and_their_depths_are_found(views) -> None:
    """To 0.7 px of total disparity: planes are half a pixel apart, of views that move by whole ones."""
    fit = check_grid(Views(views, GRID), (30.0, 250.0))
    assert fit == CameraFit(fit.z_mm, fit.nearest_mm)
    assert [2 * PARALLAX_PX / z for z in fit.z_mm] == pytest.approx(
        [2 * PARALLAX_PX / z for z in (50, 80, 180)], abs=0.7
    )


@pytest.mark.parametrize("mended_by", ORDERS[1:], ids=str)
def test_every_wrong_order_is_found(views, mended_by) -> None:
    fit = check_grid(Views(stored_so_that(views, mended_by), GRID))
    assert (fit.order, fit.shear_px, fit.z_mm) == (mended_by, None, ())


def test_rows_and_columns_exchanged_in_a_grid_that_is_not_square() -> None:
    grid = replace(GRID, rows=2, cols=4)
    swapped = ViewOrder(swap_axes=True)
    right = render(grid, CARDS, cell=8)
    stated = replace(grid, rows=4, cols=2)
    assert check_grid(Views(stored_so_that(right, swapped), stated), (30, 250)).order == swapped
    assert check_grid(Views(right, grid), (30, 250)).order is None


@pytest.mark.parametrize(
    ("rows_cols", "noise"),
    mostly_slow(
        product([(1, 5), (5, 1), (2, 2), (4, 3)], [0.0, 0.1]),
        quick=[((1, 5), 0.1), ((2, 2), 0.0), ((4, 3), 0.1)],
    ),
)
def test_grids_of_any_shape_also_with_noise(rows_cols, noise) -> None:
    grid = replace(GRID, rows=rows_cols[0], cols=rows_cols[1])
    clean = render(grid, CARDS, cell=8)
    noisy = np.maximum(clean + noise * np.random.default_rng(4).normal(size=clean.shape), 0)
    fit = check_grid(Views(noisy, grid), (30, 250))
    assert fit == CameraFit(fit.z_mm, fit.nearest_mm)
    turned = check_grid(Views(noisy[::-1, ::-1], grid), (30, 250)).order
    assert turned == ViewOrder(flip_rows=grid.rows > 1, flip_cols=grid.cols > 1)


SHEAR = PARALLAX_PX / 90
"""Px per camera, so that what is at 90 mm stands still: disparities of both signs."""


def test_a_sheared_grid_is_judged_like_any_other() -> None:
    grid = replace(GRID, shear_px=(SHEAR, SHEAR))
    views = render(grid, CARDS, cell=8)
    assert len(check_grid(Views(views, grid), (30, 250)).z_mm) == 3
    assert check_grid(Views(views[:, ::-1], grid), (30, 250)).order == ViewOrder(flip_cols=True)


@pytest.mark.parametrize(
    ("stated", "order"),
    [(0.0, ViewOrder()), (-SHEAR, ViewOrder()), (SHEAR / 8, ViewOrder(swap_axes=True))],
    ids=["none", "opposite", "some, and swapped"],
)
def test_a_shift_that_was_taken_out_is_no_flip(stated, order) -> None:
    """Both signs of disparity in one grid tell a shift from a flip; the farthest is 2.6 px behind SHEAR."""
    shifted = render(replace(GRID, shear_px=(SHEAR, SHEAR)), CARDS, cell=8)
    fit = check_grid(Views(stored_so_that(shifted, order), replace(GRID, shear_px=(stated, stated))))
    assert fit.order == (order if order.swap_axes else None)
    assert fit.shear_px is not None
    least = SHEAR - PARALLAX_PX / 180
    assert least < fit.shear_px[0] < 3 * least
    mended = replace(GRID, shear_px=fit.shear_px)
    fit = check_grid(Views(shifted, mended))
    assert (fit.order, fit.shear_px, len(fit.z_mm)) == (None, None, 3)


def test_photon_counts_are_judged_if_there_are_enough() -> None:
    """30 000 photons per view are 4 in a cell of 4 x 4 px; of 1000 nothing is said, and nothing wrong."""
    grid = replace(GRID, rows=5, cols=5, pixel_mm=0.12, height=240, width=300)
    cards = [Card(450, seed=1), Card(200, (0.2, 0.8, 0.1, 0.5), 2), Card(125, (0.3, 0.8, 0.6, 0.95), 3)]
    light = Views(render(grid, cards, cell=20), grid)
    counts = limit_photons(light, 30_000, seed=1)
    assert len(check_grid(counts).z_mm) == 3
    flipped = PhotonCounts.from_dense(counts.dense[:, ::-1], grid)
    assert check_grid(flipped).order == ViewOrder(flip_cols=True)
    few = limit_photons(light, 1000, seed=1)
    assert check_grid(few) == check_grid(PhotonCounts.from_dense(few.dense[::-1, ::-1], grid)) == CameraFit()


@pytest.mark.parametrize("pattern", ["blank", "noise", "columns", "shuffled"])
def test_what_cannot_be_judged_is_not(views, pattern) -> None:
    rng = np.random.default_rng(1)
    seen = {
        "blank": np.ones_like(views),
        "noise": rng.random(views.shape),
        "columns": np.broadcast_to(render(GRID, CARDS[:1])[:1, :, :1], views.shape),
        "shuffled": views.reshape(9, 90, 120, 3)[rng.permutation(9)].reshape(views.shape),
    }[pattern]
    # Rows of cameras that see the same tell nothing of the order of rows.
    fit = check_grid(Views(seen[::-1] if pattern == "columns" else seen, GRID), (30, 250))
    assert (fit.order, fit.shear_px) == (None, None)
    assert fit.z_mm == () or pattern == "columns"
    assert fit.nearest_mm is not None
