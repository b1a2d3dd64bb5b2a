"""Noise gets no answers: even light of any size, brightness and grid, shading, vignetting and hot pixels."""

import itertools

import numpy as np
import pytest
from property_settings import mostly_slow
from twins import even_light

from pcii import Optics
from pcii.depth import estimate_depth
from pcii.metrics import score
from pcii.removal import METHODS, segment
from pcii.types import CameraGrid, PhotonCounts, Truth, Views

Z_MM, RANGE_MM = (150.0, 250.0), (100.0, 400.0)  # 18 to 4.5 px of disparity: with 5 x 5 views a film wide
SIZES = [(1, 1), (2, 3), (7, 90), (64, 7), (14, 10), (33, 5), (64, 72)]
GRIDS = [(2, 1), (1, 8), (3, 3), (5, 5)]
LIGHT = [1e-3, 0.05, 1.0, 100.0, 1e4]
HOT = 10_000
MOST_FALSE = 1 / 1000  # what both methods promise of noise, as a share of pixels


def grid_of(views: tuple[int, int], size: tuple[int, int]) -> CameraGrid:
    return Optics(pitch_mm=(18.0, 18.0), focal_mm=50.0, pixel_mm=0.5).grid((*views, *size))


def answered(counts: PhotonCounts) -> tuple[float, float]:
    """Shares of pixels that the depth map answers, and that removal claims."""
    depth, focus = estimate_depth(counts, RANGE_MM), segment(counts, Z_MM, method="posterior")
    return float(np.isfinite(depth.z_mm).mean()), float(focus.in_focus.mean())


@pytest.mark.parametrize(
    ("size", "rate"),
    mostly_slow(
        itertools.product(SIZES[::2], LIGHT[::2]),
        quick=[(SIZES[0], LIGHT[2]), (SIZES[2], LIGHT[0]), (SIZES[4], LIGHT[4])],
    ),
)
def test_even_light_is_not_answered(size, rate):
    grids = zip(GRIDS, itertools.cycle(["GRBG", None]))
    draws = [even_light(grid_of(views, size), rate, 0, cfa) for views, cfa in grids]
    depth, claimed = np.mean([answered(counts) for counts in draws], axis=0)
    assert depth <= MOST_FALSE
    assert claimed <= MOST_FALSE


@pytest.mark.parametrize("everywhere", [False, True])
@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_hot_pixels_are_not_answered(rate, everywhere):
    """Of one view each, or of all."""
    for views in ((5, 5), (2, 1)):
        grid, rng = grid_of(views, (64, 72)), np.random.default_rng(0)
        film = rng.poisson(rate, grid.shape_KLHW)
        # No two are adjacent: hot pixels are recognised by their neighbours.
        for place in rng.choice(8 * 9, 4, replace=False):
            i, j = 8 * (place // 9) + 2, 8 * (place % 9) + 2
            view = np.s_[:, :] if everywhere else (rng.integers(views[0]), rng.integers(views[1]))
            film[*view, i, j] += HOT
        assert max(answered(PhotonCounts.from_dense(film, grid, cfa=None))) <= MOST_FALSE


BUDGETS = [1e3, 1e7, None]  # photons per view; None is full light


def without_depth(kind: str, grid: CameraGrid) -> np.ndarray:
    """Light (K, L, H, W) of mean 1 or so that shows no depth in `RANGE_MM`."""
    y, x = (np.linspace(-1, 1, size) for size in (grid.height, grid.width))
    radius = np.hypot(y[:, None], x)
    light = {
        "vignetting": (1 + 0.4 * radius**2) ** -2,
        "shading": 1 + 0.5 * np.sin(2 * x + y[:, None]),
        "flicker": np.random.default_rng(1).uniform(0.6, 1.4, (grid.rows, grid.cols, 1, 1)),
        "hot": np.ones(()),
    }[kind]
    return np.broadcast_to(light, grid.shape_KLHW)


@pytest.mark.parametrize(
    ("kind", "budget"),
    mostly_slow(
        itertools.product(["vignetting", "shading", "flicker", "hot"], BUDGETS),
        quick=[("vignetting", 1e7), ("shading", None), ("flicker", 1e3), ("hot", 1e7)],
    ),
)
def test_what_shows_no_depth_is_not_answered(kind, budget):
    # Less than twice as wide as the parallax: each block is seen by other cameras at the borders.
    grid, rng = grid_of((5, 5), (96, 128)), np.random.default_rng(0)
    light = without_depth(kind, grid)
    if budget is None:
        depth = estimate_depth(Views(light[..., None].astype(np.float32), grid), RANGE_MM)
        assert np.isfinite(depth.z_mm).mean() <= MOST_FALSE
        return
    film = rng.poisson(light * budget / (grid.height * grid.width))
    if kind == "hot":
        film += rng.poisson(4.0, film.shape) * (rng.random(film.shape[2:]) < 1e-3)
    assert max(answered(PhotonCounts.from_dense(film, grid, cfa=None))) <= MOST_FALSE


@pytest.mark.parametrize(
    ("size", "count", "cfa"),
    mostly_slow(
        itertools.product([(1, 1), (1, 9), (40, 44)], [1, 2**40], ["GRBG", None]),
        quick=[((1, 1), 2**40, None), ((1, 9), 1, "GRBG"), ((40, 44), 2**40, "GRBG")],
    ),
)
def test_saturated_counters_tell_nothing_and_can_be_scored(count, size, cfa):
    grid = grid_of((3, 3), size)
    counts = PhotonCounts.from_dense(np.full(grid.shape_KLHW, count), grid, cfa=cfa)
    depth = estimate_depth(counts, RANGE_MM)
    assert np.isnan(depth.z_mm).all()
    # Roundings of the root of a large count are too small a range for a histogram.
    focus = [segment(counts, Z_MM, method=method) for method in METHODS]
    assert not any(one.in_focus.any() for one in focus)
    truth = Truth(np.full(size, np.inf), np.zeros(size, np.int16), {})
    assert score(focus, depth, truth).depth["coverage"] in (0, None)
