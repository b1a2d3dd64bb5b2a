"""Whole-pixel moves of whole images: by how much each view moves, in what order.

The arguments of the compiled loops of `dense_kernels`, made without importing the compiler.
"""

from typing import NamedTuple

import numpy as np

from pcii.core.bayer import colour_cells
from pcii.core.camera_grid import CameraGrid
from pcii.core.section_stack import Shifts


class Moves(NamedTuple):
    """Images in the order in which they are added, (M,) each, group after group; group g ends at `ends[g]`.

    Move m adds image `source[m]`, moved by `row_shift[m]` rows and `col_shift[m]` columns times channels.
    """

    source: np.ndarray
    row_shift: np.ndarray
    col_shift: np.ndarray
    ends: np.ndarray


class Groups(NamedTuple):
    """Samples that the groups of images contain.

    Group 2 p + q of a mosaic are the views whose row and column shifts have the parities p and q, so that
    all of its samples at a voxel have one colour. `by_row` (2, H) and `by_col` (2, W) are how many rows and
    columns of cameras with an even and an odd shift reach the voxel; `phases` (4, 2) are the Bayer cells of
    red, blue and twice green, empty where every pixel holds all colours and there is one group.
    """

    by_row: np.ndarray
    by_col: np.ndarray
    phases: np.ndarray


def step_px(shifts: Shifts) -> int:
    """The number of pixels of which whole shifts are multiples."""
    return 2 if shifts == "even" else 1


def moves_of(
    row_px: np.ndarray, col_px: np.ndarray, views: np.ndarray, channels: int, is_mosaic: bool
) -> Moves:
    """The moves of these views (V,), of which rows (K,) and columns (L,) of cameras move by whole pixels.

    Images are numbered as `views` lists them.
    """
    down, right = row_px[views // col_px.size], col_px[views % col_px.size]
    group = 2 * (down % 2) + right % 2 if is_mosaic else np.zeros_like(down)
    # The images that move least cover most of a section, so they come first.
    order = np.lexsort((np.abs(down) + np.abs(right), group))
    ends = np.searchsorted(group[order], np.arange(4 if is_mosaic else 1), side="right")
    return Moves(order, down[order], right[order] * channels, ends)


def groups_of(row_px: np.ndarray, col_px: np.ndarray, grid: CameraGrid, cfa: str | None) -> Groups:
    """The groups of views that move by whole pixels, by parity of their shifts if `cfa` is a pattern."""
    by_row, by_col = (
        _cameras_by_parity(px, size) for px, size in ((row_px, grid.height), (col_px, grid.width))
    )
    if cfa is None:
        return Groups(by_row, by_col, np.zeros((0, 2), np.int64))
    cells = colour_cells(cfa)
    return Groups(by_row, by_col, np.concatenate([np.argwhere(cells == colour) for colour in (0, 2, 1)]))


def _cameras_by_parity(shift: np.ndarray, size: int) -> np.ndarray:
    """How many cameras of even and of odd shift reach each voxel row (or column), (2, size)."""
    pixel = np.arange(size) - shift[:, None]
    inside = (pixel >= 0) & (pixel < size)
    return np.array([inside[shift % 2 == parity].sum(axis=0) for parity in (0, 1)])
