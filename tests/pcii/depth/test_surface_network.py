"""What the network of depth is given and gives, and the posterior of a piecewise smooth surface."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.ndimage import uniform_filter
from twins import unit_grid

from pcii.depth import (
    ExplainedViews,
    NetworkInputs,
    PosteriorDepth,
    SheetModel,
    Sheets,
    SurfacePrior,
    cut_sheets,
    depth_map_of,
    estimate_depth,
    posterior_after,
    run_network,
    surface_posterior,
)
from pcii.evidence import evidence_of_texture
from pcii.types import DepthPosterior, FocalPlanes, PhotonCounts

METHOD = PosteriorDepth()
PLANES = np.array([1.0, 3.4])


def random_inputs(Z: int = 5, h: int = 64, w: int = 96, seed: int = 0) -> NetworkInputs:
    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> np.ndarray:
        return rng.normal(size=shape).astype(np.float32)

    cells = Z, h // 2, w // 2
    maps = normal(Z, h, w), abs(normal(Z, h, w)), np.ones(cells, np.float32), normal(*cells)
    return NetworkInputs(*maps, np.ones(1, np.float32), np.zeros((Z, 2), np.float32))


def test_it_gives_a_distribution_for_each_block() -> None:
    probability, nothing, in_focus = run_network(random_inputs(), PLANES)
    assert probability.shape == (5, 64, 96)
    assert in_focus.shape == (2, 64, 96)
    assert min(probability.min(), in_focus.min()) >= 0
    np.testing.assert_allclose(probability.sum(axis=0) + nothing, 1, rtol=1e-5)
    assert in_focus.sum(axis=0).max() <= 1 + 1e-6


def test_a_requested_plane_is_three_times_as_probable_within_two_planes(monkeypatch) -> None:
    monkeypatch.setattr("pcii.depth.surface_network.TEMPERATURE", 1.0)

    def probability_of(*planes: float) -> np.ndarray:
        probability, _, in_focus = run_network(random_inputs(Z=30), np.array(planes))
        assert len(in_focus) == len(planes)
        return probability

    for planes in ([3.4], [3.0, 14.0]):
        offset = np.arange(30) - np.array(planes)[:, None]
        prior = 1 + 2 * np.exp(-((offset / 2) ** 2) / 2).sum(axis=0)
        found, expected = probability_of(*planes), probability_of() * prior[:, None, None]
        expected *= found.sum(axis=0) / expected.sum(axis=0)
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-7)


def test_bands_of_the_film_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run_network(random_inputs(), PLANES)
    monkeypatch.setattr("pcii.depth.surface_network.BAND_VALUES", 5 * 96 * 7)
    for found, expected in zip(run_network(random_inputs(), PLANES), whole, strict=True):
        # The runtime may order sums otherwise for another size.
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)


def test_inputs_tell_how_much_light_there_is(two_squares) -> None:
    planes = FocalPlanes.at_total_disparity(two_squares.counts.grid, np.arange(2.0, 8.0))

    def of(data: PhotonCounts) -> NetworkInputs:
        evidence = evidence_of_texture(data, planes, METHOD.block_px, METHOD.model)
        return METHOD.network_inputs(evidence, planes, METHOD.block_px, np.zeros(0))

    few = two_squares.counts.subsample(two_squares.counts.total / 4, np.random.default_rng(0))
    assert float(of(two_squares.counts).light[0] - of(few).light[0]) == pytest.approx(np.log10(4), abs=0.05)


def test_the_inputs_of_a_part_are_those_of_the_film(two_squares) -> None:
    """To the last bit, the mirrored end of the film included."""
    planes = FocalPlanes.at_total_disparity(two_squares.counts.grid, np.arange(2.0, 5.0))
    evidence = evidence_of_texture(two_squares.counts, planes)
    film = METHOD.network_inputs(evidence, planes, 2, np.zeros(0))
    h, w = film.evidence.shape[1:]
    part = METHOD.network_inputs(evidence, planes, 2, np.zeros(0), (slice(h - 96, h), slice(32, w)))
    for whole, found, side in zip(film[:4], part[:4], (1, 1, 2, 2), strict=True):
        assert np.array_equal(whole[:, (h - 96) // side :, 32 // side :], found)


def test_the_depth_is_read_between_the_planes_and_the_confidence_from_three() -> None:
    grid = unit_grid(1, 3, 2, 4)
    planes = FocalPlanes.at_total_disparity(grid, [4.0, 5.0, 6.0, 7.0])
    probability = np.zeros((4, 1, 2), np.float32)
    probability[:, 0, 0] = [0.0, 0.25, 0.5, 0.0]
    probability[:, 0, 1] = [0.4, 0.1, 0.0, 0.0]
    nothing = 1 - probability.sum(axis=0)
    posterior = DepthPosterior(planes, probability, nothing, 2, probability[:0], nothing < 1, nothing < 1)
    plane, confidence, total_px = posterior.most_probable()
    assert plane.tolist() in ([[1, 0]], [[2, 0]])
    np.testing.assert_allclose(confidence, [[0.75, 0.5]])
    np.testing.assert_allclose(total_px, [[(5 * 0.25 + 6 * 0.5) / 0.75, (4 * 0.4 + 5 * 0.1) / 0.5]])
    z_range_mm = (2 / 7, 2 / 4)  # of what other depths show around, half of the probability is believed
    alone, among = depth_map_of(posterior, z_range_mm), replace(posterior, is_supported=nothing > 1)
    np.testing.assert_allclose(depth_map_of(among, z_range_mm).confidence, alone.confidence / 2)
    assert alone.confidence.max() == pytest.approx(0.75)


def test_a_posterior_that_does_not_cover_the_film_is_refused() -> None:
    planes = FocalPlanes.at_total_disparity(unit_grid(1, 3, 4, 5), [4.0, 5.0])
    nowhere = np.zeros((2, 2), np.float32)
    two, none = nowhere[None].repeat(2, 0), nowhere[None][:0]
    with pytest.raises(ValueError, match=r"probability: expected real numbers \(2, 2, 3\), got"):
        DepthPosterior(planes, two, nowhere, 2, none, nowhere > 0, nowhere > 0)


PRIOR = SurfacePrior(fall=0.3, jump=0.15)


def transition(Z: int, prior: SurfacePrior) -> np.ndarray:
    apart = np.abs(np.subtract.outer(np.arange(Z), np.arange(Z)))
    stays = (1 - prior.fall) / (1 + prior.fall) * prior.fall**apart
    return (1 - prior.jump) * stays + prior.jump / Z


def comb(h: int, w: int, column: int) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Edges of the tree of a column from which all rows branch off."""
    down = [((i, column), (i + 1, column)) for i in range(h - 1)]
    return down + [((i, j), (i, j + 1)) for i in range(h) for j in range(w - 1)]


