"""What a camera grid does to depth: disparities, whole-pixel shifts, and colours that meet.

From first principles and without `pcii.types.focal_planes`, like the cameras: what is checked before a
simulation must not share a mistake with what reconstructs it. Notation: d disparity in px per camera
step, (K, L) grid, (k, l) camera. A sample that camera row k sees in row i belongs to row
i + floor((k - (K-1)/2) d + 1/2) of a section.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pcii.types import CameraGrid, channel_count, colour_cells

MAX_PITCH_CHANGE = 0.25
"""Another pitch differs from the present one by at most this share."""
PITCH_STEPS = 500
MIN_PARITY_SHARE = 0.25
"""Another pitch gives each parity of shifts to at least this share of the camera rows, and of the columns."""


def disparities_px(grid: CameraGrid, z_mm: float) -> tuple[float, float]:
    """Disparity (x, y) of a point at depth z, in px per camera step."""
    per_mm = grid.focal_mm / (z_mm * grid.pixel_mm)
    return grid.pitch_mm[0] * per_mm - grid.shear_px[0], grid.pitch_mm[1] * per_mm - grid.shear_px[1]


def spread_px_mm(grid: CameraGrid) -> float:
    """Disparity between the outermost cameras of the longer axis, in px, times depth in mm."""
    steps = (grid.cols - 1) * grid.pitch_mm[0], (grid.rows - 1) * grid.pitch_mm[1]
    return max(steps) * grid.focal_mm / grid.pixel_mm


def apart_px(grid: CameraGrid, one_mm: float | np.ndarray, other_mm: float | np.ndarray) -> np.ndarray:
    """Width of the blur of a point at one depth in a section at the other: (N - 1) |d - d'|, in px."""
    return spread_px_mm(grid) * np.abs(np.divide(1, one_mm) - np.divide(1, other_mm))


def shifts_px(grid: CameraGrid, z_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Whole pixels (rows (K,), columns (L,)), int64, by which a section at z shifts each camera's image."""
    across_px, down_px = disparities_px(grid, z_mm)
    rows, cols = (np.arange(cameras) - (cameras - 1) / 2 for cameras in (grid.rows, grid.cols))
    down, across = np.floor(rows * down_px + 0.5), np.floor(cols * across_px + 0.5)
    return down.astype(np.int64), across.astype(np.int64)


def share_seen_by_all(grid: CameraGrid, z_mm: float) -> float:
    """Share of the section at z, of the centre's frame, that lies inside the image of every camera."""
    share = 1.0
    for size, shifts in zip((grid.height, grid.width), shifts_px(grid, z_mm), strict=True):
        first, last = max(0, shifts.max()), size + min(0, shifts.min())
        share *= max(0, last - first) / size
    return share


def shares_without(grid: CameraGrid, cfa: str | None, z_mm: float) -> np.ndarray:
    """Share of the voxels of the section at z that no sample of each colour reaches, (C,).

    What meets in a voxel depends on the parity of its row and column, away from the section's border, where
    every camera reaches: a camera adds the colour of the pixel that it was shifted from.
    """
    cells, samples = colour_cells(cfa), np.zeros((2, 2, channel_count(cfa)), dtype=np.int64)
    parities = [np.bincount(shift % 2, minlength=2) for shift in shifts_px(grid, z_mm)]
    for row, col, up, left in np.ndindex(2, 2, 2, 2):
        samples[row, col, cells[(row - up) % 2, (col - left) % 2]] += parities[0][up] * parities[1][left]
    return (samples == 0).mean(axis=(0, 1))


def mending_pitch_mm(grid: CameraGrid, depths_mm: Sequence[float]) -> tuple[float, float] | None:
    """The nearest pitch (x, y) at which even and odd shifts both occur often at all these depths.

    None if there is none within a quarter of the present one, as for a single row of cameras.
    """
    steps = np.linspace(0, MAX_PITCH_CHANGE, PITCH_STEPS + 1)
    for factor in (1 + sign * step for step in steps for sign in (1, -1)):
        # To what one would type: a hundredth of a millimetre, or finer where that is coarse.
        pitch = tuple(round(factor * old, 2) if old >= 1 else factor * old for old in grid.pitch_mm)
        changed = replace(grid, pitch_mm=pitch)
        parities = [shift % 2 for z in depths_mm for shift in shifts_px(changed, z)]
        least = [max(1, int(MIN_PARITY_SHARE * odd.size)) for odd in parities]
        if all(n <= odd.sum() <= odd.size - n for n, odd in zip(least, parities, strict=True)):
            return changed.pitch_mm
    return None
