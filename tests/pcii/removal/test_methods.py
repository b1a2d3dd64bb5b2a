"""Removal of every method, built in or of another package: what is claimed, and what is refused."""

import sys
from pathlib import Path

import numpy as np
import pytest
from other_packages import install_package
from twins import even_light, intersection_over_union, unit_grid

from pcii.base import InputError
from pcii.depth import depth_map_of, depth_posterior
from pcii.removal import METHODS, masks_of, removal_methods, roberts_magnitude, segment, without_specks
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
