import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from twins import paper_grid, unit_grid, voxel_of

from pcii.base.errors import InputError
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes, planes_at
from pcii.types.geometry import disparity_px, project_px

depths = st.floats(200, 5000)


def whole_shifts(grid: CameraGrid, z_mm: float) -> list[np.ndarray]:
    return [shifts[0] for shifts in FocalPlanes.at_depths(grid, z_mm).whole_shifts_px]


def test_half_pixel_shifts_round_up_and_do_not_alternate():
    rows, cols = whole_shifts(unit_grid(5, 4, 8, 8, pitch_mm=(1.0, 0.5)), 1.0)
    np.testing.assert_array_equal(rows, [-1, 0, 0, 1, 1])  # of -1, -1/2, 0, 1/2, 1
    np.testing.assert_array_equal(cols, [-1, 0, 1, 2])  # of -3/2, -1/2, 1/2, 3/2
    # Rounding half to even, the fault that this is about, would give other shifts in both axes.
    assert not np.array_equal(rows, np.round([-1, -0.5, 0, 0.5, 1]))
    assert not np.array_equal(cols, np.round([-1.5, -0.5, 0.5, 1.5]))


@given(grid=grids, z=depths)
@at_least(100)
def test_shifts_are_the_nearest_whole_pixels(grid, z):
    for shifts, cameras, disparity in zip(
        whole_shifts(grid, z), (grid.rows, grid.cols), reversed(disparity_px(grid, z)), strict=True
    ):
        exact = (np.arange(cameras) - (cameras - 1) / 2) * disparity
        error = shifts - exact
        # 1e-9: the sum x + 1/2 rounds at 1e-13 of shifts below 1000 px.
        assert np.all((error > -0.5 - 1e-9) & (error <= 0.5 + 1e-9))


@given(grid=grids, z=st.sampled_from([250.0, 540.0, 620.0]), subpixel=st.integers(1, 3))
@at_least(100)
def test_voxel_indices_follow_the_contracts_formula(grid, z, subpixel):
    d_x, d_y = (float(d) for d in disparity_px(grid, z))
    rows, cols = (index[0] for index in FocalPlanes.at_depths(grid, z).voxel_indices(subpixel))
    K, L, H, W = grid.shape_KLHW

    def beside_is_clipped(voxel: int, size: int) -> int:
        return min(max(voxel, -1), size * subpixel)

    assert rows.tolist() == [
        [beside_is_clipped(voxel_of(i, k, K, d_y, subpixel), H) for i in range(H)] for k in range(K)
    ]
    assert cols.tolist() == [
        [beside_is_clipped(voxel_of(j, l, L, d_x, subpixel), W) for j in range(W)] for l in range(L)
    ]


@pytest.mark.parametrize(("rows", "cols"), [(3, 3), (4, 2), (1, 5)])
def test_where_a_camera_sees_a_point_is_sent_to_where_the_centre_sees_it(rows, cols):
    grid = unit_grid(rows, cols, 41, 41, pitch_mm=(4.0, 2.0))
    point = (3.0, -2.0, 1.0)  # whole pixels in every camera: pitch / 2 is whole
    row_of, col_of = (index[0] for index in FocalPlanes.at_depths(grid, 1.0).voxel_indices())
    for k in range(rows):
        for l in range(cols):
            i, j = project_px(grid, point, k, l)
            assert (row_of[k, round(i)], col_of[l, round(j)]) == (20 - 2, 20 + 3)


@given(near=st.floats(100, 900), extra=st.floats(1, 900), step=st.floats(0.5, 20))
@at_least(100)
def test_planes_run_from_far_to_near_in_equal_steps_of_total_disparity(near, extra, step):
    planes = FocalPlanes.between(paper_grid(), near, near + extra, step)
    steps = np.diff(planes.total_disparity_px)
    # Total disparities are below 700 px; two divisions round at 1e-13 of that each.
    np.testing.assert_allclose(planes.z_mm[[-1, 0]], [near, near + extra], rtol=1e-13)
    np.testing.assert_allclose(steps, steps.mean(), atol=1e-9)
    assert np.all(np.diff(planes.z_mm) < 0)
    assert steps.max() <= step + 1e-9


@given(grid=grids, z=depths)
@at_least(100)
def test_planes_of_a_total_disparity_are_those_of_its_depth(grid, z):
    planes = FocalPlanes.at_depths(grid, z)
    if planes.total_disparity_px[0] > 0:
        again = FocalPlanes.at_total_disparity(grid, planes.total_disparity_px)
        np.testing.assert_allclose(again.z_mm, planes.z_mm, rtol=1e-14)  # two divisions
        for repeated, expected in zip(again.exact_shifts_px, planes.exact_shifts_px, strict=True):
            np.testing.assert_allclose(repeated, expected, atol=1e-9)


def test_planes_are_taken_and_followed_by_others_in_the_order_asked_for():
    planes = FocalPlanes.at_depths(unit_grid(1, 5, 8, 8), [1.0, 2.0, 4.0])  # total disparities 4, 2, 1
    np.testing.assert_array_equal(planes.take([2, 0]).z_mm, [4.0, 1.0])
    more = planes.take([2, 0]).followed_by([8.0])
    np.testing.assert_array_equal(more.z_mm, [4.0, 1.0, 0.5])
    np.testing.assert_array_equal(more.total_disparity_px, [1.0, 4.0, 8.0])
    assert len(planes.followed_by([])) == 3


def test_a_plane_whose_shifts_no_integer_holds_is_refused():
    with pytest.raises(InputError, match="z_mm: 1e-09 mm is so near"):
        FocalPlanes.at_depths(paper_grid(), [540.0, 1e-9])


def test_indices_far_outside_a_section_of_fine_voxels_do_not_overflow():
    # Shifts of 1.6e9 px at the outer cameras: four subpixels of each exceed 32 bits.
    grid = unit_grid(1, 3, 4, 4)
    rows, cols = FocalPlanes.at_depths(grid, 1 / 1.4e9 * 2).voxel_indices(4)
    assert ((cols[0, [0, 2]] < 0) | (cols[0, [0, 2]] >= 16)).all()
    assert (cols[0, 1] >= 0).all()
    assert (rows >= 0).all()


def test_planes_of_another_grid_are_refused():
    planes = FocalPlanes.at_depths(unit_grid(2, 2, 4, 4), 1.0)
    assert planes_at(planes.grid, planes) is planes
    with pytest.raises(InputError, match="another camera grid"):
        planes_at(unit_grid(2, 2, 4, 5), planes)
