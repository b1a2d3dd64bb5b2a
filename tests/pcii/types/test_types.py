"""Bayer patterns, and what the central types refuse."""

from dataclasses import replace

import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st
from twins import colour_of, paper_grid, project_px, unit_grid, voxel_of

from pcii.base import InputError
from pcii.sections import reconstruct
from pcii.types import (
    PATTERNS,
    DepthMap,
    FocalPlanes,
    PhotonCounts,
    Sections,
    Segmented,
    Truth,
    Views,
    blur_half_extent_px,
    colour_cells,
    colour_index,
    disparity_px,
    mosaic,
)

NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        *(("rows", value, "at least 1") for value in (0, 2.0)),
        *(("focal_mm", value, "above 0 mm") for value in (0, NAN)),
        ("pitch_mm", 5.0, "above 0 mm"),
        ("shear_px", (1.0, NAN), "numbers"),
    ],
)
def test_a_camera_grid_that_cannot_be_is_refused_by_name(name, value, words):
    with pytest.raises(InputError, match=f"^{name}: .*{words}"):
        replace(unit_grid(2, 3, 4, 6), **{name: value})


FILM = unit_grid(1, 1, 2, 2)
ONES, IDS = np.ones((2, 2)), np.zeros((2, 2), dtype=int)
STACK, MASKS = np.zeros((1, 2, 2, 1)), np.zeros((1, 2, 2), dtype=bool)


def sections() -> Sections:
    return Sections(FocalPlanes.at_depths(FILM, 1.0), STACK, STACK)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Views(np.zeros((1, 1, 2, 3, 3)), FILM), "radiance: expected shape"),
        (lambda: Views(np.zeros((1, 1, 2, 2, 3)), FILM, cfa="GRBG"), "radiance: a Bayer mosaic has one"),
        (lambda: Views(np.ones((1, 1, 2, 2, 1), ">u2"), FILM), "radiance: .*sRGB"),
        (lambda: Sections(FocalPlanes.at_depths(FILM, [1.0, 2.0]), STACK, STACK), "counts: "),
        (lambda: Segmented(MASKS * 1.0, "none", sections()), "in_focus: expected bool"),
        (lambda: DepthMap(ONES, ONES[:1]), "confidence: expected real numbers "),
        (lambda: Truth(ONES * NAN, IDS, {}), "z_mm: true depths are above 0 mm and never NaN"),
        (lambda: Truth(ONES, IDS + 2, {1: "ball"}), "object_id: id 2 has no name"),
        (lambda: Truth(ONES, IDS, {}, coverage=ONES), r"coverage: expected float32 \(2, 2\)"),
        (lambda: PhotonCounts.from_dense(IDS, {"rows": 1}), "grid: expected a CameraGrid, got dict"),  # type: ignore[arg-type]
        (lambda: mosaic(np.zeros((4, 4, 4)), "GRBG"), "rgb: "),
        (lambda: colour_index(2, 2, "grbg"), f"cfa: .*'grbg'.* {', '.join(PATTERNS)}, or none"),
        (lambda: reconstruct(IDS, [1.0]), r"data: expected PhotonCounts or Views .*, got ndarray"),  # type: ignore[arg-type]
    ],
)
def test_what_does_not_fit_is_refused_by_name(make, words):
    with pytest.raises(InputError, match=f"^{words}"):
        make()


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


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_view_with_nan_or_infinity_is_refused_by_its_place(bad):
    radiance = np.zeros((2, 2, 3, 3, 1))
    radiance[1, 0, 2, 2] = bad
    views = Views(radiance, unit_grid(2, 2, 3, 3))
    np.testing.assert_array_equal(views.view(0, 1), np.zeros((3, 3, 1)))
    with pytest.raises(InputError, match=r"view \(1, 0\) holds NaN or infinity"):
        reconstruct(views, 1.0)


R, G, B = 0, 1, 2


@pytest.mark.parametrize(("cfa", "cells"), [("GRBG", [[G, R], [B, G]]), (None, [[0, 0], [0, 0]])])
def test_a_pattern_is_named_by_its_first_two_rows(cfa, cells):
    np.testing.assert_array_equal(colour_cells(cfa), cells)


@given(
    cfa=st.sampled_from(PATTERNS), height=st.integers(1, 7), width=st.integers(1, 7), seed=st.integers(0, 9)
)
def test_a_mosaic_keeps_the_colour_that_each_pixel_sees(cfa, height, width, seed):
    rgb = np.random.default_rng(seed).integers(0, 1000, size=(2, height, width, 3))
    raw, colours = mosaic(rgb, cfa), colour_index(height, width, cfa)
    for i, j in np.ndindex(height, width):
        assert colours[i, j] == colour_of(i, j, cfa)
        np.testing.assert_array_equal(raw[:, i, j], rgb[:, i, j, colour_of(i, j, cfa)])


depths = st.floats(200, 5000)


def test_where_cameras_see_a_point_by_hand():
    grid = unit_grid(3, 3, 9, 9, pitch_mm=(2.0, 1.0))
    # A camera further right or down sees a point further left or up; X_l = -2, 0, 2 and Y_k = -1, 0, 1.
    assert [project_px(grid, (0, 0, 1), k, 1)[0] for k in range(3)] == [5.0, 4.0, 3.0]
    assert [project_px(grid, (0, 0, 1), 1, l)[1] for l in range(3)] == [6.0, 4.0, 2.0]
    # Right and down in the world are right and down in the image, of even size too.
    assert project_px(unit_grid(1, 1, 9, 11), (1, 2, 2), 0, 0) == (4 + 1.0, 5 + 0.5)
    assert project_px(unit_grid(1, 1, 4, 6), (0, 0, 7), 0, 0) == (1.5, 2.5)
    # The virtual centre of an even grid is between cameras.
    assert project_px(unit_grid(2, 4, 5, 5, pitch_mm=(2.0, 4.0)), (0, 0, 7), 0.5, 1.5) == (2.0, 2.0)


