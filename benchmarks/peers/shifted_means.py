"""Sections as means of shifted images (K, L, H, W), by SciPy, by OpenCV and by slices of NumPy arrays."""

from collections.abc import Iterator

import numpy as np

from pcii.types import CameraGrid, FocalPlanes, disparity_px


def by_scipy(images: np.ndarray, grid: CameraGrid, z_mm: float, order: int = 1) -> np.ndarray:
    """Mean of views shifted by splines of this order: 1 is bilinear."""
    from scipy.ndimage import shift

    mean = np.zeros(images.shape[2:4], dtype=np.float32)
    for (k, l), (down, right) in _moves(grid, z_mm):
        mean += shift(images[k, l], (down, right), order=order)
    return mean / grid.view_count


def by_opencv(images: np.ndarray, grid: CameraGrid, z_mm: float) -> np.ndarray:
    """Mean of bilinearly shifted views."""
    import cv2  # pyright: ignore[reportMissingImports]

    mean = np.zeros(images.shape[2:4], dtype=np.float32)
    size = images.shape[3], images.shape[2]
    for (k, l), (down, right) in _moves(grid, z_mm):
        move = np.array([[1, 0, right], [0, 1, down]], dtype=np.float32)
        cv2.accumulate(cv2.warpAffine(images[k, l], move, size, flags=cv2.INTER_LINEAR), mean)
    return mean / grid.view_count


def by_slices(images: np.ndarray, grid: CameraGrid, z_mm: float) -> np.ndarray:
    """Mean of views shifted by whole pixels, as slices."""
    H, W = images.shape[2:4]
    mean = np.zeros((H, W), dtype=np.float32)
    rows, cols = (shifts[0] for shifts in FocalPlanes.at_depths(grid, z_mm).nearest_shifts_px())
    for k, l in np.ndindex(grid.rows, grid.cols):
        r, c = int(rows[k]), int(cols[l])
        target = mean[max(r, 0) : H + min(r, 0), max(c, 0) : W + min(c, 0)]
        target += images[k, l, max(-r, 0) : H - max(r, 0), max(-c, 0) : W - max(c, 0)]
    return mean / grid.view_count


def _moves(grid: CameraGrid, z_mm: float) -> Iterator[tuple[tuple[int, int], tuple[float, float]]]:
    """Each camera, and how far down and right its view moves."""
    d_x, d_y = (float(d) for d in disparity_px(grid, z_mm))
    for k, l in np.ndindex(grid.rows, grid.cols):
        yield (k, l), ((k - (grid.rows - 1) / 2) * d_y, (l - (grid.cols - 1) / 2) * d_x)
