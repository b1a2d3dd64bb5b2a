"""Compiled loops that add up whole images, with their variances."""

import numba as nb
import numpy as np

from pcii.core.compiled_loops import compiled, helper

BAND = 16
"""Rows of a section that are summed at a time when all views are at hand: their sums stay in the cache."""


@compiled
def sum_views(
    sums: np.ndarray,
    variance: np.ndarray,
    images: np.ndarray,
    source: np.ndarray,
    row_shift: np.ndarray,
    col_shift: np.ndarray,
    weight: np.ndarray,
    ends: np.ndarray,
    by_row: np.ndarray,
    by_col: np.ndarray,
    phases: np.ndarray,
) -> bool:
    """A section of images that are all at hand: `add_views` and `merge_groups` band by band.

    Returns whether all sums and all images are finite.
    """
    height, width = images.shape[1:]
    bad = _bad_rows(images, source, row_shift)
    for band in nb.prange((height + BAND - 1) // BAND):
        top = band * BAND
        bottom = min(top + BAND, height)
        shape = (ends.size, bottom - top, width)
        total = np.zeros(shape)
        squares, first = np.zeros(shape if variance.size else (0, 0, 0)), np.zeros((0, 0, 0))
        if variance.size:
            first = np.full(shape, np.nan)
        told = variance[top:bottom] if variance.size else variance
        rows = top, 0, bottom - top
        bad += _add_rows(total, squares, first, images, source, row_shift, col_shift, weight, ends, *rows)
        for line in range(bottom - top):
            bad += _not_finite(total[:, line])
            _merge_line(sums[top:bottom], told, total, squares, first, by_row, by_col, phases, top, line)
    return bad == 0


@compiled
def add_views(
    total: np.ndarray,
    squares: np.ndarray,
    first: np.ndarray,
    images: np.ndarray,
    source: np.ndarray,
    row_shift: np.ndarray,
    col_shift: np.ndarray,
    weight: np.ndarray,
    ends: np.ndarray,
) -> bool:
    """Add shifted images to running sums of their groups.

    `images` (V, H, N), N columns times channels. Move m (M,) adds image `source[m]`, moved by `row_shift[m]`
    and `col_shift[m]` (in columns times channels), times `weight[m]`; moves come group after group, group g
    up to `ends[g]`. `total` and `squares` (G, H, N) sum differences from the `first` sample of each place,
    NaN before there is one; `squares` may be empty, then the samples themselves are summed. Returns whether
    all pixels that fall beside the section are finite.
    """
    bad = _bad_rows(images, source, row_shift)
    for band in nb.prange((total.shape[1] + BAND - 1) // BAND):
        rows = 0, band * BAND, min((band + 1) * BAND, total.shape[1])
        bad += _add_rows(total, squares, first, images, source, row_shift, col_shift, weight, ends, *rows)
    return bad == 0


@compiled
def add_fine(
    total: np.ndarray,
    squares: np.ndarray,
    first: np.ndarray,
    image: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    cells: np.ndarray,
) -> None:
    """Add one image (H, W, N) to running sums (H M, W M, C) on finer voxels, as `add_views` does.

    Pixel (i, j) belongs to voxel (`rows[i]`, `cols[j]`): no two of an image to the same. `cells` (2, 2) are
    the colours of a mosaic's Bayer cells, empty where every pixel holds all colours.
    """
    height, width, _ = total.shape
    for i in nb.prange(image.shape[0]):
        row = rows[i]
        if row < 0 or row >= height:
            continue
        for j in range(image.shape[1]):
            col = cols[j]
            if col < 0 or col >= width:
                continue
            for channel in range(image.shape[2]):
                colour = cells[i % 2, j % 2] if cells.size else channel
                value = image[i, j, channel]
                if squares.size:
                    if np.isnan(first[row, col, colour]):
                        first[row, col, colour] = value
                    value -= first[row, col, colour]
                    squares[row, col, colour] += value * value
                total[row, col, colour] += value


@compiled
def merge_groups(
    sums: np.ndarray,
    variance: np.ndarray,
    total: np.ndarray,
    squares: np.ndarray,
    first: np.ndarray,
    by_row: np.ndarray,
    by_col: np.ndarray,
    phases: np.ndarray,
) -> bool:
    """Sums and, if asked for, variances (H, W, C) from the running sums of the groups.

    Group 2 p + q of a mosaic are the views whose row and column shifts have the parities p and q, so that
    all of its samples at a voxel have one colour; `by_row` (2, H) and `by_col` (2, W) are how many rows and
    columns of cameras these are. `phases` (4, 2) are the Bayer cells of red, blue and twice green, and
    empty where every pixel holds all colours and there is one group. Returns whether all sums are finite.
    """
    bad = 0
    for line in nb.prange(sums.shape[0]):
        bad += _not_finite(total[:, line])
        _merge_line(sums, variance, total, squares, first, by_row, by_col, phases, 0, line)
    return bad == 0


@helper
def _not_finite(values) -> int:
    found = 0
    for g in range(values.shape[0]):
        for x in range(values.shape[1]):
            found += not np.isfinite(values[g, x])
    return found


@helper
def _add_rows(total, squares, first, images, source, row_shift, col_shift, weight, ends, top, start, stop):
    """Add what all images have for `start` to `stop` of the rows of a section that begin at row `top`.

    An image's rows are read one after the other, which memory is good at. Returns how many pixels of these
    rows are not finite and fall beside the section.
    """
    _, height, width = images.shape
    begin = bad = 0
    for g in range(ends.size):
        if squares.size:
            for line in range(start, stop):
                _find_first(first[g, line], images, top + line, source, row_shift, col_shift, begin, ends[g])
        for m in range(begin, ends[g], 4):
            four = np.arange(m, min(m + 4, ends[g]))
            for line in range(start, stop):
                row = top + line
                for n in four:
                    if 0 <= row - row_shift[n] < height:
                        bad += _bad_beside(images[source[n], row - row_shift[n]], col_shift[n])
                if squares.size:
                    own = total[g, line], squares[g, line], first[g, line]
                    _add_spreads(own, images, row, source, row_shift, col_shift, four)
                    continue
                for n in four:
                    at, shift = row - row_shift[n], col_shift[n]
                    low, high = max(0, shift), min(width, width + shift)
                    if 0 <= at < height and low < high:
                        values = images[source[n], at, low - shift : high - shift]
                        _add(total[g, line, low:high], values, weight[n])
        begin = ends[g]
    return bad


@helper
def _find_first(first, images, row, source, row_shift, col_shift, from_move, to_move) -> None:
    """Take the first sample of each place of a row that has none yet."""
    _, height, width = images.shape
    begin = end = 0  # the run of places that are known to have one
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
def _add(total, values, weight) -> None:
    for x in range(total.size):
        total[x] += weight * values[x]


@helper
def _add_spread(own, values, shift, start, stop) -> None:
    """Add one image's row, moved by `shift`, to what the places `start` to `stop` of a row have."""
    total, squares, first = own
    low, high = max(start, shift, 0), min(stop, values.size + shift, values.size)
    for x in range(low, high):
        difference = values[x - shift] - first[x]
        total[x] += difference
        squares[x] += difference * difference


@helper
def _add_spreads(own, images, row, source, row_shift, col_shift, moves) -> None:
    """The same of some images; where four are, all at once: what the places have is fetched less often."""
    total, squares, first = own
    _, height, width = images.shape
    low, high, seen = 0, width, 0
    for m in moves:
        low, high = max(low, col_shift[m]), min(high, width + col_shift[m])
        seen += 0 <= row - row_shift[m] < height
    if seen < 4 or low >= high:
        low = high = width
    for m in moves:
        at = row - row_shift[m]
        if 0 <= at < height:
            values = images[source[m], at]
            _add_spread(own, values, col_shift[m], 0, low)
            _add_spread(own, values, col_shift[m], high, width)
    if low >= high:
        return
    m, n, o, p = moves[0], moves[1], moves[2], moves[3]
    a = images[source[m], row - row_shift[m], low - col_shift[m] : high - col_shift[m]]
    b = images[source[n], row - row_shift[n], low - col_shift[n] : high - col_shift[n]]
    c = images[source[o], row - row_shift[o], low - col_shift[o] : high - col_shift[o]]
    d = images[source[p], row - row_shift[p], low - col_shift[p] : high - col_shift[p]]
    total, squares, first = total[low:high], squares[low:high], first[low:high]
    for x in range(high - low):
        s, t, u, v = a[x] - first[x], b[x] - first[x], c[x] - first[x], d[x] - first[x]
        total[x] += (s + t) + (u + v)
        squares[x] += (s * s + t * t) + (u * u + v * v)


@helper
def _bad_beside(values, shift) -> int:
    """How many of a row's pixels are not finite and fall beside the section; the others show in its sums."""
    bad = 0
    for x in range(min(max(-shift, 0), values.size)):
        bad += not np.isfinite(values[x])
    for x in range(max(values.size - shift, 0), values.size):
        bad += not np.isfinite(values[x])
    return bad


@helper
def _bad_rows(images, source, row_shift) -> int:
    """The same of the rows that are moved above or below the section."""
    height, bad = images.shape[1], 0
    for m in range(source.size):
        for row in range(min(max(-row_shift[m], 0), height)):
            bad += _bad_beside(images[source[m], row], images.shape[2])
        for row in range(max(height - row_shift[m], 0), height):
            bad += _bad_beside(images[source[m], row], images.shape[2])
    return bad


@helper
def _merge_line(sums, variance, total, squares, first, by_row, by_col, phases, top, line):
    """One row of `merge_groups`; groups of one colour are merged as by Chan, Golub and LeVeque 1983."""
    _, width, channels = sums.shape
    row = top + line
    if not phases.size:
        rows = by_row[0, row] + by_row[1, row]
        for col in range(width):
            n = rows * (by_col[0, col] + by_col[1, col])
            inverse, unbiased = 1 / max(n, 1), 1 / max(n - 1, 1)
            for colour in range(channels):
                place = col * channels + colour
                whole = total[0, line, place]
                if variance.size:
                    spread = _spread(whole, squares[0, line, place], inverse)
                    variance[line, col, colour] = spread * unbiased
                    whole += first[0, line, place] * n if n > 0 else 0.0
                sums[line, col, colour] = whole
        return
    for parity in range(2):
        for phase in range(2):  # red and blue have one group at each voxel
            p, q = (row + phases[phase, 0]) % 2, (parity + phases[phase, 1]) % 2
            rows, colour, g = by_row[p, row], 2 * phase, 2 * p + q
            for col in range(parity, width, 2):
                whole, n = total[g, line, col], rows * by_col[q, col]
                if variance.size:
                    spread = _spread(whole, squares[g, line, col], 1 / max(n, 1))
                    variance[line, col, colour] = spread / max(n - 1, 1)
                    whole += first[g, line, col] * n if n > 0 else 0.0
                sums[line, col, colour] = whole
        p, q = (row + phases[2, 0]) % 2, (parity + phases[2, 1]) % 2
        g, h = 2 * p + q, 3 - 2 * p - q  # the two green cells lie across from each other
        for col in range(parity, width, 2):
            n, m = by_row[p, row] * by_col[q, col], by_row[1 - p, row] * by_col[1 - q, col]
            a, b = total[g, line, col], total[h, line, col]
            whole = a + b
            if variance.size:
                inverse, other = 1 / max(n, 1), 1 / max(m, 1)
                spread = _spread(a, squares[g, line, col], inverse) + _spread(b, squares[h, line, col], other)
                own = first[g, line, col] if n > 0 else 0.0
                across = first[h, line, col] if m > 0 else 0.0
                apart = (across - own) + (b * other - a * inverse)
                spread += apart * apart * (n * m / max(n + m, 1))
                variance[line, col, 1] = spread / max(n + m - 1, 1)
                whole += own * n + across * m
            sums[line, col, 1] = whole


@helper
def _spread(total, squares, inverse) -> float:
    """Sum of squared deviations from the mean, of 1 / `inverse` numbers of this sum and sum of squares."""
    return max(squares - total * total * inverse, 0.0)
