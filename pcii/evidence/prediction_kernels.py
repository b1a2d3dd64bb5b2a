"""Compiled: the rate of each photon's own pixel and colour, as all other photons of a section tell it.

Axes: C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import numba as nb
import numpy as np

from pcii.base.compiled_loops import compiled, helper
from pcii.evidence.prediction_types import PlacedEvents, PlaneView, Predicted
from pcii.evidence.projection_kernels import BLOCK_PX, views_of_blocks
from pcii.evidence.smoothing_kernels import CENTRE, centres_around, halved, linear_at, smoothed

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

Scales = tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray], float, np.ndarray, np.ndarray]
"""A section at each scale, smoothed: views and photons (1, H, W), photons by colour (C, H, W); the mean rate;
how many camera rows (2 h,) and columns (2 w,) see each row and column of blocks. Not a named tuple: of such
parallel loops take only their arguments."""


@helper
def _scales(events: PlacedEvents, section: PlaneView, finest: int) -> Scales:
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
            totals, views = halved(totals), halved(views)
        if scale > COLOUR_SCALE:
            counts = halved(counts)
        # A scale that nobody looks at is there in name only.
        whole, by_colour = scale >= finest, scale >= max(COLOUR_SCALE, finest)
        seen.append(smoothed(views if whole else views[:, :1, :1].copy()))
        light.append(smoothed(totals if whole else totals[:, :1, :1].copy()))
        coloured.append(smoothed(counts if by_colour else counts[:, :1, :1].copy()))
    return seen, light, coloured, everywhere, by_row, by_col


@helper
def _predict_events(
    first: int,
    last: int,
    asked: np.ndarray,
    finest: int,
    events: PlacedEvents,
    section: PlaneView,
    scales: Scales,
    predicted: Predicted,
) -> None:
    """The `rate` and `base` of those events from `first` to `last` that are `asked` for (N,)."""
    k, l, i, j, colour, _, weight, cell = events
    rows, cols, _, _, sites, _, prior = section
    seen, light, coloured, everywhere, _, _ = scales
    rate, base, _, _, _ = predicted
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
                    top, bottom, share_i, own_i = centres_around((float(row) + 0.5) * narrow, high)
                    left, right, share_j, own_j = centres_around((float(col) + 0.5) * narrow, wide)
                    own = own_i * own_j * weight[e]
                    there = linear_at(views[0], top, bottom, share_i, left, right, share_j) * sites[c]
                    others = max(linear_at(photons[0], top, bottom, share_i, left, right, share_j) - own, 0.0)
                    if scale >= COLOUR_SCALE:
                        same = max(
                            linear_at(by_colour[c], top, bottom, share_i, left, right, share_j) - own, 0.0
                        )
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
    first: int, last: int, finest: int, sharp: bool, section: PlaneView, scales: Scales, predicted: Predicted
) -> None:
    """The `samples`, `mean` and `blurred` light of the rows from `first` to `last`.

    Block by block, in which rates are linear, and by how many views see each block: so `samples` times `mean`
    is the sum of what events are predicted with over all pixels of the cell, whatever chance made of them.
    If `sharp`, coarser scales are evaluated at the cell's centre instead, as in a picture of the light.
    """
    prior = section.prior_samples
    seen, light, _, everywhere, by_row, by_col = scales
    _, _, samples, mean, blurred = predicted
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
                top, bottom, share_i, _ = centres_around(row * narrow, high)
                for v in range(blocks):
                    if by_col[v] <= 0:
                        continue
                    col = v // 2 * 2 + 1.0 if centred else v + 0.5
                    left, right, share_j, _ = centres_around(col * narrow, wide)
                    there = linear_at(views, top, bottom, share_i, left, right, share_j)
                    others = linear_at(photons, top, bottom, share_i, left, right, share_j)
                    coarsers[v] = (others + prior * coarsers[v]) / max(there + prior, 1e-6)
                    sums[v] += coarsers[v] / SCALES
                    if scale == BASE_SCALE:
                        widest[v] = coarsers[v]
            for v in range(blocks):
                share = by_row[u] * by_col[v] / max(samples[a, v // 2], 1e-6)
                mean[a, v // 2] += share * ((1 - BASE_SHARE) * sums[v] + BASE_SHARE * widest[v])
                blurred[a, v // 2] += share * widest[v]


@helper
def predict(events: PlacedEvents, section: PlaneView, predicted: Predicted) -> None:
    """What a section says of every event and cell. One thread's part."""
    N, h = events.k.size, predicted.mean.shape[0]
    scales = _scales(events, section, 0)
    _predict_events(0, N, np.ones(N, np.bool_), 0, events, section, scales, predicted)
    _predict_cells(0, h, 0, False, section, scales, predicted)


@compiled
def predict_shared(
    parts: int,
    asked: np.ndarray,
    asked_rows: tuple[int, int],
    finest: int,
    events: PlacedEvents,
    section: PlaneView,
    predicted: Predicted,
) -> None:
    """The same, shared among threads in so many `parts`, for those events alone that are `asked` for (N,).

    Light is that at the centres of cells: sharper, but not the sum of what events are predicted with.
    Of cells those in the `asked_rows`, first and last + 1. With `finest` = BASE_SCALE the widest window alone
    is looked at: `base` and `blurred` are right, `rate` and `mean` mean nothing.
    """
    N, (first, last) = events.k.size, asked_rows
    scales = _scales(events, section, finest)
    for part in nb.prange(parts):
        this, beyond = N * part // parts, N * (part + 1) // parts
        _predict_events(this, beyond, asked, finest, events, section, scales, predicted)
        top = first + (last - first) * part // parts
        bottom = first + (last - first) * (part + 1) // parts
        _predict_cells(top, bottom, finest, True, section, scales, predicted)
