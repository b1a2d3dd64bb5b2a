"""Compiled: the cells of a section that events fall into, and how many views cover each block of pixels."""

import numpy as np

from pcii.base.compiled_loops import helper
from pcii.evidence.cells import CELL_PX

BLOCK_PX = 2
"""Voxels of 2 x 2 pixels: whatever the shifts, each block is covered equally by each Bayer colour.

Single pixels are not. At depths where all shifts are even a colour falls on every fourth voxel only, where
photons have four times as many partners, and textured patches would be drawn to such depths.
"""


@helper
def _whole_blocks(shift: int, size: int) -> tuple[int, int]:
    """First and last row (or column) + 1 of the blocks that a shifted view covers as a whole.

    Blocks that it covers in part are left out: there it would bring more of one colour than of another.
    """
    first, last = max(0, shift), min(size, size + shift)
    return first + first % BLOCK_PX, last - last % BLOCK_PX


@helper
def views_of_blocks(shifts: np.ndarray, size: int, blocks: int) -> np.ndarray:
    """How many camera rows (or columns) see each block row (or column), (blocks,)."""
    seen = np.zeros(blocks)
    for camera in range(shifts.size):
        first, last = _whole_blocks(int(shifts[camera]), size)
        for place in range(first, last):
            seen[place // BLOCK_PX] += 1.0 / BLOCK_PX
    return seen


@helper
def cells_of_events(
    k: np.ndarray,
    l: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    size: tuple[int, int],
    cell: np.ndarray,
) -> None:
    """The `cell` (N,) that each event lands in, row by row; -1 outside the blocks that its view covers.

    Whole shifts `rows` (K,) and `cols` (L,); `size` of the film in px.
    """
    H, W = size
    across = -(-W // CELL_PX)
    for e in range(k.size):
        row, col = i[e] + rows[k[e]], j[e] + cols[l[e]]
        top, bottom = _whole_blocks(int(rows[k[e]]), H)
        left, right = _whole_blocks(int(cols[l[e]]), W)
        inside = top <= row < bottom and left <= col < right
        cell[e] = (row // CELL_PX) * across + col // CELL_PX if inside else -1
