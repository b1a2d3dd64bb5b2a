"""Geometry of parallel cameras: the image of a point, disparity and depth.

Notation: d disparity in px per camera step; (k, l) camera; (K, L) grid; z planar depth; s shear.
A point (X, Y, Z) appears in camera (k, l) at column (W-1)/2 + (l - (L-1)/2) s + (focal / pixel)
(X - X_l) / Z and likewise in rows, so without shear a camera further right sees it further LEFT.
"""

import numpy as np

from pcii.types.camera_grid import CameraGrid


def project_px(
    grid: CameraGrid, point_mm: tuple[float, float, float], k: float, l: float
) -> tuple[float, float]:
    """(row, column) of the image of the point (X, Y, Z) in camera (k, l), pixel centres at integers.

    The virtual centre is the camera ((K-1)/2, (L-1)/2).
    """
    X, Y, Z = point_mm
    down, right = k - (grid.rows - 1) / 2, l - (grid.cols - 1) / 2
    scale_px = grid.focal_mm / grid.pixel_mm / Z
    i = (grid.height - 1) / 2 + down * grid.shear_px[1] + scale_px * (Y - down * grid.pitch_mm[1])
    j = (grid.width - 1) / 2 + right * grid.shear_px[0] + scale_px * (X - right * grid.pitch_mm[0])
    return i, j


def parallax_px(grid: CameraGrid, z_mm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """(horizontal, vertical) disparity at depth z due to the camera pitch alone, in px per camera step."""
    # Lengths whose product no float64 holds give 0, infinity or NaN; `FocalPlanes` refuses the last two.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        scale_mm2 = np.asarray(z_mm, dtype=np.float64) * grid.pixel_mm
        return grid.focal_mm * grid.pitch_mm[0] / scale_mm2, grid.focal_mm * grid.pitch_mm[1] / scale_mm2


def disparity_px(grid: CameraGrid, z_mm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """(horizontal, vertical) disparity at depth z in px per camera step: parallax less shear."""
    across, down = parallax_px(grid, z_mm)
    return across - grid.shear_px[0], down - grid.shear_px[1]


def total_disparity_px(grid: CameraGrid, z_mm: np.ndarray | float) -> np.ndarray:
    """Parallax between the outermost cameras of the longer axis of the grid in px: (N - 1) d, without shear.

    >>> grid = CameraGrid(
    ...     rows=1, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=4, width=4
    ... )
    >>> total_disparity_px(grid, np.array([500.0, 1000.0])).tolist()
    [20.0, 10.0]
    """
    d_x, d_y = parallax_px(grid, z_mm)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.maximum((grid.cols - 1) * d_x, (grid.rows - 1) * d_y)


def parallax_per_total(grid: CameraGrid) -> np.ndarray:
    """(horizontal, vertical) parallax from camera to camera as a share of the total disparity, (2,)."""
    return np.array(parallax_px(grid, 1.0)) / total_disparity_px(grid, 1.0)


def blur_half_extent_px(grid: CameraGrid, z_mm: np.ndarray | float, z0_mm: float) -> np.ndarray:
    """Half-extent in px of the blur of a point at z in the section at z0: total disparity's change / 2."""
    return np.abs(total_disparity_px(grid, z_mm) - total_disparity_px(grid, z0_mm)) / 2


def depth_of_total_disparity_mm(grid: CameraGrid, total_px: np.ndarray) -> np.ndarray:
    """Depths in mm whose total disparity is `total_px`: the inverse of `total_disparity_px`."""
    return float(total_disparity_px(grid, 1.0)) / np.asarray(total_px, dtype=np.float64)
