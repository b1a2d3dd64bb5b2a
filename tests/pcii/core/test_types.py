from typing import Any

import numpy as np
import pytest
from twins import unit_grid

from pcii.base.errors import InputError
from pcii.core.arrays import check_z_mm
from pcii.core.camera_grid import CameraGrid
from pcii.core.estimates import DepthMap, Score, Segmented
from pcii.core.focal_planes import FocalPlanes
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.section_stack import Sections
from pcii.core.truth import Truth
from pcii.removal.methods import segment
from pcii.sections.reconstruction import reconstruct

GOOD: dict[str, Any] = {
    "rows": 2,
    "cols": 3,
    "pitch_mm": (5.0, 5.0),
    "focal_mm": 50.0,
    "pixel_mm": 0.03,
    "height": 4,
    "width": 6,
}
NOT_SIZES: list[Any] = [0, -1, 2.0, "2", True, None, float("nan")]
NOT_LENGTHS: list[Any] = [0, -1.0, float("nan"), float("inf"), "5", True, None]


@pytest.mark.parametrize("name", ["rows", "cols", "height", "width"])
@pytest.mark.parametrize("value", NOT_SIZES)
def test_a_bad_size_is_refused_by_name(name, value):
    with pytest.raises(InputError, match=f"^{name}: .*at least 1"):
        CameraGrid(**{**GOOD, name: value})


@pytest.mark.parametrize("name", ["focal_mm", "pixel_mm"])
@pytest.mark.parametrize("value", NOT_LENGTHS)
def test_a_bad_length_is_refused_by_name(name, value):
    with pytest.raises(InputError, match=f"^{name}: .*above 0 mm"):
        CameraGrid(**{**GOOD, name: value})


@pytest.mark.parametrize("value", [5.0, (5.0,), (5.0, 5.0, 5.0), None, *((5.0, x) for x in NOT_LENGTHS)])
def test_a_bad_pitch_is_refused_by_name(value):
    with pytest.raises(InputError, match=r"^pitch_mm: "):
        CameraGrid(**{**GOOD, "pitch_mm": value})


@pytest.mark.parametrize("value", [1.0, (1.0,), None, (1.0, float("nan")), (True, 1.0), ("1", 1.0)])
def test_a_bad_shear_is_refused_by_name(value):
    with pytest.raises(InputError, match=r"^shear_px: "):
        CameraGrid(**{**GOOD, "shear_px": value})


def test_a_pitch_may_be_a_list_of_whole_numbers():
    assert CameraGrid(**{**GOOD, "pitch_mm": [5, 4]}).pitch_mm == (5.0, 4.0)


def test_grid_counts_and_shapes():
    grid = CameraGrid(**GOOD)
    assert grid.view_count == 6
    assert grid.shape_KLHW == (2, 3, 4, 6)


@pytest.mark.parametrize("bad", [0, -540, [540, 0], [540, -1], float("nan"), float("inf"), -float("inf")])
def test_a_depth_that_is_not_above_zero_and_finite_is_refused(bad):
    with pytest.raises(InputError, match=r"^z_mm: a depth must be a finite number above 0 mm"):
        check_z_mm(bad)


@pytest.mark.parametrize("bad", [[], [[540.0]], "near", ["a", "b"], [[540], [620, 700]]])
def test_what_is_not_a_list_of_depths_is_refused(bad):
    with pytest.raises(InputError, match=r"^z_mm: expected"):
        check_z_mm(bad)


def test_one_depth_is_a_list_of_one():
    np.testing.assert_array_equal(check_z_mm(540), [540.0])


# Read-only


def test_no_array_of_a_result_can_be_written_to():
    grid = unit_grid(1, 2, 2, 2)
    sections = reconstruct(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid), 1.0)
    focus = Segmented(np.ones((1, 2, 2), dtype=bool), "none", sections)
    depth = DepthMap(np.ones((2, 2)), np.ones((2, 2)))
    truth = Truth(np.ones((2, 2)), np.zeros((2, 2), dtype=int), {})
    views = Views(np.ones((*grid.shape_KLHW, 1)), grid)
    arrays = (sections.counts, sections.coverage, sections.estimate, sections.z_mm, focus.in_focus)
    more = (depth.z_mm, depth.confidence, truth.z_mm, truth.object_id, views.radiance)
    assert not any(np.asarray(a).flags.writeable for a in (*arrays, *more))


# Views


@pytest.mark.parametrize("shape", [(2, 2, 3, 3), (2, 2, 3, 3, 2), (2, 2, 3, 4, 3), (1, 2, 3, 3, 3)])
def test_views_of_another_shape_are_refused(shape):
    with pytest.raises(InputError, match=r"^radiance: expected shape"):
        Views(np.zeros(shape), unit_grid(2, 2, 3, 3))


def test_a_mosaic_of_three_channels_is_refused():
    with pytest.raises(InputError, match=r"^radiance: a Bayer mosaic has one channel"):
        Views(np.zeros((1, 1, 2, 2, 3)), unit_grid(1, 1, 2, 2), cfa="GRBG")


def test_views_that_are_no_numbers_are_refused():
    with pytest.raises(InputError, match=r"^radiance: expected real numbers"):
        Views(np.zeros((1, 1, 2, 2, 1), dtype=complex), unit_grid(1, 1, 2, 2))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_view_with_nan_or_infinity_is_refused_by_its_place(bad):
    radiance = np.zeros((2, 2, 3, 3, 1))
    radiance[1, 0, 2, 2] = bad
    views = Views(radiance, unit_grid(2, 2, 3, 3))
    np.testing.assert_array_equal(views.view(0, 1), np.zeros((3, 3, 1)))
    with pytest.raises(InputError, match=r"view \(1, 0\) holds NaN or infinity"):
        reconstruct(views, 1.0)


