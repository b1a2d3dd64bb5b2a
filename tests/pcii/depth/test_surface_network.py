"""What the network of depth is given and gives, and the posterior of a piecewise smooth surface."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from twins import unit_grid

from pcii.depth import (
    NetworkInputs,
    PosteriorDepth,
    SurfacePrior,
    depth_map_of,
    estimate_depth,
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
    return NetworkInputs(
        normal(Z, h, w),
        abs(normal(Z, h, w)),
        np.ones(cells, np.float32),
        normal(*cells),
        np.ones(1, np.float32),
        np.zeros((Z, 2), np.float32),
    )


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
    with pytest.raises(ValueError, match=r"probability: expected real numbers \(2, 2, 3\), got"):
        DepthPosterior(
            planes, nowhere[None].repeat(2, 0), nowhere, 2, nowhere[None][:0], nowhere > 0, nowhere > 0
        )


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
