import itertools
import math

import numpy as np
import pytest
from twins import (
    bayer_photons,
    blocky_texture,
    intersection_over_union,
    opaque_views,
    square_mask,
    unit_grid,
    voxel_of,
)

import pcii
from pcii.base import InputError
from pcii.removal import ThreeStep, adaptive_threshold, cheapest_planes, pieces_along_ridges
from pcii.types import FocalPlanes, PhotonCounts


def test_without_entropy_the_other_object_stays(two_squares):
    there = two_squares.masks[1]
    bright = ThreeStep(threshold=False, entropy=False)
    assert pcii.segment(two_squares.counts, two_squares.z_mm, method=bright).in_focus[0][there].mean() > 0.9


def test_the_threshold_alone_keeps_what_is_sharp_and_removes_what_is_not(two_squares):
    alone = ThreeStep(boundary=False, entropy=False)
    kept = pcii.segment(two_squares.counts, two_squares.z_mm, method=alone).in_focus
    for plane, here in enumerate(two_squares.masks):
        there = two_squares.masks[1 - plane]
        assert kept[plane][here].mean() > 0.97  # 3 sigma
        assert kept[plane][there].mean() < kept[plane][here].mean() - 0.3
    # The planted fault: swapped depths.
    assert kept[1][two_squares.masks[0]].mean() < 0.7


def test_steps_hold_every_map_of_every_step(two_squares):
    focus = pcii.segment(two_squares.counts, two_squares.z_mm, method="three-step")
    first = {"mean", "variance", "threshold", "answered", "kept"}
    assert set(focus.steps) == first | {"edges", "bright", "regions", "entropy", "winner"}
    steps = focus.steps
    together = steps["bright"] & steps["kept"] & (steps["winner"] == np.arange(2)[:, None, None])
    np.testing.assert_array_equal(focus.in_focus, together)
    assert np.array_equal(steps["regions"] > 0, np.broadcast_to(steps["bright"].any(axis=0), (2, 256, 256)))
    assert np.array_equal(steps["winner"] >= 0, steps["regions"] > 0)
    over = steps["answered"] & (steps["variance"] > steps["threshold"])
    assert np.all(over[~steps["kept"]])


def test_finer_voxels_come_back_as_pixels_and_as_voxels(two_squares):
    focus = pcii.segment(two_squares.counts, two_squares.z_mm, method=ThreeStep(subpixel=2))
    assert focus.method == "three-step-subpixel-2"
    fine = focus.steps["fine"]
    assert fine.shape == (2, 512, 512)
    for plane, mask in enumerate(two_squares.masks):
        assert intersection_over_union(focus.in_focus[plane], mask) > (66 / 72) ** 2  # 3 px off all along
        halves = fine[plane].reshape(256, 2, 256, 2).sum(axis=(1, 3)) >= 2
        np.testing.assert_array_equal(focus.in_focus[plane], halves)


@pytest.mark.parametrize("bad", [0, 1.5])
def test_a_division_that_cannot_be_is_refused(bad):
    with pytest.raises(InputError, match=r"^subpixel: expected a whole number of at least 1"):
        ThreeStep(subpixel=bad)


def threshold_twin(dense, grid, disparity, tolerance, row, col):
    """Eq. 7 at one voxel with cells of one pixel, of which 4 x 4 are pooled: mean, variance, T by loops."""
    reach = range(-2, 2)

    def samples(r, c):
        found = []
        for k, l in itertools.product(range(grid.rows), range(grid.cols)):
            total = 0
            for i, j in itertools.product(range(grid.height), range(grid.width)):
                at = voxel_of(i, k, grid.rows, disparity, 1), voxel_of(j, l, grid.cols, disparity, 1)
                inside = 0 <= at[0] < grid.height and 0 <= at[1] < grid.width
                if inside and at[0] - r in reach and at[1] - c in reach:
                    total += dense[k, l, i, j]
            if total:
                found.append(total)
        return found

    here = samples(row, col)
    mean = np.mean(here)
    rate = mean
    for _ in range(200):  # m = r / (1 - exp(-r)) by fixed point
        rate = mean * (1 - math.exp(-rate))
    noise = mean * (1 + rate - mean) * (1 + 3 * math.sqrt(2 / (len(here) - 1)))
    corner = [np.mean(samples(row + a, col + b)) for a, b in ((0, 0), (1, 1), (0, 1), (1, 0))]
    slope2 = ((corner[0] - corner[1]) ** 2 + (corner[2] - corner[3]) ** 2) / 2
    return mean, np.var(here, ddof=1), noise + slope2 * (tolerance**2 / 3 + 1 / 12)


