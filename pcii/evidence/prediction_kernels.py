"""The rate of each photon's pixel and colour, estimated from all other photons of a section.

Axes: C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import numpy as np

from pcii.base.compiled_loops import compiled, helper, in_threads
from pcii.evidence.cells import BLOCK_PX
from pcii.evidence.prediction_types import PlacedEvents, PlaneView, Predicted, Scales
from pcii.evidence.projection_kernels import views_of_blocks
from pcii.evidence.smoothing_kernels import CENTRE, enclosing_centres, halved, linear_at, smoothed

SCALES = 5
"""Rates are smoothed over 2, 4, 8, 16 and 32 px and averaged: texture may be of any scale."""
COLOUR_SCALE = 3
"""Scales finer than 16 px are estimated from all colours together, in the colours' shares at 16 px."""
COLOUR_PRIOR = 0.3
"""Prior of the colours' shares, in photons: a single photon does not determine the colour of a surface."""
BASE_SCALE = 4
"""The blurred section that predictions are compared with: the rate smoothed over 32 px."""
BASE_SHARE = 0.05
"""Share of the blurred rate in every prediction, so that a single photon in the dark cannot decide."""
BATCH = 512
"""Events that are carried through the scales together."""


def predict(events: PlacedEvents, section: PlaneView, predicted: Predicted) -> None:
    """Writes to `predicted` the rates of all events and cells of a section, in one thread."""
    N, h = events.k.size, predicted.mean.shape[0]
    scales = _scales(events, section, 0)
    _predict_events(0, N, np.ones(N, np.bool_), 0, events, section, scales, predicted)
    _predict_cells(0, h, 0, 0, False, section, scales, predicted)


def predict_shared(
    selected: np.ndarray,
    cell_rows: tuple[int, int],
    finest: int,
    events: PlacedEvents,
    section: PlaneView,
    predicted: Predicted,
) -> None:
    """`predict` shared among threads, for the events that are `selected` (N,) bool.

    Rates of cells are those at their centres: sharper, but not the mean over their pixels. Only cells in the
    rows `cell_rows`, (first, last + 1), are written. With `finest` = BASE_SCALE only the widest window is
    computed: `base` and `blurred` are valid, `rate` and `mean` are not.
    """
    scales = _scales(events, section, finest)
    in_threads(_predict_events, events.k.size, selected, finest, events, section, scales, predicted)
    top, bottom = cell_rows
    in_threads(_predict_cells, bottom - top, top, finest, True, section, scales, predicted)


