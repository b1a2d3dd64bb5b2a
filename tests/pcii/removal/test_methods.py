from functools import cache

import numpy as np
import pytest
from twins import intersection_over_union, unit_grid

from pcii.base import InputError
from pcii.removal import roberts_magnitude, segment, without_specks
from pcii.sections import with_probes
from pcii.store import sample
from pcii.types import FocalPlanes, PhotonCounts

ABLE = ["three-step", "posterior"]
methods = pytest.mark.parametrize("method", [*ABLE, "brightness", "shape-from-focus"])
able = pytest.mark.parametrize("method", ABLE)

# The outline is found on windows of 5 px, so allow it to be 3 px off all along a square of 72 px.
LEAST_IOU = (66 / 72) ** 2


@pytest.fixture(scope="module")
def found(two_squares):
    """What a method finds of the two squares, found once."""
    return cache(lambda method: segment(two_squares.counts, two_squares.z_mm, method=method))


@able
def test_each_object_is_in_focus_at_its_own_depth_alone(two_squares, found, method):
    focus = found(method)
    for plane, here in enumerate(two_squares.masks):
        there = two_squares.masks[1 - plane]
        assert intersection_over_union(focus.in_focus[plane], here) > LEAST_IOU
        # Brightness alone would keep the other object as well.
        assert (focus.in_focus[plane] & there).sum() < 0.05 * there.sum()


@able
def test_cameras_in_the_wrong_order_do_not_pass(two_squares, method):
    # The planted fault of the test above: the sign of the shifts reversed, which nothing else shows.
    flipped = PhotonCounts.from_dense(two_squares.dense[::-1, ::-1], two_squares.grid, cfa="GRBG")
    focus = segment(flipped, two_squares.z_mm, method=method)
    found = [intersection_over_union(focus.in_focus[p], two_squares.masks[p]) for p in (0, 1)]
    assert max(found) < LEAST_IOU / 2


@able
def test_nothing_is_in_focus_where_nothing_is(two_squares, method):
    between = 2 / (1 / two_squares.z_mm[0] + 1 / two_squares.z_mm[1])  # 6 px of blur from either
    focus = segment(two_squares.counts, [*two_squares.z_mm, between], method=method)
    assert focus.in_focus[2].sum() < 0.05 * two_squares.masks[0].sum()


@methods
def test_sparse_and_dense_counts_give_the_same_masks(method):
    counts = sample().counts
    dense = PhotonCounts.from_dense(counts.dense, counts.grid, cfa=counts.cfa)
    assert counts.is_sparse != dense.is_sparse
    one, other = (segment(each, [540, 620], method=method).in_focus for each in (counts, dense))
    np.testing.assert_array_equal(one, other)


@methods
@pytest.mark.parametrize("photons", [0, 1])
def test_no_photon_and_a_single_one_leave_nothing_in_focus(method, photons):
    grid = unit_grid(3, 3, 64, 64)
    counts = PhotonCounts.from_events(*np.array([[0, 2, 30, 30, photons]]).T, grid, cfa="GRBG")
    assert not segment(counts, [0.5, 1.0], method=method).in_focus.any()


@methods
def test_one_view_is_refused(method):
    grid = unit_grid(1, 1, 8, 8)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid, cfa="GRBG")
    with pytest.raises(InputError, match=r"^counts: one view has no depth"):
        segment(counts, 1.0, method=method)


def test_an_unknown_method_is_refused_with_the_known_ones(two_squares):
    with pytest.raises(InputError, match=r"^method: .*'magic'.*three-step.*posterior"):
        segment(two_squares.counts, two_squares.z_mm, method="magic")


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_round_things_are_whole_though_less_than_5_px_of_spread_part_the_planes(share):
    data = sample()
    assert data.truth is not None
    kept = data.counts.subsample(share * data.counts.events.n.sum(), np.random.default_rng(0))
    in_focus = segment(kept, [540, 620], method="posterior").in_focus
    for own, mask in enumerate(in_focus, start=1):
        here = np.asarray(data.truth.object_id) == own
        # Their radius is 19 px: the outline may be a pixel off all along.
        assert intersection_over_union(mask, here) > 1 - 2 / 19


def test_a_depth_that_is_asked_for_twice_is_answered_twice():
    counts = sample().counts
    once, twice = (segment(counts, z_mm, method="posterior") for z_mm in ([540, 620], [540, 620, 540]))
    np.testing.assert_array_equal(twice.in_focus[:2], once.in_focus)
    np.testing.assert_array_equal(twice.in_focus[2], once.in_focus[0])


def test_probes_stand_14_and_28_px_of_total_disparity_around_a_plane():
    grid = unit_grid(5, 5, 8, 8)  # total disparity 4 / z
    planes = with_probes(FocalPlanes.at_depths(grid, 4 / 50))
    np.testing.assert_allclose(
        4 / planes.z_mm, [50, 50 - 28, 50 - 14, 50 + 14, 50 + 28], rtol=1e-14
    )  # two divisions


def test_no_probe_is_near_another_plane_or_beyond_infinity():
    grid = unit_grid(5, 5, 8, 8)
    total_px = with_probes(FocalPlanes.at_depths(grid, [4 / 20, 4 / 35])).total_disparity_px
    np.testing.assert_allclose(total_px[:2], [20, 35], rtol=1e-14)  # two divisions
    assert np.all(total_px > 0)
    gaps = np.abs(total_px[2:, None] - total_px[:2])
    assert gaps.min() > 7  # half a probe step


def test_roberts_cross_takes_both_diagonals_and_continues_the_border():
    image = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]])
    # Down-right and up-right differences at each upper left corner, Eq. 8 by hand.
    down = [[-3, 0, 0], [0, -1, -4], [0, -4, 0]]
    up = [[0, -3, 0], [3, 0, -4], [0, 4, 0]]
    np.testing.assert_array_equal(roberts_magnitude(image), np.hypot(down, up))


def test_specks_and_holes_below_the_size_go_and_others_stay():
    mask = np.zeros((12, 12), dtype=bool)
    mask[1:8, 1:8] = True
    mask[3:5, 3:5] = False  # a hole of 4
    mask[10, 1:4] = True  # a speck of 3
    mask[10, 6:11] = True  # a piece of 5
    expected = np.zeros_like(mask)
    expected[1:8, 1:8] = True
    expected[10, 6:11] = True
    np.testing.assert_array_equal(without_specks(mask, 5), expected)
    np.testing.assert_array_equal(without_specks(mask, 4)[3:5, 3:5], False)
