"""The search: proposals in pieces, an energy that never rises, and squares that are found where they are."""

import numpy as np
import pytest
from twins import unit_grid

from pcii.core.photon_counts import PhotonCounts
from pcii.scene_model.energy import SceneEnergy
from pcii.scene_model.parameters import SceneParameters
from pcii.scene_model.proposals import hulls, merged, other_labelling, outlines_moved, shifted
from pcii.scene_model.rays import Rays
from pcii.scene_model.solver import fused, least_energy, state_of

SIDE_PX, CAMERAS = 96, 7
NEAR_PX, FAR_PX = 30.0, 18.0


@pytest.fixture(scope="module")
def two_bars() -> tuple[SceneEnergy, np.ndarray]:
    """An upright bar before a level one, both plain and of one brightness; and the true labels of cells."""
    grid = unit_grid(CAMERAS, CAMERAS, SIDE_PX, SIDE_PX)
    i, j = np.indices((SIDE_PX, SIDE_PX))
    rates = np.full(grid.shape_KLHW, 0.002)
    for total_px, first, last, along in ((FAR_PX, 38, 58, i), (NEAR_PX, 42, 54, j)):
        across = j if along is i else i
        for k, l in np.ndindex(CAMERAS, CAMERAS):
            down, right = ((c - (CAMERAS - 1) / 2) * total_px / (CAMERAS - 1) for c in (k, l))
            at, beside = (along + (down if along is i else right), across + (right if along is i else down))
            rates[k, l][(first <= at) & (at < last) & (beside >= 20) & (beside < 76)] = 0.15
    photons = np.random.default_rng(5).poisson(rates)
    parameters = SceneParameters(cells_across=48)
    depths_mm = (CAMERAS - 1) / 36.0, (CAMERAS - 1) / 12.0
    rays = Rays.through(PhotonCounts.from_dense(photons, grid), depths_mm, parameters)
    total_px = rays.planes.total_disparity_px
    labels = np.full(rays.shape, -1, np.int16)
    labels[19:29, 10:38] = np.abs(total_px - FAR_PX).argmin()
    labels[10:38, 21:27] = np.abs(total_px - NEAR_PX).argmin()
    return SceneEnergy(rays, parameters), labels


def test_the_truth_has_less_energy_than_what_is_near_it(two_bars: tuple[SceneEnergy, np.ndarray]):
    energy, truth = two_bars
    least = energy.of(truth).sum()
    count = len(energy.rays.planes)
    for by in (-3, 3):
        assert energy.of(shifted(truth, by, count).labels).sum() > least + 10
    for nearer in (True, False):
        assert energy.of(outlines_moved(truth, 2, nearer, 8).labels).sum() > least + 10
    swapped = np.where(truth == truth.max(), truth[24, 12], truth)
    assert energy.of(swapped).sum() > least + 10


def test_the_search_finds_what_crosses_what_and_never_rises(two_bars: tuple[SceneEnergy, np.ndarray]):
    energy, truth = two_bars
    start = truth.copy()
    start[19:29, 21:27] = truth[24, 12]  # the crossing is given to the wrong bar
    found = least_energy(energy, [start])
    assert (np.diff(found.history) < 0).all()
    assert found.total == pytest.approx(energy.of(found.labels).sum())
    assert found.total < energy.of(truth).sum() + 5
    assert np.mean(np.abs(found.labels - truth) > 1) < 0.03


def test_a_piece_that_costs_more_is_left_and_one_that_costs_less_is_taken(
    two_bars: tuple[SceneEnergy, np.ndarray],
):
    energy, truth = two_bars
    wrong = truth.copy()
    wrong[10:19, 21:27] = -1  # without the upper end of the upright bar
    state = state_of(energy, wrong)
    offer = truth.copy()
    offer[19:29, 35:38] = -1  # and without an end of the level one, which costs less than that saves
    assert energy.of(offer).sum() < state.total
    better = fused(energy, state, other_labelling(wrong, offer))
    np.testing.assert_array_equal(better.labels, truth)


def test_pieces_of_proposals_are_connected_and_cover_what_changes():
    labels = np.full((12, 12), 3, np.int16)
    labels[2:5, 2:5], labels[8:10, 2:5], labels[0, 11] = 8, 8, -1
    proposal = shifted(labels, 1, 9)
    assert proposal.labels.max() == 8
    assert proposal.labels[0, 11] == -1
    assert [np.unique(proposal.labels[proposal.pieces == piece]).tolist() for piece in (1, 2, 3)] == [
        [4],
        [8],
        [8],
    ]
    joined = merged(labels, 0)
    # The small surfaces join the large one, which then stays.
    assert (joined.labels == 3).all()
    (hull,) = hulls(labels)
    assert hull.labels[6, 3] == 8
    assert (hull.pieces[labels == 8] == 0).all()
    grown = outlines_moved(labels, 1, True, 6)
    assert grown.labels[1, 3] == 8
    assert grown.pieces.max() > 3
