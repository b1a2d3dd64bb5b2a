"""Whole-pixel moves of whole images: by how much each view moves, with what weight, in what order.

The arguments of the compiled loops of `dense_kernels`, made without importing the compiler.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from pcii.core.bayer import colour_cells
from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.section_stack import Shifts


class Moves(NamedTuple):
    """Images in the order in which they are added, (M,) each, group after group; group g ends at `ends[g]`.

    Move m adds image `source[m]`, moved by `row_shift[m]` rows and `col_shift[m]` columns times channels,
    times `weight[m]`.
    """

    source: np.ndarray
    row_shift: np.ndarray
    col_shift: np.ndarray
    weight: np.ndarray
    ends: np.ndarray


class Running(NamedTuple):
    """Running sums of groups of images, (G, H, N) float64, N columns times channels.

    `total` and `squares` sum differences from the `first` sample of each voxel, NaN before there is one;
    `squares` and `first` may be empty: then the samples themselves are summed.
    """

    total: np.ndarray
    squares: np.ndarray
    first: np.ndarray


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


@dataclass(frozen=True)
class AxisMoves:
    """Whole pixels by which each row (or column) of cameras is moved, int64, and the weights of the moves."""

    px: np.ndarray
    weight: np.ndarray


def axis_moves(planes: FocalPlanes, plane: int, shifts: Shifts) -> tuple[list[AxisMoves], list[AxisMoves]]:
    """Moves of the rows (K,) and of the columns (L,) of cameras: one, or two for bilinear shifts."""
    if shifts != "bilinear":
        nearest = planes.nearest_shifts_px(step_px(shifts))
        rows, cols = ([AxisMoves(px[plane], np.ones(px[plane].size))] for px in nearest)
        return rows, cols
    axes = []
    for shifts_px in planes.exact_shifts_px:
        exact = shifts_px[plane]
        px = np.floor(exact).astype(np.int64)
        axes.append([AxisMoves(px, 1 - (exact - px)), AxisMoves(px + 1, exact - px)])
    return axes[0], axes[1]


def step_px(shifts: Shifts) -> int:
    """The number of pixels of which whole shifts are multiples."""
    return 2 if shifts == "even" else 1


def moves_of(
    row_moves: Sequence[AxisMoves],
    col_moves: Sequence[AxisMoves],
    views: np.ndarray,
    channels: int,
    is_mosaic: bool,
) -> Moves:
    """All moves of these views (V,) with a weight above 0; images are numbered as `views` lists them."""
    columns = col_moves[0].px.size
    source, down, right, weight = [], [], [], []
    for row, col in product(row_moves, col_moves):
        share = row.weight[views // columns] * col.weight[views % columns]
        used = np.flatnonzero(share)
        source.append(used)
        weight.append(share[used])
        down.append(row.px[views[used] // columns])
        right.append(col.px[views[used] % columns])
    down, right = np.concatenate(down), np.concatenate(right)
    group = 2 * (down % 2) + right % 2 if is_mosaic else np.zeros_like(down)
    # The images that move least cover most of a section, so they come first.
    order = np.lexsort((np.abs(down) + np.abs(right), group))
    ends = np.searchsorted(group[order], np.arange(4 if is_mosaic else 1), side="right")
    source, weight = np.concatenate(source)[order], np.concatenate(weight)[order]
    return Moves(source, down[order], right[order] * channels, weight, ends)


def groups_of(
    row_moves: Sequence[AxisMoves], col_moves: Sequence[AxisMoves], grid: CameraGrid, cfa: str | None
) -> Groups:
    """The groups of views that move by whole pixels, by parity of their shifts if `cfa` is a pattern."""
    by_row, by_col = (
        _cameras_by_parity(moves[0].px, size)
        for moves, size in ((row_moves, grid.height), (col_moves, grid.width))
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
