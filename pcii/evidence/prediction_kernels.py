"""Compiled: the rate of each photon's own pixel and colour, as all other photons of a section tell it.

Axes: C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import numba as nb
import numpy as np

from pcii.core.compiled_loops import compiled, helper
from pcii.evidence.cells import CELL_PX

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
AT_ONCE = 512
"""Events that are taken through the scales together."""

# Smoothing is by the binomial weights 1/4, 1/2, 1/4 along both axes, then linear between centres.
CENTRE, SIDE = 0.5, 0.25


Events = tuple[np.ndarray, ...]
"""Pixels that caught photons, (N,) each: camera k, l and pixel i, j; colour; number of photons; weight, 0 to
1, how far they are believed; cell, see `land`."""
Section = tuple[np.ndarray, np.ndarray, int, int, np.ndarray, np.ndarray, float]
"""A depth, and what is believed there: whole shifts of the rows (K,) and columns (L,) of cameras; height and
width of the film in px; sites (C,) of each colour in a block; of the views that cover a cell the share that
is believed (H, W); how many samples a coarser scale is worth."""
Predicted = tuple[np.ndarray, ...]
"""What a section says, overwritten, in double precision: of many photons a small share is many. Of events:
rate, photons per sample of its pixel by all other events, and base, the same by the widest window alone. Of
cells: samples, the views of all its blocks; mean, photons per block and view, and blurred, the same by the
widest window alone."""
Scales = tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray], float, np.ndarray, np.ndarray]
"""A section at each scale, smoothed: views and photons (1, H, W), photons by colour (C, H, W); the mean rate;
how many camera rows (2 h,) and columns (2 w,) see each row and column of blocks."""


@helper
def _smoothed(values: np.ndarray) -> np.ndarray:
    """Each plane of (C, H, W) smoothed along both axes; nothing comes in across borders."""
    C, H, W = values.shape
    centre, side = CENTRE, SIDE
    result = np.empty_like(values)
    across = np.empty((H, W))
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
            up, down = side if i > 0 else 0.0, side if i + 1 < H else 0.0
            for j in range(line.size):
                line[j] = centre * row[j] + up * above[j] + down * below[j]
    return result


@helper
def _halved(values: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 of (C, H, W), sizes rounded up."""
    C, H, W = values.shape
    result = np.zeros((C, (H + 1) // 2, (W + 1) // 2))
    for c in range(C):
        for i in range(H):
            row, line = values[c, i], result[c, i // 2]
            for b in range(W // 2):
                line[b] = (line[b] + row[2 * b]) + row[2 * b + 1]
            if W % 2:
                line[W // 2] += row[W - 1]
    return result


@helper
def _between(place: float, size: int) -> tuple[int, int, float, float]:
    """The cells whose centres are around a place (in cells), the share of the second, an event's own part.

    Beside the frame both are the same.
    """
    low = int(place + 0.5) - 1
    share = place - 0.5 - low
    if low < 0 or low + 1 >= size:
        low = min(max(low, 0), size - 1)
        return low, low, share, CENTRE
    nearer = max(share, 1 - share)
    return low, low + 1, share, CENTRE * nearer + SIDE * (1 - nearer)


@helper
def _at(
    values: np.ndarray, top: int, bottom: int, share_i: float, left: int, right: int, share_j: float
) -> float:
    """Linear between the four centres (see `_between`) in `values` (H, W)."""
    upper = (1 - share_j) * values[top, left] + share_j * values[top, right]
    lower = (1 - share_j) * values[bottom, left] + share_j * values[bottom, right]
    return (1 - share_i) * upper + share_i * lower


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
def _scales(events: Events, section: Section, finest: int) -> Scales:
    """The section at the scales from the `finest` on."""
    k, l, i, j, colour, n, weight, cell = events
    rows, cols, H, W, sites, share_seen, _ = section
    h, w = share_seen.shape
    by_row, by_col = views_of_blocks(rows, H, 2 * h), views_of_blocks(cols, W, 2 * w)
    totals = np.zeros((1, by_row.size, by_col.size))
    # Of colours nobody asks at the finer scales.
    wide = BLOCK_PX << COLOUR_SCALE
    counts = np.zeros((sites.size, -(-2 * h * BLOCK_PX // wide), -(-2 * w * BLOCK_PX // wide)))
    for e in range(k.size):
        if cell[e] >= 0:
            row, col, photons = i[e] + rows[k[e]], j[e] + cols[l[e]], n[e] * weight[e]
            totals[0, row // BLOCK_PX, col // BLOCK_PX] += photons
            counts[colour[e], row // wide, col // wide] += photons
    views = np.empty((1, by_row.size, by_col.size))
    for a in range(by_row.size):
        for b in range(by_col.size):
            views[0, a, b] = by_row[a] * by_col[b] * share_seen[a // 2, b // 2]
    everywhere = totals.sum() / max(views.sum(), 1e-6)
    seen, light, coloured = [], [], []
    for scale in range(SCALES):
        if scale > 0:
            totals, views = _halved(totals), _halved(views)
        if scale > COLOUR_SCALE:
            counts = _halved(counts)
        # A scale that nobody looks at is there in name only.
        whole, by_colour = scale >= finest, scale >= max(COLOUR_SCALE, finest)
        seen.append(_smoothed(views if whole else views[:, :1, :1].copy()))
        light.append(_smoothed(totals if whole else totals[:, :1, :1].copy()))
        coloured.append(_smoothed(counts if by_colour else counts[:, :1, :1].copy()))
    return seen, light, coloured, everywhere, by_row, by_col


@helper
def _predict_events(
    first: int,
    last: int,
    asked: np.ndarray,
    finest: int,
    events: Events,
    section: Section,
    scales: Scales,
    told: Predicted,
) -> None:
    """The `rate` and `base` of those events from `first` to `last` that are `asked` for (N,)."""
    k, l, i, j, colour, _, weight, cell = events
    rows, cols, _, _, sites, _, prior = section
    seen, light, coloured, everywhere, _, _ = scales
    rate, base, _, _, _ = told
    share_of_site = sites / sites.sum()
    # Scale by scale for some events at a time: to take an array from a list costs as much as to look one up.
    which = np.empty(AT_ONCE, np.int64)
    shares, coarsers, widest, sums = np.empty((4, AT_ONCE), np.float64)
    for begin in range(first, last, AT_ONCE):
        found = 0
        for e in range(begin, min(begin + AT_ONCE, last)):
            which[found] = e
            found += asked[e] and cell[e] >= 0
            if asked[e] and cell[e] < 0:
                rate[e] = base[e] = 0.0
        for x in range(found):
            c = colour[which[x]]
            shares[x] = share_of_site[c]
            coarsers[x] = everywhere * share_of_site[c] / sites[c]
            sums[x] = 0.0
        for reverse in range(SCALES - finest):
            scale = SCALES - 1 - reverse
            views, photons, by_colour = seen[scale], light[scale], coloured[scale]
            _, high, wide = views.shape
            narrow = 1 / float(BLOCK_PX << scale)
            for x in range(found):
                e = which[x]
                c = colour[e]
                row, col = i[e] + rows[k[e]], j[e] + cols[l[e]]
                if scale == 0:  # a block is its own best estimate: nothing between centres
                    own = CENTRE * CENTRE * weight[e]
                    there = views[0, row // BLOCK_PX, col // BLOCK_PX] * sites[c]
                    others = max(photons[0, row // BLOCK_PX, col // BLOCK_PX] - own, 0.0)
                else:
                    top, bottom, share_i, own_i = _between((float(row) + 0.5) * narrow, high)
                    left, right, share_j, own_j = _between((float(col) + 0.5) * narrow, wide)
                    own = own_i * own_j * weight[e]
                    there = _at(views[0], top, bottom, share_i, left, right, share_j) * sites[c]
                    others = max(_at(photons[0], top, bottom, share_i, left, right, share_j) - own, 0.0)
                    if scale >= COLOUR_SCALE:
                        same = max(_at(by_colour[c], top, bottom, share_i, left, right, share_j) - own, 0.0)
                        shares[x] = (same + COLOUR_PRIOR * share_of_site[c]) / (others + COLOUR_PRIOR)
                coarsers[x] = (others * shares[x] + prior * coarsers[x]) / max(there + prior, 1e-6)
                sums[x] += coarsers[x] / SCALES
                if scale == BASE_SCALE:
                    widest[x] = max(coarsers[x], 1e-12)
        for x in range(found):
            rate[which[x]] = (1 - BASE_SHARE) * sums[x] + BASE_SHARE * widest[x]
            base[which[x]] = widest[x]


@helper
def _predict_cells(
    first: int, last: int, finest: int, sharp: bool, section: Section, scales: Scales, told: Predicted
) -> None:
    """The `samples`, `mean` and `blurred` light of the rows from `first` to `last`.

    Block by block, in which rates are linear, and by how many views see each block: so `samples` times `mean`
    is the sum of what events are predicted with over all pixels of the cell, whatever chance made of them.
    If `sharp`, coarser scales are evaluated at the cell's centre instead, as in a picture of the light.
    """
    prior = section[6]
    seen, light, _, everywhere, by_row, by_col = scales
    _, _, samples, mean, blurred = told
    blocks = by_col.size
    coarsers, sums, widest = np.zeros((3, blocks), np.float64)
    for a in range(first, last):
        for b in range(mean.shape[1]):
            samples[a, b] = (by_row[2 * a] + by_row[2 * a + 1]) * (by_col[2 * b] + by_col[2 * b + 1])
            mean[a, b] = blurred[a, b] = 0.0
        for u in range(2 * a, 2 * a + 2):
            if by_row[u] <= 0:
                continue
            coarsers[:] = everywhere
            sums[:] = 0.0
            for reverse in range(SCALES - finest):
                scale = SCALES - 1 - reverse
                views, photons = seen[scale][0], light[scale][0]
                high, wide = views.shape
                narrow, centred = 1 / float(1 << scale), sharp and scale > 0
                row = 2 * a + 1.0 if centred else u + 0.5
                top, bottom, share_i, _ = _between(row * narrow, high)
                for v in range(blocks):
                    if by_col[v] <= 0:
                        continue
                    col = v // 2 * 2 + 1.0 if centred else v + 0.5
                    left, right, share_j, _ = _between(col * narrow, wide)
                    there = _at(views, top, bottom, share_i, left, right, share_j)
                    others = _at(photons, top, bottom, share_i, left, right, share_j)
                    coarsers[v] = (others + prior * coarsers[v]) / max(there + prior, 1e-6)
                    sums[v] += coarsers[v] / SCALES
                    if scale == BASE_SCALE:
                        widest[v] = coarsers[v]
            for v in range(blocks):
                share = by_row[u] * by_col[v] / max(samples[a, v // 2], 1e-6)
                mean[a, v // 2] += share * ((1 - BASE_SHARE) * sums[v] + BASE_SHARE * widest[v])
                blurred[a, v // 2] += share * widest[v]


@helper
def predict(events: Events, section: Section, told: Predicted) -> None:
    """What a section says of every event and cell. One thread's part."""
    N, h = events[0].size, told[3].shape[0]
    scales = _scales(events, section, 0)
    _predict_events(0, N, np.ones(N, np.bool_), 0, events, section, scales, told)
    _predict_cells(0, h, 0, False, section, scales, told)


@compiled
def predict_shared(
    parts: int,
    asked: np.ndarray,
    asked_rows: tuple[int, int],
    finest: int,
    events: Events,
    section: Section,
    told: Predicted,
) -> None:
    """The same, shared among threads in so many `parts`, for those events alone that are `asked` for (N,).

    Light is that at the centres of cells: sharper, but not the sum of what events are predicted with.
    Of cells those in the `asked_rows`, first and last + 1. With `finest` = BASE_SCALE the widest window alone
    is looked at: `base` and `blurred` are right, `rate` and `mean` mean nothing.
    """
    N, (first, last) = events[0].size, asked_rows
    scales = _scales(events, section, finest)
    for part in nb.prange(parts):
        this, beyond = N * part // parts, N * (part + 1) // parts
        _predict_events(this, beyond, asked, finest, events, section, scales, told)
        top = first + (last - first) * part // parts
        bottom = first + (last - first) * (part + 1) // parts
        _predict_cells(top, bottom, finest, True, section, scales, told)
