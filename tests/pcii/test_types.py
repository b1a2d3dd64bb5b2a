from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from twins import unit_grid

from pcii.errors import InputError
from pcii.reconstruct import reconstruct
from pcii.segment import segment
from pcii.types import (
    CameraGrid,
    DepthMap,
    PhotonCounts,
    Score,
    Sections,
    Segmented,
    Truth,
    Views,
    check_z_mm,
)

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


# Photon counts


def events_of(counts: PhotonCounts) -> list[tuple[int, ...]]:
    e = counts.events
    columns = (e.k.tolist(), e.l.tolist(), e.i.tolist(), e.j.tolist(), e.n.tolist())
    return list(zip(*columns, strict=True))


def test_events_are_sorted_repeats_added_and_zeros_dropped():
    rows = [(1, 0, 2, 3, 4), (0, 2, 0, 0, 1), (1, 0, 2, 3, 5), (0, 0, 1, 1, 0)]
    counts = PhotonCounts.from_events(*np.array(rows).T, unit_grid(2, 3, 4, 6))
    assert events_of(counts) == [(0, 2, 0, 0, 1), (1, 0, 2, 3, 9)]
    assert counts.total == 10


small_counts = st.builds(
    lambda seed, shape, rate: np.random.default_rng(seed).poisson(rate, size=shape),
    st.integers(0, 999),
    st.tuples(st.integers(1, 3), st.integers(1, 3), st.integers(1, 5), st.integers(1, 5)),
    st.sampled_from([0.0, 0.2, 3.0]),
)


@given(dense=small_counts, shuffle=st.integers(0, 99))
@settings(max_examples=100, deadline=None)
def test_dense_and_events_hold_the_same_counts_in_any_order(dense, shuffle):
    grid = unit_grid(*dense.shape)
    from_dense = PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    where = np.random.default_rng(shuffle).permutation(np.argwhere(dense))
    n = dense[tuple(where.T)]
    # Photons of a pixel told one by one are the same counts.
    single = np.repeat(where, n, axis=0)
    for rows, photons in ((where, n), (single, np.ones(len(single), dtype=int))):
        sparse = PhotonCounts.from_events(*rows.T, photons, grid, cfa="GRBG")
        assert events_of(sparse) == events_of(from_dense)
        assert sparse.total == from_dense.total == dense.sum()
        for k, l in np.ndindex(grid.rows, grid.cols):
            np.testing.assert_array_equal(sparse.view(k, l), dense[k, l])
            np.testing.assert_array_equal(from_dense.view(k, l), dense[k, l])


def test_no_events_is_a_valid_dark_exposure():
    counts = PhotonCounts.from_events(*np.zeros((5, 0), dtype=int), unit_grid(2, 2, 3, 3))
    assert counts.total == 0
    assert counts.is_sparse
    assert events_of(counts) == []
    np.testing.assert_array_equal(counts.view(1, 1), np.zeros((3, 3)))


@pytest.mark.parametrize("column", range(4))
def test_an_index_outside_the_grid_is_refused_by_name(column):
    grid = unit_grid(2, 3, 4, 5)
    for bad in (grid.shape_KLHW[column], -1):
        row = [0, 0, 0, 0, 1]
        row[column] = bad
        with pytest.raises(InputError, match=f"^{'klij'[column]}: "):
            PhotonCounts.from_events(*np.array([row]).T, grid)


@pytest.mark.parametrize("bad", [-1, 0.5, float("nan"), float("inf")])
def test_a_count_that_is_no_whole_number_is_refused(bad):
    grid = unit_grid(1, 1, 2, 2)
    with pytest.raises(InputError, match=r"^n: photon counts must"):
        PhotonCounts.from_events(*np.zeros((4, 1), dtype=int), np.array([bad]), grid)
    dense = np.zeros((1, 1, 2, 2))
    dense[0, 0, 1, 1] = bad
    with pytest.raises(InputError, match=r"^counts: photon counts must"):
        PhotonCounts.from_dense(dense, grid)


@pytest.mark.parametrize("dtype", [np.complex128, np.str_, object])
def test_counts_of_another_kind_are_refused(dtype):
    with pytest.raises(InputError, match=r"^counts: photon counts must be whole numbers"):
        PhotonCounts.from_dense(np.zeros((1, 1, 2, 2)).astype(dtype), unit_grid(1, 1, 2, 2))


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.int32, np.float32, np.float64])
def test_whole_numbers_of_any_dtype_are_counts(dtype):
    counts = PhotonCounts.from_dense(np.ones((1, 1, 2, 2), dtype=dtype), unit_grid(1, 1, 2, 2))
    assert counts.total == 4
    assert counts.events.n.dtype == np.int64


def test_a_narrow_dtype_does_not_wrap_in_the_total():
    dense = np.full((3, 3, 4, 4), 255, dtype=np.uint8)
    assert PhotonCounts.from_dense(dense, unit_grid(3, 3, 4, 4)).total == 255 * 144


