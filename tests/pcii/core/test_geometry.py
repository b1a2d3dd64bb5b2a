import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from twins import paper_grid, unit_grid, voxel_of

from pcii.core.camera_grid import CameraGrid
from pcii.core.geometry import (
    blur_half_extent_px,
    camera_position_mm,
    depths_of_equal_disparity_steps_mm,
    disparity_px,
    nearest_shifts_px,
    project_px,
    target_indices,
    total_disparity_px,
)

grids = st.builds(
    CameraGrid,
    rows=st.integers(1, 6),
    cols=st.integers(1, 6),
    pitch_mm=st.tuples(st.floats(0.5, 10), st.floats(0.5, 10)),
    focal_mm=st.floats(10, 100),
    pixel_mm=st.floats(0.01, 0.1),
    height=st.integers(1, 9),
    width=st.integers(1, 9),
    shear_px=st.tuples(st.sampled_from([0.0, 1.5, -7.25]), st.sampled_from([0.0, 3.0, -0.5])),
)
depths = st.floats(200, 5000)


def test_a_camera_further_right_sees_a_point_further_left():
    grid = unit_grid(3, 3, 9, 9, pitch_mm=(2.0, 1.0))
    columns = [project_px(grid, (0, 0, 1), 1, l)[1] for l in range(3)]
    assert columns == [6.0, 4.0, 2.0]  # X_l = -2, 0, 2


def test_a_camera_further_down_sees_a_point_further_up():
    grid = unit_grid(3, 3, 9, 9, pitch_mm=(2.0, 1.0))
    rows = [project_px(grid, (0, 0, 1), k, 1)[0] for k in range(3)]
    assert rows == [5.0, 4.0, 3.0]  # Y_k = -1, 0, 1


def test_right_and_down_in_the_world_are_right_and_down_in_the_image():
    grid = unit_grid(1, 1, 9, 11)
    assert project_px(grid, (1, 2, 2), 0, 0) == (4 + 1.0, 5 + 0.5)


def test_the_row_of_a_camera_does_not_depend_on_its_column():
    grid = unit_grid(3, 3, 9, 9, pitch_mm=(2.0, 1.0))
    assert {project_px(grid, (3, 1, 2), 0, l)[0] for l in range(3)} == {4 + (1 + 1) / 2}


@pytest.mark.parametrize(
    ("size", "axis_px"), [((4, 6), (1.5, 2.5)), ((5, 7), (2.0, 3.0)), ((1, 1), (0.0, 0.0))]
)
def test_the_optical_axis_meets_the_middle_of_even_and_odd_images(size, axis_px):
    grid = unit_grid(1, 1, *size)
    assert project_px(grid, (0, 0, 7), 0, 0) == axis_px


def test_the_virtual_centre_of_an_odd_grid_is_its_middle_camera():
    assert camera_position_mm(unit_grid(3, 5, 1, 1, pitch_mm=(2.0, 4.0)), 1, 2) == (0.0, 0.0)


def test_the_virtual_centre_of_an_even_grid_is_between_cameras():
    grid = unit_grid(2, 4, 1, 1, pitch_mm=(2.0, 4.0))
    assert camera_position_mm(grid, 0.5, 1.5) == (0.0, 0.0)
    assert camera_position_mm(grid, 0, 1) == (-1.0, -2.0)
    assert camera_position_mm(grid, 1, 3) == (3.0, 2.0)


@given(grid=grids, z=depths)
@settings(max_examples=100, deadline=None)
def test_disparity_is_the_step_between_neighbouring_cameras(grid, z):
    i0, j0 = project_px(grid, (0, 0, z), 0, 0)
    i1, j1 = project_px(grid, (0, 0, z), 1, 1)
    d_x, d_y = disparity_px(grid, z)
    # Positions are below 3000 px here, and a handful of roundings of 2^-53 relative is 2e-12 px.
    assert j0 - j1 == pytest.approx(float(d_x), abs=5e-12)
    assert i0 - i1 == pytest.approx(float(d_y), abs=5e-12)


def test_disparity_is_focal_times_pitch_over_depth_times_pixel():
    d_x, d_y = disparity_px(unit_grid(2, 2, 1, 1, pitch_mm=(6.0, 3.0)), np.array([1.0, 2.0, 4.0]))
    np.testing.assert_array_equal(d_x, [6.0, 3.0, 1.5])
    np.testing.assert_array_equal(d_y, [3.0, 1.5, 0.75])


def test_disparity_of_the_papers_objects():
    d_x, _ = disparity_px(paper_grid(), np.array([540.0, 620.0]))
    # 50 x 5 / (z x 0.0352) by hand, to the digits written.
    np.testing.assert_allclose(d_x, [13.1524, 11.4553], rtol=0, atol=5e-5)


def test_there_is_no_disparity_at_infinity():
    assert disparity_px(paper_grid(), np.inf) == (0.0, 0.0)


def test_half_pixel_shifts_round_up_and_do_not_alternate():
    rows, cols = nearest_shifts_px(unit_grid(5, 4, 8, 8, pitch_mm=(1.0, 0.5)), 1.0)
    np.testing.assert_array_equal(rows, [-1, 0, 0, 1, 1])  # of -1, -1/2, 0, 1/2, 1
    np.testing.assert_array_equal(cols, [-1, 0, 1, 2])  # of -3/2, -1/2, 1/2, 3/2
    # Rounding half to even, the fault that this is about, would give other shifts in both axes.
    assert not np.array_equal(rows, np.round([-1, -0.5, 0, 0.5, 1]))
    assert not np.array_equal(cols, np.round([-1.5, -0.5, 0.5, 1.5]))


