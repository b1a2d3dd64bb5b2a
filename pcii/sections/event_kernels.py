"""Compiled loops over photons: sections, and samples of windows."""

from typing import NamedTuple

import numpy as np

from pcii.base.compiled_loops import shared, threads

BAND_BYTES = 1 << 18
"""Size of a band of a section. It fits in the cache of a core, so that photons are added there and not in
memory; halved or doubled, a section takes a tenth longer at most."""


def bands_of(section: np.ndarray) -> int:
    """Into how many bands of rows a section (H, W, C) is divided among threads."""
    return min(max(threads(), section.nbytes // BAND_BYTES), max(section.shape[0], 1))


@shared(lambda counts, rows, cols, starts, i, j, colour, n, bands: len(counts) * bands)
def scatter(
    first_part: int,
    last_part: int,
    counts: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    starts: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    colour: np.ndarray,
    n: np.ndarray,
    bands: int,
) -> None:
    """Sums of photons per voxel and colour: `counts` (Z, H, W, C), overwritten.

    `rows` (Z, K, h) and `cols` (Z, L, w) are the voxels of the pixels of each camera; `starts` (K L + 1,) is
    where each view's photons begin, which are sorted by row. Each section is divided into `bands_of` it: a
    thread clears a band and adds the photons that fall in it.
    """
    _, height, width, _ = counts.shape
    across = cols.shape[1]
    begin = np.empty(starts.size - 1, np.int64)  # of each view, its first photon that is not yet added
    for part in range(first_part, last_part):
        plane, band = part // bands, part % bands
        first, last = height * band // bands, height * (band + 1) // bands
        counts[plane, first:last, :, :] = 0
        for view in range(starts.size - 1):
            row_of, col_of = rows[plane, view // across], cols[plane, view % across]
            if part == first_part or band == 0:
                low, high = starts[view], starts[view + 1]
                while low < high:  # the first photon at or below the band's first row
                    middle = (low + high) // 2
                    if row_of[i[middle]] < first:
                        low = middle + 1
                    else:
                        high = middle
                begin[view] = low
            e = begin[view]
            while e < starts[view + 1] and row_of[i[e]] < last:
                row, col = row_of[i[e]], col_of[j[e]]
                if 0 <= col < width:
                    counts[plane, row, col, colour[e]] += n[e]
                e += 1
            begin[view] = e


class Samples(NamedTuple):
    """Running statistics of samples that are not zero, (H, W) each, int64 and `squares` float64.

    Their `number`, the `first`, and sums of the others' differences from it and of these squared: the squares
    of large samples themselves would not fit in 64 bits.
    """

    number: np.ndarray
    first: np.ndarray
    difference: np.ndarray
    squares: np.ndarray


@shared(lambda samples, row, col, n, starts, window, bands: bands)
def window_samples(
    first_band: int,
    last_band: int,
    samples: Samples,
    row: np.ndarray,
    col: np.ndarray,
    n: np.ndarray,
    starts: np.ndarray,
    window: int,
    bands: int,
) -> None:
    """Statistics of each window's samples that are not zero, from zeros.

    A sample is the sum of one view's photons in the window of `window` x `window` cells about a cell. `row`,
    `col` and `n` (N,) are the photons' cells and numbers, view v's from `starts[v]` to `starts[v + 1]`. Each
    of the `bands` of rows goes through all photons, so there need be no more than threads. The cost follows
    the photons times the cells of a window.
    """
    number, first, difference, squares = samples
    height, width = number.shape
    above = (window - 1) // 2  # the window of a cell reaches further above and left of it if its size is even
    below = window // 2
    for band in range(first_band, last_band):
        start, stop = height * band // bands, height * (band + 1) // bands
        sample = np.zeros((stop - start, width), np.int64)
        for view in range(starts.size - 1):
            for e in range(starts[view], starts[view + 1]):
                for i in range(max(row[e] - above, start), min(row[e] + below + 1, stop)):
                    for j in range(max(col[e] - above, 0), min(col[e] + below + 1, width)):
                        sample[i - start, j] += n[e]
            for e in range(starts[view], starts[view + 1]):
                for i in range(max(row[e] - above, start), min(row[e] + below + 1, stop)):
                    for j in range(max(col[e] - above, 0), min(col[e] + below + 1, width)):
                        value = sample[i - start, j]
                        if value > 0:  # 0 once this cell's sample has been counted
                            if number[i, j] == 0:
                                first[i, j] = value
                            number[i, j] += 1
                            value -= first[i, j]
                            difference[i, j] += value
                            squares[i, j] += float(value) * float(value)
                            sample[i - start, j] = 0
