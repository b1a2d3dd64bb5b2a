"""Compiled loops: sums of whole images and of single photons, squared deviations, samples, demosaicing.

Images (V, H, N), N columns times channels, are added to running sums of groups of images, (G, H, N)
float64: `total`, `squares` and `first`. If variances are wanted, `total` has sums of differences from the
`first` sample, which is NaN where there is none yet, and `squares` those of these differences squared; else
`total` has sums of the samples and the other two are None: what is done with them is not compiled.

`moves` are four arrays: the images (M,) in the order in which they are added, group after group; by how many
rows (M,) and by how many columns times channels (M,) each is moved; and where each group ends (G,).
"""

from typing import NamedTuple

import numpy as np

from pcii.base import helper, shared, threads

BAND = 16
"""Rows of a section that images are added to at a time: their sums stay in the cache."""
BAND_BYTES = 1 << 18
"""Size of a band of a section. It fits in the cache of a core, so that photons are added there and not in
memory; halved or doubled, a section takes a tenth longer at most."""


@shared(lambda images: len(images))
def are_finite(first: int, last: int, images: np.ndarray) -> bool:
    """Whether no pixel of images (V, H, N) is NaN or infinite."""
    bad = 0
    for view in range(first, last):
        for row in range(images.shape[1]):
            for x in range(images.shape[2]):
                bad += not np.isfinite(images[view, row, x])
    return bad == 0


