"""Removal of every method, built in or of another package: what is claimed, and what is refused."""

import itertools
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from other_packages import install_package
from twins import (
    bayer_photons,
    blocky_texture,
    even_light,
    intersection_over_union,
    opaque_views,
    square_mask,
    unit_grid,
    voxel_of,
)

import pcii
from pcii.base import InputError
from pcii.depth import depth_map_of, depth_posterior
from pcii.removal import (
    METHODS,
    ThreeStep,
    adaptive_threshold,
    cheapest_planes,
    masks_of,
    pieces_along_ridges,
    removal_methods,
    roberts_magnitude,
    segment,
    without_specks,
)
from pcii.sections import reconstruct, with_probes
from pcii.store import sample
from pcii.types import DepthPosterior, FocalPlanes, PhotonCounts

ABLE = ["three-step", "posterior"]
methods = pytest.mark.parametrize("method", [*ABLE, "brightness", "shape-from-focus"])
able = pytest.mark.parametrize("method", ABLE)

# The outline is found on windows of 5 px, so allow it to be 3 px off all along a square of 72 px.
LEAST_IOU = (66 / 72) ** 2


@able
def test_each_object_is_in_focus_at_its_own_depth_alone(two_squares, method):
    focus = segment(two_squares.counts, two_squares.z_mm, method=method)
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
    if method == "posterior":  # a plane may be requested twice
        twice = segment(counts, [540, 620, 540], method=method).in_focus
        np.testing.assert_array_equal(twice, one[[0, 1, 0]])


@methods
@pytest.mark.parametrize("photons", [0, 1])
def test_no_photon_and_a_single_one_leave_nothing_in_focus(method, photons):
    grid = unit_grid(3, 3, 64, 64)
    counts = PhotonCounts.from_events(*np.array([[0, 2, 30, 30, photons]]).T, grid, cfa="GRBG")
    assert not segment(counts, [0.5, 1.0], method=method).in_focus.any()


@methods
def test_one_view_and_an_unknown_method_are_refused(method):
    counts = PhotonCounts.from_dense(np.ones((1, 1, 8, 8), dtype=int), unit_grid(1, 1, 8, 8), cfa="GRBG")
    with pytest.raises(InputError, match=r"^counts: one view has no depth"):
        segment(counts, 1.0, method=method)
    with pytest.raises(InputError, match=rf"^method: .*'magic'.*{method}"):
        segment(sample().counts, 540, method="magic")


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_round_things_are_whole_though_less_than_5_px_of_spread_part_the_planes(share):
    data = sample()
    assert data.truth is not None
    kept = data.counts.subsample(share * data.counts.events.n.sum(), np.random.default_rng(0))
    in_focus = segment(kept, [540, 620], method="posterior").in_focus
    for object_id, mask in enumerate(in_focus, start=1):
        here = np.asarray(data.truth.object_id) == object_id
        # Their radius is 19 px: the outline may be a pixel off all along.
        assert intersection_over_union(mask, here) > 1 - 2 / 19


def test_probes_are_14_and_28_px_around_a_plane_and_near_no_other_nor_beyond_infinity():
    grid = unit_grid(5, 5, 8, 8)  # total disparity 4 / z
    planes = with_probes(FocalPlanes.at_depths(grid, 4 / 50))
    expected_px = [50, 50 - 28, 50 - 14, 50 + 14, 50 + 28]
    np.testing.assert_allclose(4 / planes.z_mm, expected_px, rtol=1e-14)  # two divisions
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


def test_brightness_keeps_what_is_bright_in_focus_or_not(two_squares):
    focus = segment(two_squares.counts, two_squares.z_mm, method="brightness")
    for plane, here in enumerate(two_squares.masks):
        there = two_squares.masks[1 - plane]
        # Otsu loses what is darker than half way; a blurred square keeps its middle.
        assert (focus.in_focus[plane] & here).sum() > 0.8 * here.sum()
        assert (focus.in_focus[plane] & there).sum() > 0.3 * there.sum()


def test_brightness_claims_nothing_of_an_even_dark():
    grid = unit_grid(4, 4, 96, 96)
    dark = even_light(grid, 0.05, seed=5)
    assert not segment(dark, [0.5], method="brightness").in_focus.any()


def test_sharpness_beside_brightness_is_better_than_brightness(two_squares):
    method = "shape-from-focus"
    simple = segment(two_squares.counts, two_squares.z_mm, method="brightness").in_focus
    focus = segment(two_squares.counts, two_squares.z_mm, method=method).in_focus
    flipped = PhotonCounts.from_dense(two_squares.dense[::-1, ::-1], two_squares.grid, cfa="GRBG")
    wrong = segment(flipped, two_squares.z_mm, method=method).in_focus
    for plane, mask in enumerate(two_squares.masks):
        here = intersection_over_union(focus[plane], mask)
        assert here > intersection_over_union(simple[plane], mask) + 0.05
        # The planted fault: the sign of the shifts reversed.
        assert intersection_over_union(wrong[plane], mask) < here / 2