@compiled
def _scales(events: PlacedEvents, section: PlaneView, finest: int) -> Scales:
    """The section at the scales from `finest` to the coarsest."""
    k, l, i, j, colour, n, weight, cell = events
    rows, cols, H, W, sites, view_share, _ = section
    h, w = view_share.shape
    by_row, by_col = views_of_blocks(rows, H, 2 * h), views_of_blocks(cols, W, 2 * w)
    totals = np.zeros((1, by_row.size, by_col.size))
    # Colours are kept apart at the coarser scales only.
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
            views[0, a, b] = by_row[a] * by_col[b] * view_share[a // 2, b // 2]
    mean_rate = totals.sum() / max(views.sum(), 1e-6)
    views_at = np.empty((SCALES, 1, by_row.size, by_col.size))
    photons_at = np.empty(views_at.shape)
    colours_at = np.empty((SCALES - COLOUR_SCALE, *counts.shape))
    for scale in range(SCALES):
        if scale > 0:
            totals, views = halved(totals), halved(views)
        if scale > COLOUR_SCALE:
            counts = halved(counts)
        if scale >= finest:
            _put(views_at[scale], smoothed(views))
            _put(photons_at[scale], smoothed(totals))
        if scale >= max(COLOUR_SCALE, finest):
            _put(colours_at[scale - COLOUR_SCALE], smoothed(counts))
    return Scales(views_at[:, 0], photons_at[:, 0], colours_at, by_row, by_col, mean_rate)


@helper
def _put(target: np.ndarray, values: np.ndarray) -> None:
    """Writes `values` (C, H, W) to the first rows and columns of `target`."""
    for c in range(values.shape[0]):
        for i in range(values.shape[1]):
            line, row = target[c, i], values[c, i]
            for j in range(row.size):
                line[j] = row[j]


@helper
def _size_at(scale: int, size: int) -> int:
    """How many places of a scale cover so many of the finest."""
    return (size + (1 << scale) - 1) >> scale


@compiled
def _predict_events(
    first: int,
    last: int,
    selected: np.ndarray,
    finest: int,
    events: PlacedEvents,
    section: PlaneView,
    scales: Scales,
    predicted: Predicted,
) -> None:
    """Writes `rate` and `base` of those events from `first` to `last` - 1 that are `selected` (N,) bool."""
    k, l, i, j, colour, _, weight, cell = events
    rows, cols, _, _, sites, _, prior = section
    views_at, photons_at, colours_at, by_row, by_col, mean_rate = scales
    rate, base, _, _, _ = predicted
    share_of_site = sites / sites.sum()
    # Scale by scale for a batch of events, so that one scale at a time is in the cache.
    batch = np.empty(BATCH, np.int64)
    shares, rates, widest, sums = np.empty((4, BATCH), np.float64)
    for begin in range(first, last, BATCH):
        size = 0
        for e in range(begin, min(begin + BATCH, last)):
            batch[size] = e
            size += selected[e] and cell[e] >= 0
            if selected[e] and cell[e] < 0:
                rate[e] = base[e] = 0.0
        for x in range(size):
            c = colour[batch[x]]
            shares[x] = share_of_site[c]
            rates[x] = mean_rate * share_of_site[c] / sites[c]
            sums[x] = 0.0
        for reverse in range(SCALES - finest):
            scale = SCALES - 1 - reverse
            views, photons, by_colour = (
                views_at[scale],
                photons_at[scale],
                colours_at[max(scale - COLOUR_SCALE, 0)],
            )
            high, wide = _size_at(scale, by_row.size), _size_at(scale, by_col.size)
            cells_per_px = 1 / float(BLOCK_PX << scale)
            for x in range(size):
                e = batch[x]
                c = colour[e]
                row, col = i[e] + rows[k[e]], j[e] + cols[l[e]]
                if scale == 0:  # the finest blocks are not interpolated
                    self_weight = CENTRE * CENTRE * weight[e]
                    samples_here = views[row // BLOCK_PX, col // BLOCK_PX] * sites[c]
                    other_photons = max(photons[row // BLOCK_PX, col // BLOCK_PX] - self_weight, 0.0)
                else:
                    top, bottom, share_i, self_i = enclosing_centres((float(row) + 0.5) * cells_per_px, high)
                    left, right, share_j, self_j = enclosing_centres((float(col) + 0.5) * cells_per_px, wide)
                    self_weight = self_i * self_j * weight[e]
                    samples_here = linear_at(views, top, bottom, share_i, left, right, share_j) * sites[c]
                    other_photons = max(
                        linear_at(photons, top, bottom, share_i, left, right, share_j) - self_weight, 0.0
                    )
                    if scale >= COLOUR_SCALE:
                        same = max(
                            linear_at(by_colour[c], top, bottom, share_i, left, right, share_j) - self_weight,
                            0.0,
                        )
                        shares[x] = (same + COLOUR_PRIOR * share_of_site[c]) / (other_photons + COLOUR_PRIOR)
                rates[x] = (other_photons * shares[x] + prior * rates[x]) / max(samples_here + prior, 1e-6)
                sums[x] += rates[x] / SCALES
                if scale == BASE_SCALE:
                    widest[x] = max(rates[x], 1e-12)
        for x in range(size):
            rate[batch[x]] = (1 - BASE_SHARE) * sums[x] + BASE_SHARE * widest[x]
            base[batch[x]] = widest[x]


@compiled
def _predict_cells(
    first: int,
    last: int,
    top: int,
    finest: int,
    sharp: bool,
    section: PlaneView,
    scales: Scales,
    predicted: Predicted,
) -> None:
    """Writes `samples`, `mean` and `blurred` of the rows of cells from `first` to `last` - 1 below `top`.

    Mean over blocks, in each of which rates are linear, weighted by the views that cover it: so `samples`
    times `mean` is the sum of the rates that `_predict_events` gives the pixels of the cell, wherever events
    are. If `sharp`, coarser scales are evaluated at the centre of the cell instead, as in a picture.
    """
    prior = section.prior_samples
    views_at, photons_at, _, by_row, by_col, mean_rate = scales
    _, _, samples, mean, blurred = predicted
    blocks = by_col.size
    rates, sums, widest = np.zeros((3, blocks), np.float64)
    for a in range(top + first, top + last):
        for b in range(mean.shape[1]):
            samples[a, b] = (by_row[2 * a] + by_row[2 * a + 1]) * (by_col[2 * b] + by_col[2 * b + 1])
            mean[a, b] = blurred[a, b] = 0.0
        for u in range(2 * a, 2 * a + 2):
            if by_row[u] <= 0:
                continue
            rates[:] = mean_rate
            sums[:] = 0.0
            for reverse in range(SCALES - finest):
                scale = SCALES - 1 - reverse
                views, photons = views_at[scale], photons_at[scale]
                high, wide = _size_at(scale, by_row.size), _size_at(scale, by_col.size)
                cells_per_block, centred = 1 / float(1 << scale), sharp and scale > 0
                row = 2 * a + 1.0 if centred else u + 0.5
                top, bottom, share_i, _ = enclosing_centres(row * cells_per_block, high)
                for v in range(blocks):
                    if by_col[v] <= 0:
                        continue
                    col = v // 2 * 2 + 1.0 if centred else v + 0.5
                    left, right, share_j, _ = enclosing_centres(col * cells_per_block, wide)
                    samples_here = linear_at(views, top, bottom, share_i, left, right, share_j)
                    other_photons = linear_at(photons, top, bottom, share_i, left, right, share_j)
                    rates[v] = (other_photons + prior * rates[v]) / max(samples_here + prior, 1e-6)
                    sums[v] += rates[v] / SCALES
                    if scale == BASE_SCALE:
                        widest[v] = rates[v]
            for v in range(blocks):
                share = by_row[u] * by_col[v] / max(samples[a, v // 2], 1e-6)
                mean[a, v // 2] += share * ((1 - BASE_SHARE) * sums[v] + BASE_SHARE * widest[v])
                blurred[a, v // 2] += share * widest[v]