@given(grid=grids, z=depths)
@settings(max_examples=100, deadline=None)
def test_shifts_are_the_nearest_whole_pixels(grid, z):
    for shifts, cameras, disparity in zip(
        nearest_shifts_px(grid, z), (grid.rows, grid.cols), reversed(disparity_px(grid, z)), strict=True
    ):
        exact = (np.arange(cameras) - (cameras - 1) / 2) * disparity
        error = shifts - exact
        # 1e-9: the sum x + 1/2 rounds at 1e-13 of shifts below 1000 px.
        assert np.all((error > -0.5 - 1e-9) & (error <= 0.5 + 1e-9))


@given(grid=grids, z=st.sampled_from([250.0, 540.0, 620.0]), subpixel=st.integers(1, 3))
@settings(max_examples=100, deadline=None)
def test_targets_follow_the_contracts_formula(grid, z, subpixel):
    d_x, d_y = (float(d) for d in disparity_px(grid, z))
    rows, cols = target_indices(grid, z, subpixel)
    K, L, H, W = grid.shape_KLHW
    assert rows.tolist() == [[voxel_of(i, k, K, d_y, subpixel) for i in range(H)] for k in range(K)]
    assert cols.tolist() == [[voxel_of(j, l, L, d_x, subpixel) for j in range(W)] for l in range(L)]


@pytest.mark.parametrize(("rows", "cols"), [(3, 3), (4, 2), (1, 5)])
def test_where_a_camera_sees_a_point_is_sent_to_where_the_centre_sees_it(rows, cols):
    grid = unit_grid(rows, cols, 41, 41, pitch_mm=(4.0, 2.0))
    point = (3.0, -2.0, 1.0)  # whole pixels in every camera: pitch / 2 is whole
    row_targets, col_targets = target_indices(grid, 1.0, 1)
    for k in range(rows):
        for l in range(cols):
            i, j = project_px(grid, point, k, l)
            assert (row_targets[k, round(i)], col_targets[l, round(j)]) == (20 - 2, 20 + 3)


def test_spread_is_taken_over_the_longer_axis():
    assert total_disparity_px(unit_grid(3, 5, 1, 1, pitch_mm=(2.0, 3.0)), 1.0) == 8.0  # 4 x 2 > 2 x 3
    assert total_disparity_px(unit_grid(4, 5, 1, 1, pitch_mm=(2.0, 3.0)), 1.0) == 9.0  # 3 x 3 > 4 x 2


def test_a_single_camera_has_no_spread():
    assert total_disparity_px(unit_grid(1, 1, 4, 4), 5.0) == 0.0


@given(grid=grids, z=depths, z0=depths)
@settings(max_examples=100, deadline=None)
def test_blur_is_half_of_where_the_cameras_scatter_a_point(grid, z, z0):
    extents = []
    shifts_at_z0 = disparity_px(grid, z0)
    for axis, (cameras, d0) in enumerate(zip((grid.cols, grid.rows), shifts_at_z0, strict=True)):
        seen = [project_px(grid, (0, 0, z), n, n)[1 - axis] for n in range(cameras)]
        placed = [p + (n - (cameras - 1) / 2) * float(d0) for n, p in enumerate(seen)]
        extents.append((max(placed) - min(placed)) / 2)
    # Positions up to 1e4 px, each rounded at 2^-53 relative: 1e-11 px with room to spare.
    assert float(blur_half_extent_px(grid, z, z0)) == pytest.approx(max(extents), abs=1e-10)


def test_what_is_in_focus_has_no_blur():
    assert blur_half_extent_px(paper_grid(), 540.0, 540.0) == 0.0


@given(near=st.floats(100, 900), extra=st.floats(1, 900), step=st.floats(0.5, 20))
@settings(max_examples=100, deadline=None)
def test_depths_run_from_near_to_far_in_equal_steps_of_spread(near, extra, step):
    grid = paper_grid()
    z = depths_of_equal_disparity_steps_mm(grid, near, near + extra, step)
    steps = -np.diff(total_disparity_px(grid, z))
    # Spreads are below 700 px; two divisions round at 1e-13 of that each.
    np.testing.assert_allclose(z[[0, -1]], [near, near + extra], rtol=1e-13)
    np.testing.assert_allclose(steps, steps.mean(), atol=1e-9)
    assert np.all(np.diff(z) > 0)
    assert steps.max() <= step + 1e-9


def test_no_more_planes_than_the_step_asks_for():
    grid = unit_grid(1, 5, 8, 8)  # spread 4 / z
    z = depths_of_equal_disparity_steps_mm(grid, 1.0, 4.0, 1.0)
    np.testing.assert_allclose(z, [4 / 4, 4 / 3, 4 / 2, 4 / 1], rtol=1e-15)


def test_there_are_two_planes_even_if_the_step_is_coarse():
    z = depths_of_equal_disparity_steps_mm(paper_grid(), 540.0, 541.0, 1000.0)
    np.testing.assert_allclose(z, [540.0, 541.0], rtol=1e-13)  # two divisions


def test_a_step_of_spread_is_a_quadratic_step_of_depth():
    z = depths_of_equal_disparity_steps_mm(paper_grid(), 300.0, 1200.0, 0.05)
    slope = np.diff(z) / z[:-1] ** 2
    # dz = z^2 dd / (focal pitch (N-1) / pixel); second order is step / spread = 0.05 / 53.
    np.testing.assert_allclose(slope, slope[0], rtol=2 * 0.05 / 53)
    assert math.isclose(slope[0], 0.05 * 0.0352 / (50 * 5 * 9), rel_tol=1e-2)