@given(grid=grids, z=depths, z0=depths)
def test_disparity_and_blur_are_where_the_cameras_see_a_point(grid, z, z0):
    i0, j0 = project_px(grid, (0, 0, z), 0, 0)
    i1, j1 = project_px(grid, (0, 0, z), 1, 1)
    d_x, d_y = disparity_px(grid, z)
    # Positions are below 3000 px here, and a handful of roundings of 2^-53 relative is 2e-12 px.
    assert j0 - j1 == pytest.approx(float(d_x), abs=5e-12)
    assert i0 - i1 == pytest.approx(float(d_y), abs=5e-12)
    extents = []
    for axis, (cameras, d0) in enumerate(zip((grid.cols, grid.rows), disparity_px(grid, z0), strict=True)):
        columns = [project_px(grid, (0, 0, z), n, n)[1 - axis] for n in range(cameras)]
        placed = [p + (n - (cameras - 1) / 2) * float(d0) for n, p in enumerate(columns)]
        extents.append((max(placed) - min(placed)) / 2)
    # Positions up to 1e4 px, each rounded at 2^-53 relative: 1e-11 px with room to spare.
    assert float(blur_half_extent_px(grid, z, z0)) == pytest.approx(max(extents), abs=1e-10)


def test_half_pixel_shifts_round_up_and_do_not_alternate():
    grid = unit_grid(5, 4, 8, 8, pitch_mm=(1.0, 0.5))
    rows, cols = (shifts[0] for shifts in FocalPlanes.at_depths(grid, 1.0).nearest_shifts_px())
    np.testing.assert_array_equal(rows, [-1, 0, 0, 1, 1])  # of -1, -1/2, 0, 1/2, 1
    np.testing.assert_array_equal(cols, [-1, 0, 1, 2])  # of -3/2, -1/2, 1/2, 3/2


@given(grid=grids, z=st.sampled_from([250.0, 540.0, 620.0]), subpixel=st.integers(1, 3))
def test_voxel_indices_follow_the_contracts_formula(grid, z, subpixel):
    d_x, d_y = (float(d) for d in disparity_px(grid, z))
    rows, cols = (index[0] for index in FocalPlanes.at_depths(grid, z).voxel_indices(subpixel))
    K, L, H, W = grid.shape_KLHW
    for indices, cameras, size, disparity in ((rows, K, H, d_y), (cols, L, W, d_x)):
        expected = [
            [voxel_of(i, k, cameras, disparity, subpixel) for i in range(size)] for k in range(cameras)
        ]
        assert indices.tolist() == np.clip(expected, -1, size * subpixel).tolist()  # what is outside


@pytest.mark.parametrize(("rows", "cols"), [(3, 3), (4, 2), (1, 5)])
def test_where_a_camera_sees_a_point_is_sent_to_where_the_centre_sees_it(rows, cols):
    grid = unit_grid(rows, cols, 41, 41, pitch_mm=(4.0, 2.0))
    point = (3.0, -2.0, 1.0)  # whole pixels in every camera: pitch / 2 is whole
    row_of, col_of = (index[0] for index in FocalPlanes.at_depths(grid, 1.0).voxel_indices())
    for k, l in np.ndindex(rows, cols):
        i, j = project_px(grid, point, k, l)
        assert (row_of[k, round(i)], col_of[l, round(j)]) == (20 - 2, 20 + 3)


@given(near=st.floats(100, 900), extra=st.floats(1, 900), step=st.floats(0.5, 20))
def test_planes_run_from_far_to_near_in_equal_steps_of_total_disparity(near, extra, step):
    planes = FocalPlanes.between(paper_grid(), near, near + extra, step)
    steps = np.diff(planes.total_disparity_px)
    # Total disparities are below 700 px; two divisions round at 1e-13 of that each.
    np.testing.assert_allclose(planes.z_mm[[-1, 0]], [near, near + extra], rtol=1e-13)
    np.testing.assert_allclose(steps, steps.mean(), atol=1e-9)
    assert np.all(np.diff(planes.z_mm) < 0)
    assert steps.max() <= step + 1e-9
    again = FocalPlanes.at_total_disparity(planes.grid, planes.total_disparity_px)
    np.testing.assert_allclose(again.z_mm, planes.z_mm, rtol=1e-14)  # two divisions


@pytest.mark.parametrize("bad", [0, [540, -1], np.nan, [], "near", 1e-9])
def test_depths_that_cannot_be_are_refused(bad):
    with pytest.raises(InputError, match=r"^z_mm: "):
        FocalPlanes.at_depths(paper_grid(), bad)


def test_indices_far_outside_a_section_of_fine_voxels_do_not_overflow():
    # Shifts of 1.6e9 px at the outer cameras: four subpixels of each exceed 32 bits.
    rows, cols = FocalPlanes.at_depths(unit_grid(1, 3, 4, 4), 1 / 1.4e9 * 2).voxel_indices(4)
    assert ((cols[0, [0, 2]] < 0) | (cols[0, [0, 2]] >= 16)).all()
    assert (cols[0, 1] >= 0).all()
    assert (rows >= 0).all()
