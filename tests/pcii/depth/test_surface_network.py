"""What the network of depth is given and gives, whatever its weights are."""

from dataclasses import replace

import numpy as np
import pytest
from twins import unit_grid

from pcii.base import threads, use_threads
from pcii.depth import NetworkInputs, PosteriorDepth, SurfacePrior, depth_map_of, run_network, surface_network
from pcii.depth.network_inputs import hint_of, inputs_of
from pcii.depth.surface_network import depth_prior, near_requested
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


def test_each_depth_is_near_the_closest_requested_plane_within_reach() -> None:
    near = near_requested(40, np.array([30.0, 4.4, np.nan]))
    assert near[:, 15:20].sum() == 0
    assert near[1].nonzero()[0].tolist() == list(range(15))
    assert near[0].nonzero()[0].tolist() == list(range(20, 40))
    assert near_requested(7, np.zeros(0)).shape == (0, 7)


def test_a_requested_plane_is_three_times_as_probable_and_the_others_alike() -> None:
    prior = depth_prior(60, np.array([20.0, 41.5]))
    assert prior[[0, 20, 22, 59]] == pytest.approx([1, 3, 1 + 2 * np.exp(-0.5), 1], abs=1e-3)
    assert prior[41] == prior[42]
    np.testing.assert_array_equal(depth_prior(9, np.zeros(0)), np.ones(9))


def test_depths_and_masks_are_weighted_by_the_request_and_masks_by_what_was_learned(monkeypatch) -> None:
    monkeypatch.setattr(
        surface_network, "TEMPERATURE", 1.0
    )  # so that depths are those that masks are made of

    def of(*planes: float) -> tuple[np.ndarray, np.ndarray]:
        """Probabilities of planes, and the logits of masks solved from the equation of the theory."""
        requested = np.array(planes)
        probability, _, in_focus = run_network(random_inputs(Z=30), requested)
        near = np.tensordot(near_requested(30, requested), probability, axes=1) + surface_network.MIN_NEAR
        far = 1 - near.sum(axis=0) + (len(planes) + 1) * surface_network.MIN_NEAR
        return probability, np.log(in_focus / near) - np.log((1 - in_focus.sum(axis=0)) / far)

    (one, logits), (both, (lower, upper)) = of(3.4), of(3.0, 4.0)
    for probability, planes in ((one, [3.4]), (both, [3.0, 4.0])):
        expected = of()[0] * depth_prior(30, np.array(planes))[:, None, None]
        expected *= probability.sum(axis=0) / expected.sum(axis=0)
        np.testing.assert_allclose(probability, expected, rtol=1e-3, atol=1e-7)
    # What was learned is of planes, whatever is requested.
    np.testing.assert_allclose(logits[0], 0.6 * lower + 0.4 * upper, atol=0.02)
    assert logits.std() > 0.05


def test_bands_of_the_film_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run_network(random_inputs(), PLANES)
    monkeypatch.setattr(surface_network, "BAND_VALUES", 5 * 96 * 7)
    for own, expected in zip(run_network(random_inputs(), PLANES), whole, strict=True):
        # The runtime may order sums otherwise for another size.
        np.testing.assert_allclose(own, expected, rtol=1e-4, atol=1e-6)


def test_the_number_of_threads_does_not_show() -> None:
    before = threads()
    results = []
    try:
        for count in (1, 2):
            use_threads(count)
            results.append(run_network(random_inputs(), PLANES)[0])
    finally:
        use_threads(before)
    assert np.array_equal(*results)


def test_inputs_tell_how_much_light_there_is(two_squares) -> None:
    planes = FocalPlanes.at_total_disparity(two_squares.counts.grid, np.arange(2.0, 8.0))

    def of(data: PhotonCounts) -> NetworkInputs:
        evidence = evidence_of_texture(data, planes, METHOD.block_px, METHOD.model)
        return METHOD.network_inputs(evidence, planes, METHOD.block_px, np.zeros(0))

    few = two_squares.counts.subsample(two_squares.counts.total / 4, np.random.default_rng(0))
    assert float(of(two_squares.counts).light[0] - of(few).light[0]) == pytest.approx(np.log10(4), abs=0.05)


def test_a_mirrored_film_has_mirrored_inputs(two_squares) -> None:
    grid = two_squares.counts.grid
    planes = FocalPlanes.at_total_disparity(grid, np.arange(2.0, 8.0))
    evidence = evidence_of_texture(two_squares.counts, planes, METHOD.block_px, METHOD.model)
    samples, hint = grid.view_count * METHOD.block_px**2, hint_of(len(planes), np.array([2.0]))
    film = slice(0, 2 * -(-evidence.nats.shape[1] // 2)), slice(0, 2 * -(-evidence.nats.shape[2] // 2))
    own = inputs_of(evidence, samples, SurfacePrior(), film, hint)
    turned = inputs_of(
        evidence._replace(
            nats=evidence.nats[:, ::-1], sums=evidence.sums[:, ::-1], samples=evidence.samples[:, ::-1]
        ),
        samples,
        SurfacePrior(),
        film,
        hint,
    )
    for part, other in zip(own[:4], turned[:4], strict=True):
        np.testing.assert_allclose(part[:, ::-1], other, rtol=1e-4, atol=1e-4)


def test_the_inputs_of_a_part_are_those_of_the_film(two_squares) -> None:
    """To the last bit, the mirrored end of the film included."""
    planes = FocalPlanes.at_total_disparity(two_squares.counts.grid, np.arange(2.0, 5.0))
    evidence = evidence_of_texture(two_squares.counts, planes)
    film = METHOD.network_inputs(evidence, planes, 2, np.zeros(0))
    h, w = film.evidence.shape[1:]
    part = METHOD.network_inputs(evidence, planes, 2, np.zeros(0), (slice(h - 96, h), slice(32, w)))
    for whole, own, side in zip(film[:4], part[:4], (1, 1, 2, 2), strict=True):
        assert np.array_equal(whole[:, (h - 96) // side :, 32 // side :], own)


def test_a_hint_says_how_near_a_plane_is_to_the_nearest_requested_one() -> None:
    hint = hint_of(6, np.array([1.0, 28.0]))
    np.testing.assert_allclose(hint[:, 0], np.exp(-(((np.arange(6) - 1) / 1.5) ** 2) / 2), rtol=1e-6)
    assert (np.diff(hint[1:, 1]) < 0).all()
    assert not hint_of(6, np.zeros(0)).any()


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
    with pytest.raises(ValueError, match=r"probability: expected \(2, 2, 3\), got \(2, 2, 2\)"):
        DepthPosterior(
            planes, nowhere[None].repeat(2, 0), nowhere, 2, nowhere[None][:0], nowhere > 0, nowhere > 0
        )