def by_enumeration(nats: np.ndarray, prior: SurfacePrior) -> np.ndarray:
    """Posterior (h, w, Z): each block's, on the trees of its column and of its row, by the sum over all."""
    Z, h, w = nats.shape
    steps = np.log(transition(Z, prior))
    places = list(np.ndindex(h, w))
    result = np.zeros((h, w, Z))
    for i, j in places:
        turned = [((b, a), (d, c)) for (a, b), (c, d) in comb(w, h, i)]
        for edges in (comb(h, w, j), turned):
            weights = np.zeros(Z)
            for labels in product(range(Z), repeat=h * w):
                z = dict(zip(places, labels, strict=True))
                total = sum(nats[z[place], *place] for place in places)
                weights[z[i, j]] += np.exp(total + sum(steps[z[a], z[b]] for a, b in edges))
            result[i, j] += weights / weights.sum() / 2
    return result


@pytest.mark.parametrize("shape", [(3, 2, 3), (4, 1, 4), (5, 3, 1)])
def test_it_is_the_sum_over_all_configurations(shape: tuple[int, int, int]) -> None:
    nats = np.random.default_rng(0).normal(0, 1.5, shape).astype(np.float32)
    np.testing.assert_allclose(surface_posterior(nats, PRIOR), by_enumeration(nats, PRIOR), rtol=2e-5)


@pytest.mark.parametrize("strength", [1.0, 300.0, 1e6])
def test_it_is_a_distribution_whatever_the_evidence(strength: float) -> None:
    nats = np.random.default_rng(1).normal(0, strength, (7, 20, 30)).astype(np.float32)
    posterior = surface_posterior(nats, SurfacePrior())
    assert posterior.min() >= 0
    np.testing.assert_allclose(posterior.sum(axis=-1), 1, rtol=1e-5)


def test_blocks_without_evidence_follow_their_neighbours_less_the_farther() -> None:
    nats = np.zeros((9, 5, 40), np.float32)
    nats[3, :, :2] = 20
    probability = surface_posterior(nats, SurfacePrior())[2, :, 3]
    assert np.all(np.diff(probability[1:]) < 0)
    assert probability[1] > 0.99
    assert probability[-1] > 1 / 9  # no plane has more than its share beforehand


def test_larger_blocks_serve_where_memory_ends(two_squares, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pcii.depth.posterior_depth.MOST_VALUES", 400_000)
    depth = estimate_depth(two_squares.counts, (1 / 9, 1.0))
    for plane in (0, 1):
        found = depth.z_mm[two_squares.masks[plane]]
        assert np.nanmedian(np.abs(6 / found - 6 / two_squares.z_mm[plane])) < 1.0
    # Two rows of pixels and more have the same depth.
    assert np.array_equal(depth.z_mm[0:-4:4], depth.z_mm[3:-1:4], equal_nan=True)


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
        corners = (MARGIN + step * (np.array([k, l]) - 2) for step in (NEAR_STEP, FAR_STEP))
        near, far = (np.s_[row : row + SIDE, col : col + SIDE] for row, col in corners)
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
    probability = np.tile(one[:, None, None], (1, SIDE, SIDE))
    posterior = posterior_of(probability, planes_px, requested=2, supported=supported)
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
