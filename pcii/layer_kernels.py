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

PARTS = CELL_PX * CELL_PX
"""What is covered of a view's cell is counted in pixels: of whole numbers nothing is ever left over."""
BAND = 16
"""Rows that a thread adds up at a time: they stay at hand while it goes through all views."""


@helper
def _add_row(source: np.ndarray, right: int, times: float, line: np.ndarray) -> None:
    """Adds a row of cells (W,), moved by `right` px, to a `line` (W,): `times` for each column of px."""
    for x in range(2):
        cells, wide = right // CELL_PX + x, right % CELL_PX if x else CELL_PX - right % CELL_PX
        if wide > 0:
            first, last = max(0, -cells), max(0, min(line.size, source.size - cells))
            # Slices, so that the compiler sees that all of it exists and takes several at a time.
            there, part = source[first + cells : last + cells], line[first:last]
            weight = line.dtype.type(times * wide)
            for j in range(part.size):
                part[j] += weight * there[j]


@helper
def _add_moved(values: np.ndarray, down: int, right: int, row: int, times: float, line: np.ndarray) -> None:
    """Adds what `values` (H, W), moved by `down` and `right` px, show in a `row` to its `line` (W,).

    `times` for each px that a cell shows of another.
    """
    a, p = row + down // CELL_PX, down % CELL_PX
    for u in range(2):
        high = p if u else CELL_PX - p
        if high > 0 and 0 <= a + u < values.shape[0]:
            _add_row(values[a + u], right, times * high, line)


@helper
def _filled(mask: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row + 1, first and last column + 1 in which a mask (H, W) has anything."""
    H, W = mask.shape
    top, bottom, left, right = H, 0, W, 0
    for a in range(H):
        for b in range(W):
            if mask[a, b]:
                top, bottom, left, right = min(top, a), a + 1, min(left, b), max(right, b + 1)
    return top, max(top, bottom), left, max(left, right)


@helper
def _seen(first: int, last: int, moved: int, size: int) -> tuple[int, int]:
    """The cells along an axis of a view, moved by so many px, that show anything of `first` to `last`."""
    start = max(0, first - moved // CELL_PX - 1)
    return start, max(start, min(size, last - moved // CELL_PX))


@helper
def _open(covered: np.ndarray, share: np.ndarray) -> None:
    """The `share` (W,) of each cell that is not `covered` (W,)."""
    for j in range(share.size):
        px = max(np.int32(PARTS) - np.int32(covered[j]), np.int32(0))
        share[j] = np.float32(1 / PARTS) * np.float32(px)


@helper
def _look_through(
    covered: np.ndarray,
    behind: np.ndarray | None,
    rows: np.ndarray,
    cols: np.ndarray,
    top: int,
    band: np.ndarray,
) -> None:
    """What all views see past what is `covered` (V, H, W) from the row `top` on: `band` (n, W), overwritten.

    Of what is `behind` (V, H, W), or themselves if that is not given.
    """
    V, H, W = covered.shape
    seen = np.empty(W, np.float32)
    band[:] = 0
    for v in range(V):
        down, right = rows[v // cols.size], -cols[v % cols.size]
        for row in range(*_seen(top, top + band.shape[0], down, H)):
            _open(covered[v, row], seen)
            if behind is not None:
                light = behind[v, row]
                for j in range(W):
                    seen[j] *= light[j]
            for u in range(2):  # the row lies over two of the layer's
                at, high = row + down // CELL_PX + u - top, down % CELL_PX if u else CELL_PX - down % CELL_PX
                if high > 0 and 0 <= at < band.shape[0]:
                    _add_row(seen, right, high / PARTS, band[at])


@compiled
def cover(mask: np.ndarray, rows: np.ndarray, cols: np.ndarray, step: int, covered: np.ndarray) -> None:
    """Adds `step` times the px of a `mask` (H, W) in each cell of the views to `covered` (V, H, W) uint16."""
    H = mask.shape[0]
    top, bottom, left, right = _filled(mask)
    cells = mask[top:bottom, left:right].astype(np.uint16)
    for view in nb.prange(covered.shape[0]):
        v = np.int64(view)
        # What is cut out lies that much nearer to the frame.
        down, over = rows[v // cols.size], cols[v % cols.size] - left * CELL_PX
        for i in range(*_seen(top, bottom, down, H)):
            _add_moved(cells, down - top * CELL_PX, over, i, step, covered[v, i])


@compiled
def paint(
    mask: np.ndarray, light: np.ndarray, rows: np.ndarray, cols: np.ndarray, behind: np.ndarray
) -> None:
    """Where a layer's `mask` (H, W) is, views show its `light` (H, W) before what is `behind` (V, H, W)."""
    H, W = mask.shape
    top, bottom, left, right = _filled(mask)
    there = mask[top:bottom, left:right].astype(np.float32)
    shown = there * light[top:bottom, left:right]
    for view in nb.prange(behind.shape[0]):
        v = np.int64(view)
        down, over = rows[v // cols.size], cols[v % cols.size]
        first, last = _seen(left, right, over, W)
        own, share = np.empty(last - first, np.float32), np.empty(last - first, np.float32)
        moved = over + (first - left) * CELL_PX
        for i in range(*_seen(top, bottom, down, H)):
            own[:] = 0
            share[:] = 0
            _add_moved(shown, down - top * CELL_PX, moved, i, 1 / PARTS, own)
            _add_moved(there, down - top * CELL_PX, moved, i, 1 / PARTS, share)
            line = behind[v, i, first:last]
            for j in range(line.size):
                line[j] = line[j] * (1 - share[j]) + own[j]


@compiled
def views_of(covered: np.ndarray, rows: np.ndarray, cols: np.ndarray, total: np.ndarray) -> None:
    """How many views see a layer's cells past what is `covered` (V, H, W): `total` (H, W), overwritten."""
    for part in nb.prange((total.shape[0] + BAND - 1) // BAND):
        top = int(np.int64(part) * BAND)
        _look_through(covered, None, rows, cols, top, total[top : top + BAND])


@compiled
def light_of(
    behind: np.ndarray, covered: np.ndarray, rows: np.ndarray, cols: np.ndarray, total: np.ndarray
) -> None:
    """What they see there of what is `behind` (V, H, W), all views together: `total` (H, W), overwritten."""
    for part in nb.prange((total.shape[0] + BAND - 1) // BAND):
        top = int(np.int64(part) * BAND)
        _look_through(covered, behind, rows, cols, top, total[top : top + BAND])


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