@shared(lambda total, *_: -(-total.shape[1] // BAND))
def add_views(
    first_band: int,
    last_band: int,
    total: np.ndarray,
    squares: np.ndarray | None,
    first: np.ndarray | None,
    images: np.ndarray,
    moves: tuple[np.ndarray, ...],
) -> None:
    """Add shifted images (V, H, N) to the running sums of their groups.

    The rows of an image are read in the order in which they lie in memory.
    """
    _, height, width = images.shape
    source, row_shift, col_shift, ends = moves
    for band in range(first_band, last_band):
        top, bottom = band * BAND, min((band + 1) * BAND, height)
        begin = 0
        for g in range(ends.size):
            if first is not None:
                for row in range(top, bottom):
                    _find_first(first[g, row], images, row, moves, begin, ends[g])
            for m in range(begin, ends[g], 4):
                four = np.arange(m, min(m + 4, ends[g]))
                for row in range(top, bottom):
                    if squares is not None and first is not None:
                        running_row = total[g, row], squares[g, row], first[g, row]
                        _add_deviations_of_four(running_row, images, row, moves, four)
                        continue
                    for n in four:
                        at, shift = row - row_shift[n], col_shift[n]
                        low, high = max(0, shift), min(width, width + shift)
                        if 0 <= at < height and low < high:
                            _add(total[g, row, low:high], images[source[n], at, low - shift : high - shift])
            begin = ends[g]


@shared(lambda total, image, *_: len(image))
def add_fine(
    first_row: int,
    last_row: int,
    total: np.ndarray,
    image: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    cells: np.ndarray,
) -> None:
    """Add one image (H, W, N) to sums on finer voxels (H M, W M, C).

    Pixel (i, j) belongs to voxel (`rows[i]`, `cols[j]`): no two of an image to the same. `cells` (2, 2) are
    the colours of a mosaic's Bayer cells, empty where every pixel holds all colours.
    """
    height, width, _ = total.shape
    for i in range(first_row, last_row):
        row = rows[i]
        if row < 0 or row >= height:
            continue
        for j in range(image.shape[1]):
            if 0 <= cols[j] < width:
                for channel in range(image.shape[2]):
                    colour = cells[i % 2, j % 2] if cells.size else channel
                    total[row, cols[j], colour] += image[i, j, channel]


@helper
def _find_first(first, images, row, moves, from_move, to_move) -> None:
    """Set `first` to the first sample of each voxel of a row that has none yet."""
    _, height, width = images.shape
    source, row_shift, col_shift, _ = moves
    begin = end = 0  # the run of voxels that are known to have one
    for m in range(from_move, to_move):
        at, shift = row - row_shift[m], col_shift[m]
        low, high = max(0, shift), min(width, width + shift)
        if at < 0 or at >= height or low >= high:
            continue
        values = images[source[m], at]
        if begin == end or low > end or high < begin:
            _fill(first, values, shift, low, high)
            if begin == end:
                begin, end = low, high
            continue
        _fill(first, values, shift, low, begin)
        _fill(first, values, shift, end, high)
        begin, end = min(begin, low), max(end, high)


@helper
def _fill(first, values, shift, low, high) -> None:
    for x in range(low, high):
        first[x] = first[x] if first[x] == first[x] else values[x - shift]


@helper
def _add(total, values) -> None:
    for x in range(total.size):
        total[x] += values[x]


@helper
def _add_deviations(running_row, values, shift, start, stop) -> None:
    """Add one image's row, moved by `shift`, to the running sums of the voxels `start` to `stop` of a row."""
    total, squares, first = running_row
    low, high = max(start, shift, 0), min(stop, values.size + shift, values.size)
    for x in range(low, high):
        difference = values[x - shift] - first[x]
        total[x] += difference
        squares[x] += difference * difference


@helper
def _add_deviations_of_four(running_row, images, row, moves, four) -> None:
    """Add the rows of up to four images, in one pass where all have samples: sums are loaded less often."""
    total, squares, first = running_row
    source, row_shift, col_shift, _ = moves
    _, height, width = images.shape
    low, high, reaching = 0, width, 0
    for m in four:
        low, high = max(low, col_shift[m]), min(high, width + col_shift[m])
        reaching += 0 <= row - row_shift[m] < height
    if reaching < 4 or low >= high:
        low = high = width
    for m in four:
        at = row - row_shift[m]
        if 0 <= at < height:
            values = images[source[m], at]
            _add_deviations(running_row, values, col_shift[m], 0, low)
            _add_deviations(running_row, values, col_shift[m], high, width)
    if low >= high:
        return
    m, n, o, p = four[0], four[1], four[2], four[3]
    a = images[source[m], row - row_shift[m], low - col_shift[m] : high - col_shift[m]]
    b = images[source[n], row - row_shift[n], low - col_shift[n] : high - col_shift[n]]
    c = images[source[o], row - row_shift[o], low - col_shift[o] : high - col_shift[o]]
    d = images[source[p], row - row_shift[p], low - col_shift[p] : high - col_shift[p]]
    total, squares, first = total[low:high], squares[low:high], first[low:high]
    for x in range(high - low):
        s, t, u, v = a[x] - first[x], b[x] - first[x], c[x] - first[x], d[x] - first[x]
        total[x] += (s + t) + (u + v)
        squares[x] += (s * s + t * t) + (u * u + v * v)


@shared(lambda green, *_: len(green))
def interpolate_green(first: int, last: int, green: np.ndarray, raw: np.ndarray, cells: np.ndarray) -> None:
    """Green at every pixel of a mosaic (H, W): Eqs. 4 and 5 of Muniraj et al. 2017.

    `cells` (2, 2) are the colours of the Bayer cells. The image is continued by reflection about its border
    pixels.
    """
    height, width = raw.shape
    for i in range(first, last):
        row, above, below = raw[i], raw[_reflected(i - 1, height)], raw[_reflected(i + 1, height)]
        far_above, far_below = raw[_reflected(i - 2, height)], raw[_reflected(i + 2, height)]
        for parity in range(2):
            if cells[i % 2, parity] == 1:
                for j in range(parity, width, 2):
                    green[i, j] = row[j]
                continue
            for j in range(parity, width, 2):
                if 2 <= j < width - 2:
                    left, right, far_left, far_right = row[j - 1], row[j + 1], row[j - 2], row[j + 2]
                else:
                    left, right = row[_reflected(j - 1, width)], row[_reflected(j + 1, width)]
                    far_left, far_right = row[_reflected(j - 2, width)], row[_reflected(j + 2, width)]
                alpha = abs((far_left + far_right) / 2 - row[j])
                beta = abs((far_above[j] + far_below[j]) / 2 - row[j])
                if alpha < beta:
                    green[i, j] = (left + right) / 2
                elif alpha > beta:
                    green[i, j] = (above[j] + below[j]) / 2
                else:  # rare in photographs, but usual for photon counts, most of which are 0
                    green[i, j] = (above[j] + left + right + below[j]) / 4


@shared(lambda image, *_: len(image))
def interpolate_chroma(
    first: int, last: int, image: np.ndarray, green: np.ndarray, raw: np.ndarray, cells: np.ndarray
) -> None:
    """Colours (H, W, 3) from a mosaic and its green: Eq. 6, differences from green at their own sites."""
    height, width = raw.shape
    for i in range(first, last):
        up, down = _reflected(i - 1, height), _reflected(i + 1, height)
        for parity in range(2):
            colour, row_colour = cells[i % 2, parity], cells[i % 2, 1 - parity]
            column_colour = cells[1 - i % 2, parity]
            for j in range(parity, width, 2):
                left, right = j - 1, j + 1
                if j == 0 or j == width - 1:
                    left, right = _reflected(left, width), _reflected(right, width)
                green_here = green[i, j]
                image[i, j, 1] = green_here
                if colour == 1:
                    horizontal = (raw[i, left] - green[i, left]) + (raw[i, right] - green[i, right])
                    vertical = (raw[up, j] - green[up, j]) + (raw[down, j] - green[down, j])
                    image[i, j, row_colour] = horizontal / 2 + green_here
                    image[i, j, column_colour] = vertical / 2 + green_here
                else:
                    above = (raw[up, left] - green[up, left]) + (raw[up, right] - green[up, right])
                    diagonal = above + (raw[down, left] - green[down, left])
                    diagonal += raw[down, right] - green[down, right]
                    image[i, j, colour] = raw[i, j]
                    image[i, j, 2 - colour] = diagonal / 4 + green_here


@helper
def _reflected(index: int, size: int) -> int:
    """The index inside 0 .. size-1 that stands for this one under reflection about the border pixels."""
    while index < 0 or index >= size:
        index = -index if index < 0 else 2 * (size - 1) - index
    return index


# Photons


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
