"""Parallel-camera geometry: where a point appears, and how far a section shifts each view.

Notation: d disparity in px per camera step; (k, l) camera; (K, L) grid; z planar depth; s shear.
A point (X, Y, Z) appears in camera (k, l) at column (W-1)/2 + (l - (L-1)/2) s + (focal / pixel)
(X - X_l) / Z and likewise in rows, so without shear a camera further right sees it further LEFT.
"""

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.errors import InputError
from pcii.core.photon_counts import PhotonEvents
from pcii.core.truth import PhotonTruth


def camera_position_mm(grid: CameraGrid, k: float, l: float) -> tuple[float, float]:
    """(X, Y) of camera (k, l) in the plane Z = 0; the virtual centre is ((K-1)/2, (L-1)/2)."""
    x = (l - (grid.cols - 1) / 2) * grid.pitch_mm[0]
    y = (k - (grid.rows - 1) / 2) * grid.pitch_mm[1]
    return x, y


def project_px(
    grid: CameraGrid,
    point_mm: tuple[float, float, float],
    k: float,
    l: float,
) -> tuple[float, float]:
    """(row, column) at which camera (k, l) sees the point (X, Y, Z), pixel centres at integers."""
    X, Y, Z = point_mm
    x_camera, y_camera = camera_position_mm(grid, k, l)
    scale_px = grid.focal_mm / grid.pixel_mm
    i = (grid.height - 1) / 2 + (k - (grid.rows - 1) / 2) * grid.shear_px[1] + scale_px * (Y - y_camera) / Z
    j = (grid.width - 1) / 2 + (l - (grid.cols - 1) / 2) * grid.shear_px[0] + scale_px * (X - x_camera) / Z
    return i, j


def parallax_px(grid: CameraGrid, z_mm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """(horizontal, vertical) disparity at depth z that the cameras' distance makes, in px per camera step."""
    scale_mm2 = np.asarray(z_mm, dtype=np.float64) * grid.pixel_mm
    return grid.focal_mm * grid.pitch_mm[0] / scale_mm2, grid.focal_mm * grid.pitch_mm[1] / scale_mm2


def disparity_px(grid: CameraGrid, z_mm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """(horizontal, vertical) disparity at depth z in px per camera step: parallax less shear."""
    across, down = parallax_px(grid, z_mm)
    return across - grid.shear_px[0], down - grid.shear_px[1]


def _check_near(grid: CameraGrid, z_mm: float) -> tuple[float, float]:
    """The disparities at z, if shifts by them can be counted in whole pixels."""
    with np.errstate(over="ignore", divide="ignore"):
        d_x, d_y = disparity_px(grid, z_mm)
    if not max(abs(d_x) * grid.cols, abs(d_y) * grid.rows) < 2**31:
        raise InputError(f"z_mm: {z_mm:g} mm is so near that views shift by more than 2^31 pixels")
    return float(d_x), float(d_y)


def exact_shifts_px(grid: CameraGrid, z_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Shifts (rows (K,), columns (L,)), float64, that bring each view to the virtual centre.

    What camera row k sees in row i belongs to row i + (k - (K-1)/2) d, with a fraction in general.
    """
    d_x, d_y = _check_near(grid, z_mm)
    rows = (np.arange(grid.rows) - (grid.rows - 1) / 2) * d_y
    return rows, (np.arange(grid.cols) - (grid.cols - 1) / 2) * d_x


def nearest_shifts_px(grid: CameraGrid, z_mm: float, step_px: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """The same, int64, to the nearest multiple of `step_px`: floor(x + 1/2) for whole pixels.

    `floor(x + 1/2)` and not `round`, which rounds half to even and makes half-pixel shifts
    alternate.
    """
    rows, cols = (step_px * np.floor(shift / step_px + 0.5) for shift in exact_shifts_px(grid, z_mm))
    return rows.astype(np.int64), cols.astype(np.int64)


def target_indices(
    grid: CameraGrid, z_mm: float, subpixel: int, step_px: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Voxel rows (K, H) and columns (L, W), int64, to which each pixel of each camera belongs.

    With `subpixel` = 1 every camera moves by a multiple of `step_px` pixels; with M > 1 the centre of
    pixel i goes to fine row floor((i + 1/2 + (k - (K-1)/2) d) M). Indices outside the section are
    outside the voxel grid.
    """
    i, j = np.arange(grid.height), np.arange(grid.width)
    if subpixel == 1:
        row_shift, col_shift = nearest_shifts_px(grid, z_mm, step_px)
        return i + row_shift[:, None], j + col_shift[:, None]
    row_shift, col_shift = exact_shifts_px(grid, z_mm)
    rows = np.floor((i + 0.5 + row_shift[:, None]) * subpixel)
    cols = np.floor((j + 0.5 + col_shift[:, None]) * subpixel)
    return rows.astype(np.int64), cols.astype(np.int64)


def project_to_section(
    grid: CameraGrid, photons: PhotonEvents | PhotonTruth, z_mm: float, subpixel: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Voxel row and column (N,) of each photon in the section at z, and whether it is inside, bool."""
    rows, cols = target_indices(grid, z_mm, subpixel)
    row, col = rows[photons.k, photons.i], cols[photons.l, photons.j]
    H, W = grid.height * subpixel, grid.width * subpixel
    return row, col, (row >= 0) & (row < H) & (col >= 0) & (col < W)


def total_disparity_px(grid: CameraGrid, z_mm: np.ndarray | float) -> np.ndarray:
    """Total parallax over the longer axis of the grid in px, (N - 1) d: the scale of depth errors."""
    d_x, d_y = parallax_px(grid, z_mm)
    return np.maximum((grid.cols - 1) * d_x, (grid.rows - 1) * d_y)


def blur_half_extent_px(grid: CameraGrid, z_mm: np.ndarray | float, z0_mm: float) -> np.ndarray:
    """Half-extent in px of the blur that a point at z has in the section at z0."""
    spread = total_disparity_px(grid, z_mm) - total_disparity_px(grid, z0_mm)
    return np.abs(spread) / 2


def depth_of_total_disparity_mm(grid: CameraGrid, spread_px: np.ndarray) -> np.ndarray:
    """Depths in mm at which the total parallax over the longer axis of the grid is `spread_px`."""
    return float(total_disparity_px(grid, 1.0)) / np.asarray(spread_px, dtype=np.float64)


def whole_shifts_px(grid: CameraGrid, spread_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`nearest_shifts_px` at total spreads (Z,): rows (Z, K) and columns (Z, L), int32."""
    shifts = [nearest_shifts_px(grid, z) for z in depth_of_total_disparity_mm(grid, spread_px)]
    rows, cols = (np.stack(axis).astype(np.int32) for axis in zip(*shifts, strict=True))
    return rows, cols


def depths_of_equal_disparity_steps_mm(
    grid: CameraGrid, z_near_mm: float, z_far_mm: float, step_px: float
) -> np.ndarray:
    """Depths from near to far whose total disparity differs by at most `step_px` from one to the next.

    Depth resolution is uniform in disparity, so planes uniform in z would waste work far away.
    """
    near, far = total_disparity_px(grid, z_near_mm), total_disparity_px(grid, z_far_mm)
    count = max(2, int(np.ceil((near - far) / step_px)) + 1)
    return depth_of_total_disparity_mm(grid, np.linspace(near, far, count))
