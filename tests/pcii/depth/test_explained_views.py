import numpy as np
import pytest
from scipy.ndimage import uniform_filter
from twins import unit_grid

from pcii.depth import ExplainedViews, SheetModel, Sheets, cut_sheets, posterior_after
from pcii.types import DepthPosterior, FocalPlanes, PhotonCounts

SIDE, CAMERAS, MARGIN = 48, 5, 16
NEAR_STEP, FAR_STEP = 5, 2
"""Disparity in px per camera of bars and of the wall behind them."""


def bars(width: int = 10, first: int = 8) -> np.ndarray:
    """Which blocks of the film of the virtual centre show bars (h, w)."""
    columns = (np.arange(SIDE) - first) % 24 < width
    return np.broadcast_to(columns, (SIDE, SIDE)) & (np.arange(SIDE) >= first)


def draw(photons_per_px: float, seed: int, shown: np.ndarray) -> PhotonCounts:
    """Counts of bars before a wall, both with a texture of their own, seen by 5 x 5 cameras."""
    random, grid = np.random.default_rng(seed), unit_grid(CAMERAS, CAMERAS, SIDE, SIDE)
    wall, bar = (random.choice([0.3, 1.7], (SIDE + 2 * MARGIN,) * 2) for _ in range(2))
    wide = np.pad(shown, MARGIN)
    rate = np.empty(grid.shape_KLHW)
    for k, l in np.ndindex(CAMERAS, CAMERAS):
        near, far = (
            tuple(slice(MARGIN + step * (n - 2), MARGIN + step * (n - 2) + SIDE) for n in (k, l))
            for step in (NEAR_STEP, FAR_STEP)
        )
        rate[k, l] = np.where(wide[near], bar[near], wall[far])
    return PhotonCounts.from_dense(random.poisson(photons_per_px * rate), grid)


def sheets_of(shown: np.ndarray) -> Sheets:
    """The bars and the wall, known for sure."""
    total = np.stack([np.full((SIDE, SIDE), 4.0 * step, np.float32) for step in (NEAR_STEP, FAR_STEP)])
    probability = np.stack([shown, ~shown]).astype(np.float32)
    return Sheets(total, 2.5, probability, np.eye(2, dtype=bool), np.argsort(-total, axis=0))


@pytest.mark.parametrize("photons_per_px", [0.15, 0.6, 2.4])
def test_the_right_sheets_explain_photons_best(photons_per_px: float) -> None:
    shown = bars()
    missing = shown & (np.arange(SIDE) < 30)
    wider, moved = bars(width=12), bars(first=10)
    best = 0
    for seed in range(20):
        counts = draw(photons_per_px, seed, shown)
        right, *wrong = (
            ExplainedViews(counts, sheets_of(masks), 1, SheetModel()).objective()
            for masks in (shown, missing, wider, moved)
        )
        best += right > max(wrong)
    assert best >= 19


@pytest.mark.parametrize(("photons_per_px", "least"), [(0.1, 0.75), (1.0, 0.9), (10.0, 0.95)])
def test_sweeps_find_the_bars_and_never_lower_the_objective(photons_per_px: float, least: float) -> None:
    shown = bars()
    # Where there may be bars the network does not know which it is.
    taken = np.where(np.arange(SIDE) < 8, 0.1, 0.5) * np.ones((SIDE, SIDE))
    doubtful = sheets_of(shown)._replace(probability=np.stack([taken, 1 - taken]).astype(np.float32))
    views = ExplainedViews(draw(photons_per_px, 0, shown), doubtful, 1, SheetModel())
    objectives = [views.objective()]
    while views.sweep() and len(objectives) < 12:
        objectives.append(views.objective())
    assert (np.diff(objectives) >= 0).all()
    found = views.state.masks[0] > 0.5
    # Photons of a window of 3 blocks decide, so outlines may be 2 blocks off.
    sure = uniform_filter(shown.astype(float), 5)
    is_sure = (sure < 0.01) | (sure > 0.99)
    assert (found == shown)[is_sure].mean() > least


