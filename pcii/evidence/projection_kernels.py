"""Compiled: the cells of a section that events fall into."""

import numpy as np

from pcii.base.compiled_loops import compiled, helper
from pcii.evidence.cells import BLOCK_PX


@helper
def _whole_blocks(shift: int, size: int) -> tuple[int, int]:
    """First and last row (or column) + 1 of the blocks that a shifted view covers as a whole.

    Blocks covered in part are left out: one colour would have more samples in them than another.
    """
    first, last = max(0, shift), min(size, size + shift)
    return first + first % BLOCK_PX, last - last % BLOCK_PX


@compiled
def cells_of_events(
    k: np.ndarray,
    l: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    size: tuple[int, int],
    cell_px: int,
    cell: np.ndarray,
) -> None:
    """Writes to `cell` (N,) the flat index of the cell of each event, -1 outside its view's blocks.

    Events at pixels (`i`, `j`) of cameras (`k`, `l`); whole shifts `rows` (K,) and `cols` (L,) in px; `size`
    of the film, and `cell_px` of cells, in px.
    """
    H, W = size
    across = -(-W // cell_px)
    for e in range(k.size):
        row, col = i[e] + rows[k[e]], j[e] + cols[l[e]]
        top, bottom = _whole_blocks(int(rows[k[e]]), H)
        left, right = _whole_blocks(int(cols[l[e]]), W)
        inside = top <= row < bottom and left <= col < right
        cell[e] = (row // cell_px) * across + col // cell_px if inside else -1
