"""Compiled: the rate of each photon's own pixel and colour, as all other photons of a section tell it.

Axes: C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import math

import numpy as np

from pcii.cells import CELL_PX
from pcii.kernels import helper

BLOCK_PX = 2
"""Voxels of 2 x 2 pixels: whatever the shifts, each block is covered equally by each Bayer colour.

Single pixels are not. At depths where all shifts are even a colour falls on every fourth voxel only, where
photons have four times as many partners, and textured patches would be drawn to such depths.
"""
SCALES = 5
"""Rates are smoothed over 2, 4, 8, 16 and 32 px and their mean taken: texture may be of any scale."""
COLOUR_SCALE = 3
"""What is finer than 16 px is estimated from all colours together, and shared out as they are around it."""
COLOUR_PRIOR = 0.3
"""Photons that are thought to be of each colour in proportion to its sites: one photon tells no colour."""
BASE_SCALE = 4
"""What a plane that shows nothing of its own would predict: the rate smoothed over 32 px."""
BASE_SHARE = 0.05
"""Least share of the base in a prediction, so that a single photon in the dark cannot decide."""

# Smoothing is by the binomial weights 1/4, 1/2, 1/4 along both axes, then linear between centres.
CENTRE, SIDE = 0.5, 0.25


@helper
def _smoothed(values: np.ndarray) -> np.ndarray:
    """Each plane of (C, H, W) smoothed along both axes; nothing comes in across borders."""
    C, H, W = values.shape
    centre, side = np.float32(CENTRE), np.float32(SIDE)
    result = np.empty_like(values)
    across = np.empty((H, W), np.float32)
    for c in range(C):
        for i in range(H):
            # Slices, so that the compiler sees that neighbours exist and takes several at a time.
            row, line = values[c, i], across[i]
            for j in range(line.size):
                line[j] = centre * row[j]
            before, after, later, ended = row[:-1], row[1:], line[1:], line[:-1]
            for j in range(later.size):
                later[j] += side * before[j]
            for j in range(later.size):
                ended[j] += side * after[j]
        for i in range(H):
            row, line = across[i], result[c, i]
            above, below = across[max(i - 1, 0)], across[min(i + 1, H - 1)]
            up, down = side if i > 0 else np.float32(0), side if i + 1 < H else np.float32(0)
            for j in range(line.size):
                line[j] = centre * row[j] + up * above[j] + down * below[j]
    return result


@helper
def _halved(values: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 of (C, H, W), sizes rounded up."""
    C, H, W = values.shape
    result = np.zeros((C, (H + 1) // 2, (W + 1) // 2), np.float32)
    for c in range(C):
        for i in range(H):
            for j in range(W):
                result[c, i // 2, j // 2] += values[c, i, j]
    return result


@helper
def _between(place: float, size: int) -> tuple[int, float, float]:
    """Cell centre below a place (in cells), the share of the next, and what an event there gives itself."""
    low = math.floor(place - 0.5)
    share = place - 0.5 - low
    if low < 0 or low + 1 >= size:  # beside the frame both centres are the same
        return low, share, CENTRE
    own = CENTRE * (1 - share) + SIDE * share if share < 0.5 else CENTRE * share + SIDE * (1 - share)
    return low, share, own


@helper
def _at(values: np.ndarray, c: int, low_i: int, share_i: float, low_j: int, share_j: float) -> float:
    """Linear between the four centres around a place; borders continue."""
    _, H, W = values.shape
    top, bottom = min(max(low_i, 0), H - 1), min(max(low_i + 1, 0), H - 1)
    left, right = min(max(low_j, 0), W - 1), min(max(low_j + 1, 0), W - 1)
    upper = (1 - share_j) * values[c, top, left] + share_j * values[c, top, right]
    lower = (1 - share_j) * values[c, bottom, left] + share_j * values[c, bottom, right]
    return (1 - share_i) * upper + share_i * lower


@helper
def _whole_blocks(shift: int, size: int) -> tuple[int, int]:
    """First and last row (or column) + 1 of the blocks that a shifted view covers as a whole.

    Blocks that it covers in part are left out: there it would bring more of one colour than of another.
    """
    first, last = max(0, shift), min(size, size + shift)
    return first + first % BLOCK_PX, last - last % BLOCK_PX


@helper
def _views_of_blocks(shifts: np.ndarray, size: int, blocks: int) -> np.ndarray:
    """How many camera rows (or columns) see each block row (or column), (blocks,)."""
    seen = np.zeros(blocks, np.float32)
    for camera in range(shifts.size):
        first, last = _whole_blocks(int(shifts[camera]), size)
        for place in range(first, last):
            seen[place // BLOCK_PX] += 1.0 / BLOCK_PX
    return seen


@helper
def land(
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


@helper
def predict(
    k: np.ndarray,
    l: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    colour: np.ndarray,
    n: np.ndarray,
    weight: np.ndarray,
    cell: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    size: tuple[int, int],
    sites: np.ndarray,
    share_seen: np.ndarray,
    prior: float,
    rate: np.ndarray,
    base: np.ndarray,
    samples: np.ndarray,
    mean: np.ndarray,
    blurred: np.ndarray,
) -> None:
    """What a section says of every event and cell; all outputs are overwritten. One thread's part.

    Events (N,) with their `colour`, number `n`, `weight` (0 to 1, how far they are believed) and `cell` (see
    `land`); whole shifts `rows` (K,) and `cols` (L,); `size` of the film in px; `sites` (C,) of each colour
    in a block; `share_seen` (H, W), of the views that cover a cell the share that is believed; `prior`, how
    many samples a coarser scale is worth. For events: the `rate`, photons per sample of its pixel by all
    other events, and the same by the widest window alone, `base`. For cells: the views of all its blocks,
    `samples`; photons per block and view, `mean` and `blurred` likewise.
    """
    H, W = size
    h, w = mean.shape
    C = sites.size
    share_of_site = sites / sites.sum()
    counts = np.zeros((C, 2 * h, 2 * w), np.float32)
    for e in range(k.size):
        if cell[e] >= 0:
            row, col = i[e] + rows[k[e]], j[e] + cols[l[e]]
            counts[colour[e], row // BLOCK_PX, col // BLOCK_PX] += n[e] * weight[e]
    by_row = _views_of_blocks(rows, H, 2 * h)
    by_col = _views_of_blocks(cols, W, 2 * w)
    views = np.empty((1, 2 * h, 2 * w), np.float32)
    for a in range(2 * h):
        for b in range(2 * w):
            views[0, a, b] = by_row[a] * by_col[b] * share_seen[a // 2, b // 2]
    totals = np.zeros((1, 2 * h, 2 * w), np.float32)
    for c in range(C):
        totals[0] += counts[c]
    everywhere = totals.sum() / max(views.sum(), np.float32(1e-6))
    seen = [_smoothed(views)]
    light = [_smoothed(totals)]
    coloured = [counts[:, :1, :1].copy()]  # finer than the colour scale no colour is smoothed on its own
    for scale in range(1, SCALES):
        counts, totals, views = _halved(counts), _halved(totals), _halved(views)
        seen.append(_smoothed(views))
        light.append(_smoothed(totals))
        coloured.append(_smoothed(counts) if scale >= COLOUR_SCALE else counts[:, :1, :1].copy())

    for e in range(k.size):
        if cell[e] < 0:
            rate[e] = base[e] = 0.0
            continue
        c = colour[e]
        row, col = i[e] + rows[k[e]] + 0.5, j[e] + cols[l[e]] + 0.5
        share = share_of_site[c]
        coarser = everywhere * share / sites[c]
        total = 0.0
        widest = 0.0
        for reverse in range(SCALES):
            scale = SCALES - 1 - reverse
            if scale == 0:  # a block is its own best estimate: nothing between centres
                low_i, share_i, own_i = int(row) // BLOCK_PX, 0.0, CENTRE
                low_j, share_j, own_j = int(col) // BLOCK_PX, 0.0, CENTRE
            else:
                width = float(BLOCK_PX << scale)
                low_i, share_i, own_i = _between(row / width, light[scale].shape[1])
                low_j, share_j, own_j = _between(col / width, light[scale].shape[2])
            own = own_i * own_j * weight[e]
            there = _at(seen[scale], 0, low_i, share_i, low_j, share_j) * sites[c]
            others = max(_at(light[scale], 0, low_i, share_i, low_j, share_j) - own, 0.0)
            if scale >= COLOUR_SCALE:
                same = max(_at(coloured[scale], c, low_i, share_i, low_j, share_j) - own, 0.0)
                share = (same + COLOUR_PRIOR * share_of_site[c]) / (others + COLOUR_PRIOR)
            coarser = (others * share + prior * coarser) / max(there + prior, 1e-6)
            total += coarser / SCALES
            if scale == BASE_SCALE:
                widest = max(coarser, 1e-12)
        rate[e] = (1 - BASE_SHARE) * total + BASE_SHARE * widest
        base[e] = widest

    for a in range(h):
        for b in range(w):
            mean[a, b] = blurred[a, b] = 0.0
            samples[a, b] = by_row[2 * a : 2 * a + 2].sum() * by_col[2 * b : 2 * b + 2].sum()
            if samples[a, b] <= 0:
                continue
            coarser = everywhere
            total = 0.0
            for reverse in range(SCALES - 1):
                scale = SCALES - 1 - reverse
                width = float(BLOCK_PX << scale)
                low_i, share_i, _ = _between((a + 0.5) * CELL_PX / width, light[scale].shape[1])
                low_j, share_j, _ = _between((b + 0.5) * CELL_PX / width, light[scale].shape[2])
                there = _at(seen[scale], 0, low_i, share_i, low_j, share_j)
                others = _at(light[scale], 0, low_i, share_i, low_j, share_j)
                coarser = (others + prior * coarser) / max(there + prior, 1e-6)
                total += coarser / SCALES
                if scale == BASE_SCALE:
                    blurred[a, b] = coarser
            for u in range(2):
                for v in range(2):
                    if by_row[2 * a + u] * by_col[2 * b + v] > 0:
                        there = seen[0][0, 2 * a + u, 2 * b + v] + prior
                        block = (light[0][0, 2 * a + u, 2 * b + v] + prior * coarser) / there
                        total += block / (4 * SCALES)
            mean[a, b] = (1 - BASE_SHARE) * total + BASE_SHARE * blurred[a, b]
