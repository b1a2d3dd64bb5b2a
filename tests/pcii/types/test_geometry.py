import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from twins import paper_grid, unit_grid

from pcii.types.geometry import (
    blur_half_extent_px,
    camera_position_mm,
    disparity_px,
    project_px,
    total_disparity_px,
)

depths = st.floats(200, 5000)


def test_a_camera_further_right_or_down_sees_a_point_further_left_or_up():
    grid = unit_grid(3, 3, 9, 9, pitch_mm=(2.0, 1.0))
    rows = [project_px(grid, (0, 0, 1), k, 1)[0] for k in range(3)]
    assert rows == [5.0, 4.0, 3.0]  # Y_k = -1, 0, 1
    columns = [project_px(grid, (0, 0, 1), 1, l)[1] for l in range(3)]
    assert columns == [6.0, 4.0, 2.0]  # X_l = -2, 0, 2


def test_right_and_down_in_the_world_are_right_and_down_in_the_image():
    grid = unit_grid(1, 1, 9, 11)
    assert project_px(grid, (1, 2, 2), 0, 0) == (4 + 1.0, 5 + 0.5)


@pytest.mark.parametrize(
    ("size", "axis_px"), [((4, 6), (1.5, 2.5)), ((5, 7), (2.0, 3.0)), ((1, 1), (0.0, 0.0))]
)
def test_the_optical_axis_meets_the_middle_of_even_and_odd_images(size, axis_px):
    grid = unit_grid(1, 1, *size)
    assert project_px(grid, (0, 0, 7), 0, 0) == axis_px


def test_the_virtual_centre_of_an_even_grid_is_between_cameras():
    grid = unit_grid(2, 4, 1, 1, pitch_mm=(2.0, 4.0))
    assert camera_position_mm(grid, 0.5, 1.5) == (0.0, 0.0)
    assert camera_position_mm(grid, 0, 1) == (-1.0, -2.0)
    assert camera_position_mm(grid, 1, 3) == (3.0, 2.0)


@given(grid=grids, z=depths)
@at_least(100)
def test_disparity_is_the_step_between_neighbouring_cameras(grid, z):
    i0, j0 = project_px(grid, (0, 0, z), 0, 0)
    i1, j1 = project_px(grid, (0, 0, z), 1, 1)
    d_x, d_y = disparity_px(grid, z)
    # Positions are below 3000 px here, and a handful of roundings of 2^-53 relative is 2e-12 px.
    assert j0 - j1 == pytest.approx(float(d_x), abs=5e-12)
    assert i0 - i1 == pytest.approx(float(d_y), abs=5e-12)


def test_disparity_of_the_papers_objects():
    d_x, _ = disparity_px(paper_grid(), np.array([540.0, 620.0]))
    # 50 x 5 / (z x 0.0352) by hand, to the digits written.
    np.testing.assert_allclose(d_x, [13.1524, 11.4553], rtol=0, atol=5e-5)


def test_total_disparity_is_taken_over_the_longer_axis():
    assert total_disparity_px(unit_grid(3, 5, 1, 1, pitch_mm=(2.0, 3.0)), 1.0) == 8.0  # 4 x 2 > 2 x 3
    assert total_disparity_px(unit_grid(4, 5, 1, 1, pitch_mm=(2.0, 3.0)), 1.0) == 9.0  # 3 x 3 > 4 x 2


@given(grid=grids, z=depths, z0=depths)
@at_least(100)
def test_blur_is_half_of_where_the_cameras_scatter_a_point(grid, z, z0):
    extents = []
    shifts_at_z0 = disparity_px(grid, z0)
    for axis, (cameras, d0) in enumerate(zip((grid.cols, grid.rows), shifts_at_z0, strict=True)):
        columns = [project_px(grid, (0, 0, z), n, n)[1 - axis] for n in range(cameras)]
        placed = [p + (n - (cameras - 1) / 2) * float(d0) for n, p in enumerate(columns)]
        extents.append((max(placed) - min(placed)) / 2)
    # Positions up to 1e4 px, each rounded at 2^-53 relative: 1e-11 px with room to spare.
    assert float(blur_half_extent_px(grid, z, z0)) == pytest.approx(max(extents), abs=1e-10)
