"""Compiled loops over rays: which layer does each camera see, and what is behind it?

Axes: V = K x L views, (H, W) cells of 4 px, N events. What a layer has at px (row, column) is seen by view
(k, l) at (row - rows[k], column - cols[l]), shifts in whole px. A cell of one therefore lies over four of the
other, and its share of each counts: rounded to cells, the border between two layers would lie up to 2 px
beside the photons that tell where it is, at some depths in more views than at others.
"""

import math

import numba as nb
import numpy as np

from pcii.cells import CELL_PX
from pcii.kernels import compiled, helper


@helper
def _add_moved(values: np.ndarray, down: int, right: int, row: int, line: np.ndarray) -> None:
    """Adds to `line` (W,) what `values` (H, W) show there: cells of `row`, moved by `down` and `right` px."""
    H, W = values.shape
    a, p = row + down // CELL_PX, down % CELL_PX
    b, q = right // CELL_PX, right % CELL_PX
    for u in range(2):
        share = np.float32(p if u else CELL_PX - p) / np.float32(CELL_PX)
        if share == 0 or a + u < 0 or a + u >= H:
            continue
        for v in range(2):
            weight = share * np.float32(q if v else CELL_PX - q) / np.float32(CELL_PX)
            if weight > 0:
                first, last = max(0, -b - v), max(0, min(W, W - b - v))
                # Slices, so that the compiler sees that all of it exists and takes several at a time.
                source, part = values[a + u, first + b + v : last + b + v], line[first:last]
                for j in range(part.size):
                    part[j] += weight * source[j]


@helper
def _filled(mask: np.ndarray) -> tuple[int, int]:
    """First and last row + 1 in which a mask (H, W) has anything."""
    first, last = mask.shape[0], 0
    for a in range(mask.shape[0]):
        if mask[a].any():
            first, last = min(first, a), a + 1
    return first, last


@helper
def _seen(filled: tuple[int, int], down: int, height: int) -> tuple[int, int]:
    """The rows of a view, moved by `down` px, that show anything of a mask's `filled` rows."""
    return max(0, filled[0] - down // CELL_PX - 1), min(height, filled[1] - down // CELL_PX)


@compiled
def cover(mask: np.ndarray, rows: np.ndarray, cols: np.ndarray, step: int, covered: np.ndarray) -> None:
    """Adds `step` times a layer's `mask` (H, W) to how much of their cells views see `covered` (V, H, W)."""
    W = mask.shape[1]
    filled = _filled(mask)
    for view in nb.prange(covered.shape[0]):
        v = np.int64(view)
        down, right = rows[v // cols.size], cols[v % cols.size]
        share = np.empty(W, np.float32)
        for i in range(*_seen(filled, down, mask.shape[0])):
            share[:] = 0
            _add_moved(mask, down, right, i, share)
            line = covered[v, i]
            for j in range(W):
                line[j] += step * share[j]


@compiled
def paint(
    mask: np.ndarray, light: np.ndarray, rows: np.ndarray, cols: np.ndarray, behind: np.ndarray
) -> None:
    """Where a layer's `mask` (H, W) is, views show its `light` (H, W) before what is `behind` (V, H, W)."""
    W = mask.shape[1]
    shown, filled = mask * light, _filled(mask)
    for view in nb.prange(behind.shape[0]):
        v = np.int64(view)
        down, right = rows[v // cols.size], cols[v % cols.size]
        own, share = np.empty(W, np.float32), np.empty(W, np.float32)
        for i in range(*_seen(filled, down, mask.shape[0])):
            own[:] = 0
            share[:] = 0
            _add_moved(shown, down, right, i, own)
            _add_moved(mask, down, right, i, share)
            line = behind[v, i]
            for j in range(W):
                line[j] = line[j] * (1 - share[j]) + own[j]


@compiled
def from_views(values: np.ndarray, rows: np.ndarray, cols: np.ndarray, total: np.ndarray) -> None:
    """What all views together have (V, H, W) where a layer's cells are: `total` (H, W), overwritten."""
    for line in nb.prange(total.shape[0]):
        a = np.int64(line)
        total[a] = 0
        for v in range(values.shape[0]):
            _add_moved(values[v], -rows[v // cols.size], -cols[v % cols.size], int(a), total[a])


@compiled
def gathered(values: np.ndarray, rows: np.ndarray, cols: np.ndarray, result: np.ndarray) -> None:
    """The views' `values` (V, H, W) where a layer would show them, summed: `result` (H, W), overwritten.

    What a view shows beside the layer's frame counts at its nearest border.
    """
    _, H, W = values.shape
    for line in nb.prange(H):
        a = np.int64(line)
        result[a] = 0
        for v in range(values.shape[0]):
            down, right = rows[v // cols.size], cols[v % cols.size]
            first, last = a - down, a - down
            if a == 0:
                first = 0
            if a == H - 1:
                last = H - 1
            for i in range(max(0, first), min(H - 1, last) + 1):
                for j in range(W):
                    result[a, min(max(j + right, 0), W - 1)] += values[v, i, j]


@helper
def better_predicted(
    cell: np.ndarray,
    n: np.ndarray,
    hidden: np.ndarray,
    rate: np.ndarray,
    rate_behind: np.ndarray,
    gain: np.ndarray,
) -> None:
    """Adds to `gain` (H, W) the nats by which a layer predicts the events that it is seen by better."""
    W = gain.shape[1]
    for e in range(cell.size):
        if hidden[e] == 0 and cell[e] >= 0:
            gain[cell[e] // W, cell[e] % W] += n[e] * math.log(rate[e] / rate_behind[e])


@helper
def hide(mask: np.ndarray, cell: np.ndarray, step: int, hidden: np.ndarray) -> None:
    """Adds `step` to `hidden` (N,), how many nearer layers an event comes from or is hidden by."""
    W = mask.shape[1]
    for e in range(cell.size):
        if cell[e] >= 0 and mask[cell[e] // W, cell[e] % W]:
            hidden[e] += step


@helper
def claim(mask: np.ndarray, cell: np.ndarray, rate: np.ndarray, rate_behind: np.ndarray) -> None:
    """Events in the layer's `mask` have its `rate`, then behind what is nearer: `rate_behind` (N,)."""
    W = mask.shape[1]
    for e in range(cell.size):
        if cell[e] >= 0 and rate[e] > 0 and mask[cell[e] // W, cell[e] % W]:
            rate_behind[e] = rate[e]