def test_a_block_belongs_to_the_most_probable_plane_or_to_none(two_squares):
    sections = reconstruct(two_squares.counts, two_squares.z_mm)
    h, w = (-(-size // 2) for size in two_squares.grid.shape_HW)
    planes = FocalPlanes.at_depths(two_squares.grid, two_squares.z_mm)
    in_focus = np.zeros((2, h, w), np.float32)
    in_focus[:, 0, :4] = [[0.6, 0.3, 0.2, 0.9], [0.3, 0.4, 0.1, 0.1]]
    is_detected = np.ones((h, w), bool)
    is_detected[0, 3] = False
    depths = np.full((2, h, w), 0.5, np.float32)
    no_surface = np.zeros((h, w), np.float32)
    posterior = DepthPosterior(planes, depths, no_surface, 2, in_focus, is_detected, is_detected)
    masks = masks_of(posterior, sections).in_focus
    assert masks[:, 0, :8:2].tolist() == [[True, False, False, False], [False, True, False, False]]
    assert masks.sum() == 8


def test_nothing_is_claimed_where_the_depth_map_has_no_answer():
    counts, z_mm, range_mm = sample().counts, [540, 620], (450, 750)
    posterior = depth_posterior(counts, range_mm, z_mm=FocalPlanes.at_depths(counts.grid, z_mm))
    focus = segment(counts, z_mm, z_range_mm=range_mm, method="posterior")
    claimed = focus.in_focus.any(axis=0)
    assert claimed.any()
    assert np.isfinite(depth_map_of(posterior, range_mm).z_mm[claimed]).all()
    np.testing.assert_array_equal(masks_of(posterior, focus.sections).in_focus, focus.in_focus)


CODE = """
from dataclasses import replace
import numpy as np
from pcii import PhotonCounts, Sections, Segmented, reconstruct

def good(counts, sections):
    assert isinstance(counts, PhotonCounts) and isinstance(sections, Sections)
    mask = sections.counts.sum(axis=-1) > 0
    return Segmented(mask, "good", sections)

def text(counts, sections):
    return "in focus"

def fine(counts, sections):
    sections = reconstruct(counts, sections.planes, subpixel=2)
    return Segmented(sections.counts[..., 0] > 0, "fine", sections)

def photons(counts, sections):
    kept = np.ones((len(sections.planes), 1 + counts.events.n.size), dtype=bool)
    return replace(good(counts, sections), method="photons", photon_in_focus=kept)

def renamed(counts, sections):
    return good(counts, sections)

def steps(counts, sections):
    return Segmented(good(counts, sections).in_focus, "steps", sections, {"blur": np.ones(3)})

def alone(counts):
    return good(counts, None)

def writing(counts, sections):
    sections.counts[0] = 0
    return good(counts, sections)

number = 3
"""


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, **points: str) -> None:
    """Install `CODE` as strange_code.py with these entry points (underscores for hyphens)."""
    points = {name.replace("_", "-"): value for name, value in points.items()}
    install_package(folder, monkeypatch, {"pcii.methods": points}, {"strange_code.py": CODE})


def counts() -> PhotonCounts:
    return even_light(unit_grid(2, 2, 5, 6), 0.5, seed=1)


def test_methods_of_another_package_are_found_by_name_and_imported_when_they_are_used(tmp_path, monkeypatch):
    assert removal_methods() == tuple(METHODS)
    install(tmp_path, monkeypatch, good="strange_code:good", broken="no_such_module:remove")
    assert removal_methods() == (*METHODS, "broken", "good")
    focus = segment(counts(), [1.0, 2.0], method="good")
    np.testing.assert_array_equal(focus.in_focus, focus.sections.counts[..., 0] > 0)
    words = r"^method: 'broken' of the package strange cannot be loaded: .*no_such"
    with pytest.raises(InputError, match=words):
        segment(counts(), 1.0, method="broken")


@pytest.mark.parametrize("name", ["posterior", "../good"])
def test_the_name_of_a_built_in_and_one_that_makes_no_file_name_are_refused(tmp_path, monkeypatch, name):
    install(tmp_path, monkeypatch, **{name: "strange_code:good"})
    words = f"strange_code:good of the package strange needs another name than '{name}'"
    with pytest.raises(InputError, match=words):
        removal_methods()
    assert segment(counts(), 1.0, method="brightness").method == "brightness"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("text", r"must return a pcii\.Segmented, not str$"),
        ("fine", r"must return a Segmented of the sections that it was given$"),
        ("renamed", r"must return its own name as `method`, not 'good'$"),
        ("photons", r"must return photon_in_focus for the \d+ events of the counts, not for \d+$"),
        ("number", r"is int, which cannot be called$"),
        ("steps", r"must return maps \(1, 5, 6\) in `steps`, and 'blur' is none$"),
        ("alone", r"failed: TypeError: alone\(\) takes 1 positional argument but 2 were given$"),
        ("writing", r"failed: ValueError: assignment destination is read-only$"),
    ],
)
def test_nonsense_is_reported_in_one_sentence(tmp_path, monkeypatch, name, sentence):
    install(tmp_path, monkeypatch, **{name: f"strange_code:{name}"})
    method = name.replace("_", "-")
    with pytest.raises(InputError, match=rf"^method: '{method}' of the package strange {sentence}"):
        segment(counts(), 1.0, method=method)
    if name not in ("number", "renamed"):  # a function may be given by another name than that of its result
        function = getattr(sys.modules["strange_code"], name)
        with pytest.raises(InputError, match=rf"^method: '{name}' {sentence}"):
            segment(counts(), 1.0, method=function)


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
