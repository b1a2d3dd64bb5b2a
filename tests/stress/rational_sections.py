"""Sections by whole numbers and fractions, without any rounding: what floating point is compared with."""

from fractions import Fraction

import numpy as np
from twins import colour_of, voxel_of

from pcii.core.camera_grid import CameraGrid

Voxel = tuple[int, int, int]


def samples_of(
    values: np.ndarray, grid: CameraGrid, z_mm: float, *, cfa: str | None = None, subpixel: int = 1
) -> dict[Voxel, list[Fraction]]:
    """The samples that meet at each (row, column, colour) of views (K, L, H, W, C); for `unit_grid`."""
    K, L, H, W, C = values.shape
    meeting: dict[Voxel, list[Fraction]] = {}
    for k, l, i, j in np.ndindex(K, L, H, W):
        row = voxel_of(i, k, K, grid.pitch_mm[1] / z_mm, subpixel)
        col = voxel_of(j, l, L, grid.pitch_mm[0] / z_mm, subpixel)
        if 0 <= row < H * subpixel and 0 <= col < W * subpixel:
            for channel in range(C):
                colour = channel if cfa is None else colour_of(i, j, cfa)
                sample = values[k, l, i, j, channel].item()
                meeting.setdefault((row, col, colour), []).append(Fraction(sample))
    return meeting


def variance_of(samples: list[Fraction]) -> Fraction:
    """Unbiased variance; 0 below two samples."""
    if len(samples) < 2:
        return Fraction(0)
    mean = sum(samples, Fraction(0)) / len(samples)
    return sum(((sample - mean) ** 2 for sample in samples), Fraction(0)) / (len(samples) - 1)
