"""The coarse grid on which evidence of focus is kept."""

import numpy as np

CELL_PX = 4
"""Cells of 4 x 4 pixels: the windows over which evidence is summed are larger."""


def in_cells(shifts_px: np.ndarray) -> np.ndarray:
    """Shifts in px (...) to the nearest whole cell, int64."""
    return np.floor(shifts_px / CELL_PX + 0.5).astype(np.int64)
