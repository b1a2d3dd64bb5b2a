"""Geometry of the cameras, and the planes in which they are focused."""

import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st
from twins import paper_grid, unit_grid, voxel_of

from pcii.base import InputError
from pcii.types import FocalPlanes, blur_half_extent_px, disparity_px, project_px

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
