"""The coarse grid on which evidence of focus is kept."""

import numpy as np

CELL_PX = 4
"""Cells of 4 x 4 pixels: the windows over which evidence is summed are larger."""
BLOCK_PX = 2
"""Voxels of 2 x 2 pixels, each of which every Bayer colour covers equally for any shifts.

Single pixels are not covered equally: at depths where all shifts are even a colour falls on every fourth
voxel only, each of which holds four times as many photons, and textured regions would be assigned such
depths."""


def in_cells(shifts_px: np.ndarray) -> np.ndarray:
    """Shifts in px (...), rounded to whole cells, int64.

    >>> in_cells(np.array([-6.0, 1.0, 2.0, 9.0])).tolist()
    [-1, 0, 1, 2]
    """
    return np.floor(shifts_px / CELL_PX + 0.5).astype(np.int64)