def test_the_threshold_is_that_of_a_slow_loop():
    grid = unit_grid(3, 3, 14, 14)
    rate = np.linspace(0.2, 0.6, 14)[:, None] * np.ones(14)
    dense = np.random.default_rng(0).poisson(rate, size=grid.shape_KLHW)
    maps = adaptive_threshold(
        PhotonCounts.from_dense(dense, grid), FocalPlanes.at_depths(grid, 1.0), 0, 1, 2.0
    )
    for row, col in ((6, 6), (7, 5)):
        mean, variance, limit = threshold_twin(dense, grid, 1.0, 2.0, row, col)
        # Maps are single precision.
        assert maps["mean"][row, col] == pytest.approx(mean, rel=1e-6)
        assert maps["variance"][row, col] == pytest.approx(variance, rel=1e-6)
        assert maps["threshold"][row, col] == pytest.approx(limit, rel=1e-5)


def test_basins_are_parted_by_ridges_and_small_ones_join_over_the_lowest():
    edges = np.ones((3, 11))
    edges[:, 4], edges[:, 8] = 9, 5  # basins of 4, 3 and 2 columns
    bright = np.ones((3, 11), dtype=bool)
    assert pieces_along_ridges(bright, edges, 1).max() == 3
    pieces = pieces_along_ridges(bright, edges, 8)  # the last one, of 6 or 9 pixels, joins the middle
    two = pieces_along_ridges(bright, edges, 10)
    assert two.max() == 2
    assert len(set(two[0, :4])) == 1
    assert len(set(two[0, 5:])) == 1
    assert pieces.max() in (2, 3)


def test_what_is_dark_belongs_to_no_piece():
    bright = np.zeros((6, 9), dtype=bool)
    bright[1:5, 1:4] = bright[1:5, 5:8] = True
    pieces = pieces_along_ridges(bright, np.ones((6, 9)), 100)
    np.testing.assert_array_equal(pieces > 0, bright)
    assert pieces.max() == 2  # no neighbour to join, however small
    assert not pieces_along_ridges(np.zeros((2, 2), dtype=bool), np.ones((2, 2)), 1).any()


def chain(heights):
    """Pieces 1 .. N in a row, 2 px wide and 2 px high, with a border of each height between them."""
    N = len(heights) + 1
    pieces = np.repeat(np.arange(1, N + 1), 2)[None].repeat(2, axis=0).astype(np.int32)
    edges = np.zeros(pieces.shape)
    for border, height in enumerate(heights):
        edges[:, 2 * border + 1 : 2 * border + 3] += height
    return pieces, edges


def test_planes_are_the_cheapest_of_all_cuts_of_the_tree():
    # Merged in the order of the heights: (1 2), (3 4), then both. All cuts of that tree, by hand.
    pieces, edges = chain([1, 3, 2])
    leaves = [(1,), (2,), (3,), (4,)]
    partitions = [
        [(1, 2, 3, 4)],
        [(1, 2), (3, 4)],
        [leaves[0], leaves[1], (3, 4)],
        [(1, 2), leaves[2], leaves[3]],
        leaves,
    ]
    inner = {0: 0, 1: 1, 2: 2, 3: 2, 4: 3}
    rng = np.random.default_rng(3)
    for border_cost in (0.0, 0.3, 1.0):
        for _ in range(40):
            cost = rng.uniform(0, 4, size=(5, 3))
            best = min(
                (sum(cost[list(part)].sum(axis=0).min() for part in parts) + 2 * border_cost * inner[n], n)
                for n, parts in enumerate(partitions)
            )
            expected = np.full(5, -1)
            for part in partitions[best[1]]:
                expected[list(part)] = cost[list(part)].sum(axis=0).argmin()
            found = cheapest_planes(pieces, edges, cost, border_cost)
            np.testing.assert_array_equal(found[1:], expected[1:])


def test_objects_that_touch_are_cut_apart():
    """Two textured squares side by side at different depths, the nearer one over the border of the other."""
    grid, rng = unit_grid(7, 7, 256, 256), np.random.default_rng(2)
    near, far = (blocky_texture(rng, 80, 80) for _ in range(2))
    rates = 0.06 * opaque_views([(far, 90, 126, 3), (near, 90, 50, 7)], grid)
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", seed=3), grid, cfa="GRBG")
    near_mask = square_mask(grid, 90, 50, 80)
    focus = pcii.segment(counts, (1 / 7, 1 / 3), method="three-step")
    for plane, mask in enumerate((near_mask, square_mask(grid, 90, 126, 80) & ~near_mask)):
        # Half of the far square's border is hidden from half of the views, 12 px wide of its 76.
        assert intersection_over_union(focus.in_focus[plane], mask) > 0.7
