"""The posterior of a piecewise smooth surface against the sum over all its configurations."""

from itertools import product

import numpy as np
import pytest

from pcii.depth import SurfacePrior, estimate_depth, surface_posterior

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