def test_a_dense_stack_of_another_shape_is_refused():
    with pytest.raises(InputError, match=r"^counts: expected shape \(1, 1, 2, 2\)"):
        PhotonCounts.from_dense(np.zeros((1, 1, 2, 3), dtype=int), unit_grid(1, 1, 2, 2))


def test_event_lists_of_different_lengths_are_refused():
    column = np.zeros(2, dtype=int)
    with pytest.raises(InputError, match=r"same length"):
        PhotonCounts.from_events(column, column, column, column, np.ones(1, dtype=int), unit_grid(1, 1, 1, 1))


@pytest.mark.parametrize("bad", ["grbg", "XXXX"])
def test_counts_with_a_bad_pattern_are_refused(bad):
    with pytest.raises(InputError, match=r"^cfa: "):
        PhotonCounts.from_dense(np.zeros((1, 1, 2, 2), dtype=int), unit_grid(1, 1, 2, 2), cfa=bad)


# Read-only


def test_no_array_of_counts_can_be_written_to():
    grid = unit_grid(1, 2, 2, 2)
    dense = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid)
    sparse = PhotonCounts.from_events(*np.ones((5, 1), dtype=int) * 0, grid)
    columns = [getattr(c.events, name) for c in (dense, sparse) for name in "klijn"]
    assert not any(a.flags.writeable for a in (dense.view(0, 0), *columns))


def test_no_array_of_a_result_can_be_written_to():
    grid = unit_grid(1, 2, 2, 2)
    sections = reconstruct(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid), 1.0)
    focus = Segmented(np.ones(1), np.ones((1, 2, 2), dtype=bool), "none", sections)
    depth = DepthMap(np.ones((2, 2)), np.ones((2, 2)))
    truth = Truth(np.ones((2, 2)), np.zeros((2, 2), dtype=int), {})
    views = Views(np.ones((*grid.shape_KLHW, 1)), grid)
    arrays = (sections.counts, sections.coverage, sections.estimate, sections.z_mm, focus.in_focus)
    more = (depth.z_mm, depth.confidence, truth.z_mm, truth.object_id, views.radiance)
    assert not any(np.asarray(a).flags.writeable for a in (*arrays, *more))


def test_the_callers_array_stays_writable():
    dense = np.zeros((1, 1, 2, 2), dtype=int)
    PhotonCounts.from_dense(dense, unit_grid(1, 1, 2, 2))
    dense[:] = 1
    assert dense.flags.writeable


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
        Sections(grid, np.ones(2), good, good)
    with pytest.raises(InputError, match=r"^coverage: "):
        Sections(grid, np.ones(1), good, good[..., 0])


def test_masks_that_do_not_fit_their_sections_are_refused():
    grid = unit_grid(1, 1, 2, 2)
    sections = Sections(grid, np.ones(1), np.zeros((1, 2, 2, 1)), np.zeros((1, 2, 2, 1)))
    for bad in (np.zeros((1, 2, 2)), np.zeros((2, 2, 2), dtype=bool)):
        with pytest.raises(InputError, match=r"^in_focus: expected bool"):
            Segmented(np.ones(1), bad, "none", sections)


def test_cleaned_keeps_what_is_in_focus_and_zeroes_the_rest():
    grid = unit_grid(1, 1, 1, 2)
    sections = Sections(grid, np.ones(1), np.array([[[[6], [8]]]]), np.full((1, 1, 2, 1), 2))
    focus = Segmented(np.ones(1), np.array([[[True, False]]]), "none", sections)
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


def test_a_score_keeps_the_spelling_of_its_file():
    score = Score(planes=({"iou": 1.0},), objects=(), depth={"mae_mm": None}, dataset="x")
    assert score.to_dict() == {
        "dataset": "x",
        "planes": [{"iou": 1.0}],
        "objects": [],
        "depth": {"mae_mm": None},
    }


def test_things_of_another_kind_are_refused_by_name():
    grid = unit_grid(1, 2, 4, 4)
    counts = np.ones(grid.shape_KLHW, dtype=int)
    with pytest.raises(InputError, match="grid: expected a CameraGrid, got dict"):
        PhotonCounts.from_dense(counts, {"rows": 1})  # type: ignore[arg-type]
    with pytest.raises(InputError, match="data: expected PhotonCounts or Views, got ndarray"):
        reconstruct(counts, [1.0])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="counts: expected PhotonCounts, got ndarray"):
        segment(counts, [1.0])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="above 0 mm and never NaN"):
        Truth(np.zeros((2, 2)), np.zeros((2, 2), dtype=int), {})


@pytest.mark.parametrize("where", [(2, 0), (0, 3), (-1, 0)])
def test_a_camera_that_is_not_there_has_no_view(where):
    grid = unit_grid(2, 3, 4, 4)
    dense = PhotonCounts.from_dense(np.ones((2, 3, 4, 4), dtype=np.int64), grid, cfa=None)
    events = dense.events
    sparse = PhotonCounts.from_events(events.k, events.l, events.i, events.j, events.n, grid, cfa=None)
    for counts in (dense, sparse):
        with pytest.raises(InputError, match="no camera"):
            counts.view(*where)