def posterior_of(
    planes: np.ndarray, planes_px: np.ndarray, requested: int, supported: bool
) -> DepthPosterior:
    """A posterior of planes (Z, h, w) of known surfaces, the same for each requested plane."""
    of_grid = FocalPlanes.at_total_disparity(unit_grid(CAMERAS, CAMERAS, SIDE, SIDE), planes_px)
    nowhere, is_supported = np.zeros((SIDE, SIDE), bool), np.full((SIDE, SIDE), supported)
    in_focus = np.full((requested, SIDE, SIDE), 0.9 / max(requested, 1), np.float32)
    nothing = np.asarray(1 - planes.sum(axis=0), np.float32)
    return DepthPosterior(of_grid, planes, nothing, 1, in_focus, nowhere, is_supported)


@pytest.mark.parametrize("supported", [False, True])
def test_a_posterior_follows_its_sheets_where_photons_tell_the_depth(supported: bool) -> None:
    planes_px = np.arange(2.0, 26.0)
    far, near = (np.abs(planes_px - 4 * step) < 1.5 for step in (FAR_STEP, NEAR_STEP))
    one = (0.2 * far + 0.1 * near).astype(np.float32)  # and .1 of no surface
    posterior = posterior_of(
        np.tile(one[:, None, None], (1, SIDE, SIDE)), planes_px, requested=2, supported=supported
    )
    sheets = sheets_of(bars())
    before = np.stack([np.full((SIDE, SIDE), share, np.float32) for share in (0.3, 0.6)])
    same = posterior_after(posterior, sheets, before, before, 0.02)
    np.testing.assert_allclose(same.probability, posterior.probability, atol=1e-6)
    np.testing.assert_allclose(same.in_focus, posterior.in_focus, atol=1e-6)
    grown = posterior_after(posterior, sheets, before, before[::-1], 0.0)
    np.testing.assert_allclose(grown.probability.sum(axis=0) + grown.no_surface, 1, atol=1e-5)
    np.testing.assert_allclose(grown.in_focus[0] / grown.in_focus[1], 4, rtol=1e-4)
    share = grown.probability[:, 9, 9]
    is_near = planes_px > 14
    mean_px = [np.average(planes_px[part], weights=share[part]) for part in (~is_near, is_near)]
    assert mean_px == pytest.approx([8, 20], abs=1e-3)
    # Twice the near sheet and half the far one count half, in logarithms: .3 and .6 to .424 each, beside .1.
    assert share[is_near].sum() == pytest.approx(0.4473 if supported else 0.3, abs=1e-3)


def test_sheets_are_the_connected_parts_of_smooth_depth_from_near_to_far() -> None:
    planes_px, rows = np.arange(5.0, 25.0), np.arange(SIDE)
    slope_px = 8 + rows / 12  # to 12 px, one block after the other by less than a plane
    depth_px = np.where(rows[:, None] < 8 + rows[:, None] // 2, slope_px[:, None], 20.0) * np.ones(SIDE)
    depth_px[30:, 30:] = 20.0
    probability = np.maximum(1 - np.abs(depth_px - planes_px[:, None, None]), 0).astype(np.float32)
    posterior = posterior_of(probability, planes_px, requested=2, supported=True)
    sheets = cut_sheets(posterior, depth_px, np.array([20.5, 15.0]), SheetModel())
    middle_px = np.median(sheets.total_px, axis=(1, 2))
    assert len(middle_px) == 3
    assert sheets.is_at.sum(axis=1).tolist() == [1, 1]
    assert middle_px[sheets.is_at[1]] == pytest.approx([15.0])
    seen = sheets.probability.argmax(axis=0)
    np.testing.assert_array_equal(middle_px[seen] > 15, depth_px == 20.0)
    # Of two sheets that are surely there the nearer one is seen, which has more disparity.
    is_seen = sheets.visible(np.ones_like(sheets.total_px)) == 1
    np.testing.assert_array_equal(
        sheets.total_px[is_seen.argmax(axis=0), *np.indices(seen.shape)], sheets.total_px.max(axis=0)
    )
