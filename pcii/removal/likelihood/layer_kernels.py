"""Compiled loops over rays: which layer does each camera see, and what is behind it?

Axes: V = K x L views, (H, W) cells of 4 px, N events. What a layer has at px (row, column) is seen by view
(k, l) at (row - rows[k], column - cols[l]), shifts in whole px. A cell of one therefore lies over four of the
other, and its share of each counts: rounded to cells, the border between two layers would lie up to 2 px
beside the photons that tell where it is, at some depths in more views than at others.
"""

import numpy as np

from pcii.base.compiled_loops import compiled, helper, in_threads, shared
from pcii.evidence.cells import CELL_PX

PARTS = CELL_PX * CELL_PX
"""What is covered of a view's cell is counted in pixels: of whole numbers nothing is ever left over."""
BAND = 16
"""Rows that a thread adds up at a time: they stay at hand while it goes through all views."""


@helper
def _add(row: np.ndarray, weight: float, line: np.ndarray) -> None:
    """Adds a `row` of cells (W,), so many times, to a `line` (W,)."""
    times = line.dtype.type(weight)
    for j in range(line.size):
        line[j] += times * row[j]


@helper
def _views_at(rows: np.ndarray, cols: np.ndarray, p: int, q: int) -> np.ndarray:
    """The views (n,) whose shifts are p px down and q px to the right of whole cells."""
    views = np.empty(rows.size * cols.size, np.int64)
    found = 0
    for v in range(views.size):
        if rows[v // cols.size] % CELL_PX == p and cols[v % cols.size] % CELL_PX == q:
            views[found] = v
            found += 1
    return views[:found]


@helper
def _moved_in_parts(values: np.ndarray, p: int, q: int, times: float) -> np.ndarray:
    """What cells show of `values` (H, W) that lie p px above and q px left of them: (H + 1, W + 1).

    Its first row and column lie before the first of the values. Views that differ by whole cells share it.
    """
    H, W = values.shape
    moved = np.zeros((H + 1, W + 1), values.dtype)
    for u in range(2):
        for x in range(2):
            high, wide = p if u else CELL_PX - p, q if x else CELL_PX - q
            for i in range(H):
                _add(values[i], times * high * wide, moved[i + 1 - u, 1 - x : 1 - x + W])
    return moved


@compiled
def filled(mask: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row + 1, first and last column + 1 in which a mask (H, W) has anything."""
    H, W = mask.shape
    top, bottom, left, right = H, 0, W, 0
    for a in range(H):
        for b in range(W):
            if mask[a, b]:
                top, bottom, left, right = min(top, a), a + 1, min(left, b), max(right, b + 1)
    return top, max(top, bottom), left, max(left, right)


@helper
def _shown(first: int, last: int, shift: int, size: int) -> tuple[int, int, int]:
    """The cells along an axis of a view, shifted by so many px, that show anything of `first` to `last`.

    Also how much farther on in `_moved_in_parts` of those cells lies what they show.
    """
    begin = max(0, first - shift // CELL_PX - 1)
    return begin, max(begin, min(size, last - shift // CELL_PX)), shift // CELL_PX + 1 - first


@helper
def _open_px(hidden: int) -> np.float32:
    """How many px of a cell are open if so many are hidden, by each nearer layer anew."""
    return np.float32(max(np.int32(PARTS) - np.int32(hidden), np.int32(0)))


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
    _, H, W = covered.shape
    n = band.shape[0]
    band[:] = 0
    for part in range(PARTS):
        p, q = part // CELL_PX, part % CELL_PX
        views = _views_at(rows, -cols, p, q)
        if views.size == 0:
            continue
        # Views that differ by whole cells are added up first, from a row before the band on.
        seen = np.zeros((n + 1, W + 1), np.float32)
        for v in views:
            down, right = rows[v // cols.size] // CELL_PX, -cols[v % cols.size] // CELL_PX
            first = min(max(0, -right), W + 1)
            last = max(first, min(W + 1, W - right))
            for row in range(max(0, top - 1 - down), min(H, top + n - down)):
                line = seen[row + down - top + 1, first:last]
                hidden = covered[v, row, first + right : last + right]
                if behind is not None:
                    light = behind[v, row, first + right : last + right]
                    for j in range(line.size):
                        line[j] += _open_px(hidden[j]) * light[j]
                else:
                    for j in range(line.size):
                        line[j] += _open_px(hidden[j])
        for u in range(2):
            for x in range(2):
                high, wide = p if u else CELL_PX - p, q if x else CELL_PX - q
                for i in range(n):
                    _add(seen[i + 1 - u, x : x + W], high * wide / PARTS**2, band[i])


def cover(mask: np.ndarray, rows: np.ndarray, cols: np.ndarray, step: int, covered: np.ndarray) -> None:
    """Adds `step` times the px of a `mask` (H, W) in each cell of the views to `covered` (V, H, W) uint16."""
    top, bottom, left, right = filled(mask)
    cells = mask[top:bottom, left:right].astype(np.uint16)
    in_threads(_cover, PARTS, cells, (top, left), rows, cols, step, covered)


@compiled
def _cover(
    first_part: int,
    last_part: int,
    cells: np.ndarray,
    corner: tuple[int, int],
    rows: np.ndarray,
    cols: np.ndarray,
    step: int,
    covered: np.ndarray,
) -> None:
    """Of the views that are p, q px beyond whole cells, p `CELL_PX` + q from `first_part` to `last_part` - 1.

    `cells` (h, w) are the box of the mask whose first row and column are the `corner`.
    """
    _, H, W = covered.shape
    top, left = corner
    bottom, right = top + cells.shape[0], left + cells.shape[1]
    for part in range(first_part, last_part):
        p, q = part // CELL_PX, part % CELL_PX
        views = _views_at(rows, cols, p, q)
        if views.size == 0:
            continue
        moved = _moved_in_parts(cells, p, q, step)
        for number in range(views.size):
            v = int(views[number])
            first, last, down = _shown(top, bottom, rows[v // cols.size], H)
            begin, end, over = _shown(left, right, cols[v % cols.size], W)
            for i in range(first, last):
                line, there = covered[v, i, begin:end], moved[i + down, begin + over : end + over]
                for j in range(line.size):
                    line[j] += there[j]


def paint(
    mask: np.ndarray, light: np.ndarray, rows: np.ndarray, cols: np.ndarray, behind: np.ndarray
) -> None:
    """Where a layer's `mask` (H, W) is, views show its `light` (H, W) before what is `behind` (V, H, W)."""
    top, bottom, left, right = filled(mask)
    cells = mask[top:bottom, left:right].astype(np.float32)
    shown = cells * light[top:bottom, left:right]
    in_threads(_paint, PARTS, cells, shown, (top, left), rows, cols, behind)


@compiled
def _paint(
    first_part: int,
    last_part: int,
    cells: np.ndarray,
    light: np.ndarray,
    corner: tuple[int, int],
    rows: np.ndarray,
    cols: np.ndarray,
    behind: np.ndarray,
) -> None:
    """Of the parts of `_cover`; `cells` and `light` (h, w) are the box of the mask, and what it shows."""
    _, H, W = behind.shape
    top, left = corner
    bottom, right = top + cells.shape[0], left + cells.shape[1]
    for part in range(first_part, last_part):
        p, q = part // CELL_PX, part % CELL_PX
        views = _views_at(rows, cols, p, q)
        if views.size == 0:
            continue
        shares, lights = _moved_in_parts(cells, p, q, 1 / PARTS), _moved_in_parts(light, p, q, 1 / PARTS)
        for number in range(views.size):
            v = int(views[number])
            first, last, down = _shown(top, bottom, rows[v // cols.size], H)
            begin, end, over = _shown(left, right, cols[v % cols.size], W)
            for i in range(first, last):
                line = behind[v, i, begin:end]
                share = shares[i + down, begin + over : end + over]
                own = lights[i + down, begin + over : end + over]
                for j in range(line.size):
                    line[j] = line[j] * (1 - share[j]) + own[j]


@shared(lambda covered, rows, cols, total: -(-len(total) // BAND))
def views_of(
    first_band: int,
    last_band: int,
    covered: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    total: np.ndarray,
) -> None:
    """How many views see a layer's cells past what is `covered` (V, H, W): `total` (H, W), overwritten."""
    for top in range(first_band * BAND, last_band * BAND, BAND):
        _look_through(covered, None, rows, cols, top, total[top : top + BAND])


@shared(lambda behind, covered, rows, cols, total: -(-len(total) // BAND))
def light_of(
    first_band: int,
    last_band: int,
    behind: np.ndarray,
    covered: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    total: np.ndarray,
) -> None:
    """What they see there of what is `behind` (V, H, W), all views together: `total` (H, W), overwritten."""
    for top in range(first_band * BAND, last_band * BAND, BAND):
        _look_through(covered, behind, rows, cols, top, total[top : top + BAND])


@shared(lambda values, rows, cols, result: len(result))
def gathered(
    first_row: int,
    last_row: int,
    values: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    result: np.ndarray,
) -> None:
    """The views' `values` (V, H, W) where a layer would show them, summed: `result` (H, W), overwritten.

    What a view shows beside the layer's frame counts at its nearest border.
    """
    _, H, W = values.shape
    for a in range(first_row, last_row):
        result[a, :] = np.float32(0)
        for v in range(values.shape[0]):
            down, right = rows[v // cols.size], cols[v % cols.size]
            first, last = a - down, a - down
            if a == 0:
                first = 0
            if a == H - 1:
                last = H - 1
            # Of a view's columns those before `begin` land at the first, those from `end` on at the last.
            begin, end = min(max(0, -right), W), max(min(W, W - right), 0)
            for i in range(max(0, first), min(H - 1, last) + 1):
                row = values[v, i]
                for j in range(begin):
                    result[a, 0] += row[j]
                within, there = result[a, begin + right : end + right], row[begin:end]
                for j in range(there.size):
                    within[j] += there[j]
                for j in range(end, W):
                    result[a, W - 1] += row[j]