# Results


def test_sections_of_another_shape_are_refused():
    grid = unit_grid(1, 1, 2, 2)
    good = np.zeros((1, 2, 2, 1))
    with pytest.raises(InputError, match=r"^counts: "):
        Sections(FocalPlanes.at_depths(grid, np.ones(2)), good, good)
    with pytest.raises(InputError, match=r"^coverage: "):
        Sections(FocalPlanes.at_depths(grid, np.ones(1)), good, good[..., 0])


def test_masks_that_do_not_fit_their_sections_are_refused():
    grid = unit_grid(1, 1, 2, 2)
    sections = Sections(
        FocalPlanes.at_depths(grid, np.ones(1)), np.zeros((1, 2, 2, 1)), np.zeros((1, 2, 2, 1))
    )
    for bad in (np.zeros((1, 2, 2)), np.zeros((2, 2, 2), dtype=bool)):
        with pytest.raises(InputError, match=r"^in_focus: expected bool"):
            Segmented(bad, "none", sections)


def test_photons_in_focus_must_be_bool_with_a_row_per_plane():
    grid = unit_grid(1, 1, 2, 2)
    sections = Sections(
        FocalPlanes.at_depths(grid, np.ones(1)), np.zeros((1, 2, 2, 1)), np.zeros((1, 2, 2, 1))
    )
    masks = np.zeros((1, 2, 2), dtype=bool)
    for bad in (np.zeros((1, 5)), np.zeros((2, 5), dtype=bool), np.zeros(5, dtype=bool)):
        with pytest.raises(InputError, match=r"^photon_in_focus: expected bool \(1, events\)"):
            Segmented(masks, "none", sections, photon_in_focus=bad)
    kept = Segmented(masks, "none", sections, photon_in_focus=np.ones((1, 5), dtype=bool))
    assert kept.photon_in_focus is not None
    assert not kept.photon_in_focus.flags.writeable


def test_cleaned_keeps_what_is_in_focus_and_zeroes_the_rest():
    grid = unit_grid(1, 1, 1, 2)
    sections = Sections(
        FocalPlanes.at_depths(grid, np.ones(1)), np.array([[[[6], [8]]]]), np.full((1, 1, 2, 1), 2)
    )
    focus = Segmented(np.array([[[True, False]]]), "none", sections)
    np.testing.assert_array_equal(focus.cleaned, [[[[3.0], [0.0]]]])


def test_a_depth_map_needs_a_confidence_of_its_shape():
    with pytest.raises(InputError, match=r"^z_mm, confidence: "):
        DepthMap(np.ones((2, 2)), np.ones((2, 3)))


def test_truth_has_infinity_for_a_miss_but_no_nan():
    ids = np.zeros((1, 2), dtype=int)
    Truth(np.array([[1.0, np.inf]]), ids, {})
    with pytest.raises(InputError, match=r"^z_mm: true depths are above 0 mm and never NaN"):
        Truth(np.array([[1.0, np.nan]]), ids, {})


def test_every_object_of_the_truth_has_a_name():
    with pytest.raises(InputError, match=r"^object_id: id 2 has no name"):
        Truth(np.ones((1, 3)), np.array([[0, 1, 2]]), {1: "ball"})


def test_more_maps_of_the_truth_are_checked_and_read_only():
    z, ids = np.ones((2, 3)), np.zeros((2, 3), dtype=int)
    maps: dict[str, Any] = {
        "normal": np.zeros((2, 3, 3), dtype=np.float32),
        "coverage": np.ones((2, 3), dtype=np.float32),
        "visible_views": np.full((2, 3), 100, dtype=np.uint16),
    }
    truth = Truth(z, ids, {}, **maps)
    for name, values in maps.items():
        assert not getattr(truth, name).flags.writeable
        with pytest.raises(InputError, match=rf"^{name}: expected {values.dtype} \(2, 3"):
            Truth(z, ids, {}, **{name: values[:1]})
        with pytest.raises(InputError, match=rf"^{name}: expected {values.dtype}"):
            Truth(z, ids, {}, **{name: values.astype(np.float64)})
    for name, worst in (("coverage", 1.1), ("coverage", np.nan), ("normal", -2.0)):
        with pytest.raises(InputError, match=rf"^{name}: expected values from"):
            Truth(z, ids, {}, **{name: np.full_like(maps[name], worst)})


def test_a_score_keeps_the_spelling_of_its_file():
    score = Score(planes=({"iou": 1.0},), objects=(), depth={"mae_mm": None}, dataset="x")
    assert score.to_dict() == {
        "dataset": "x",
        "planes": [{"iou": 1.0}],
        "objects": [],
        "depth": {"mae_mm": None},
        "bounds": {},
        "readout": None,
    }


def test_things_of_another_kind_are_refused_by_name():
    grid = unit_grid(1, 2, 4, 4)
    counts = np.ones(grid.shape_KLHW, dtype=int)
    with pytest.raises(InputError, match="grid: expected a CameraGrid, got dict"):
        PhotonCounts.from_dense(counts, {"rows": 1})  # type: ignore[arg-type]
    with pytest.raises(
        InputError, match=r"data: expected PhotonCounts or Views .*\.counts or \.views\), got ndarray"
    ):
        reconstruct(counts, [1.0])  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"counts: expected PhotonCounts .*\.counts\), got ndarray"):
        segment(counts, [1.0])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="above 0 mm and never NaN"):
        Truth(np.zeros((2, 2)), np.zeros((2, 2), dtype=int), {})
