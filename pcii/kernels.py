"""Compiled loops over photons and pixels (Numba, which needs no system library).

Imported where a loop is about to run and not with the package: loading the compiler takes longer than all
else. Compiled code is kept beside this file, or in the user's cache where that is not writable, so each
loop is compiled once per machine.
"""

import numba as nb
import numpy as np

compiled = nb.njit(parallel=True, nogil=True, cache=True)


def threads() -> int:
    """How many a loop is shared among."""
    return nb.get_num_threads()


@compiled
def scatter(
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

    `rows` (Z, K, h) and `cols` (Z, L, w) say where each pixel of each camera belongs; `starts` (K L + 1,)
    where each view's photons begin, which are sorted by row. The sections are cut into `bands` of rows
    each; a thread clears a band and looks through the photons that fall there.
    """
    planes, height, width, _ = counts.shape
    across = cols.shape[1]
    for part in nb.prange(planes * bands):
        plane, band = part // bands, part % bands
        first, last = height * band // bands, height * (band + 1) // bands
        counts[plane, first:last] = 0
        for view in range(starts.size - 1):
            row_of, col_of = rows[plane, view // across], cols[plane, view % across]
            low, high = starts[view], starts[view + 1]
            while low < high:  # the first photon at or below the band's first row
                middle = (low + high) // 2
                if row_of[i[middle]] < first:
                    low = middle + 1
                else:
                    high = middle
            for e in range(low, starts[view + 1]):
                row = row_of[i[e]]
                if row >= last:
                    break
                col = col_of[j[e]]
                if 0 <= col < width:
                    counts[plane, row, col, colour[e]] += n[e]


@compiled
def copy_rows(target: np.ndarray, kinds: np.ndarray, rows: np.ndarray) -> None:
    """Each row of `target` (N, M) is one of the few `rows` (P, M), by its `kinds` (N,)."""
    for row in nb.prange(target.shape[0]):
        target[row] = rows[kinds[row]]


BAND = 8
"""Rows of a section that are summed at a time when all views are at hand: their sums stay in the cache."""


@compiled
def sum_views(
    sums: np.ndarray,
    variance: np.ndarray,
    images: np.ndarray,
    row_shift: np.ndarray,
    col_shift: np.ndarray,
    order: np.ndarray,
    ends: np.ndarray,
    by_row: np.ndarray,
    by_col: np.ndarray,
    phases: np.ndarray,
) -> bool:
    """A section of images that are all at hand: `add_views` and `merge_groups` band by band.

    Returns whether all sums are finite.
    """
    height, width = images.shape[1:]
    bad = 0
    for band in nb.prange((height + BAND - 1) // BAND):
        top = band * BAND
        bottom = min(top + BAND, height)
        shape = (ends.size, bottom - top, width)
        total = np.zeros(shape)
        squares, first = np.zeros(shape if variance.size else (0, 0, 0)), np.zeros((0, 0, 0))
        if variance.size:
            first = np.full(shape, np.nan)
        told = variance[top:bottom] if variance.size else variance
        for line in range(bottom - top):
            _add_line(total, squares, first, images, row_shift, col_shift, order, ends, top, line)
            bad += _not_finite(total[:, line])
            _merge_line(sums[top:bottom], told, total, squares, first, by_row, by_col, phases, top, line)
    return bad == 0


@compiled
def add_views(
    total: np.ndarray,
    squares: np.ndarray,
    first: np.ndarray,
    images: np.ndarray,
    row_shift: np.ndarray,
    col_shift: np.ndarray,
    order: np.ndarray,
    ends: np.ndarray,
) -> None:
    """Add shifted images to running sums of their groups.

    `images` (V, H, N), N columns times channels; `row_shift` (V,), `col_shift` (V,) in columns times
    channels; `order` (V,) lists the views group after group, group g up to `ends[g]`. `total` and
    `squares` (G, H, N) sum differences from the `first` sample of each place, NaN before there is one;
    `squares` may be empty, then the samples themselves are summed.
    """
    for line in nb.prange(total.shape[1]):
        _add_line(total, squares, first, images, row_shift, col_shift, order, ends, 0, line)


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


@nb.njit(nogil=True, cache=True)
def _not_finite(values) -> int:
    found = 0
    for g in range(values.shape[0]):
        for x in range(values.shape[1]):
            found += not np.isfinite(values[g, x])
    return found


@nb.njit(nogil=True, cache=True)
def _add_line(total, squares, first, images, row_shift, col_shift, order, ends, top, line):
    """Add what all images have for one row of the section, `line` rows below `top`."""
    _, height, width = images.shape
    row, begin = top + line, 0
    for g in range(ends.size):
        if squares.size:
            _find_first(first[g, line], images, row, row_shift, col_shift, order[begin : ends[g]])
        for v in order[begin : ends[g]]:
            source = row - row_shift[v]
            if source < 0 or source >= height:
                continue
            shift = col_shift[v]
            low, high = max(0, shift), min(width, width + shift)
            if low >= high:
                continue
            values = images[v, source, low - shift : high - shift]
            sums = total[g, line, low:high]
            if squares.size:
                _add_spread(sums, squares[g, line, low:high], first[g, line, low:high], values)
            else:
                _add(sums, values)
        begin = ends[g]


@nb.njit(nogil=True, cache=True)
def _find_first(first, images, row, row_shift, col_shift, views) -> None:
    """Take the first sample of each place of a row that has none yet."""
    _, height, width = images.shape
    begin = end = 0  # the run of places that are known to have one
    for v in views:
        source, shift = row - row_shift[v], col_shift[v]
        low, high = max(0, shift), min(width, width + shift)
        if source < 0 or source >= height or low >= high:
            continue
        if begin == end or low > end or high < begin:
            _fill(first, images[v, source], shift, low, high)
            if begin == end:
                begin, end = low, high
            continue
        _fill(first, images[v, source], shift, low, begin)
        _fill(first, images[v, source], shift, end, high)
        begin, end = min(begin, low), max(end, high)


@nb.njit(nogil=True, cache=True)
def _fill(first, values, shift, low, high) -> None:
    for x in range(low, high):
        first[x] = first[x] if first[x] == first[x] else values[x - shift]


@nb.njit(nogil=True, cache=True)
def _add(total, values) -> None:
    for x in range(total.size):
        total[x] += values[x]


@nb.njit(nogil=True, cache=True)
def _add_spread(total, squares, first, values) -> None:
    for x in range(total.size):
        difference = values[x] - first[x]
        total[x] += difference
        squares[x] += difference * difference


@compiled
def finite_beside(images: np.ndarray, row_shift: np.ndarray, col_shift: np.ndarray) -> bool:
    """Whether what falls beside the section is finite; shapes as for `add_views`."""
    views, height, width = images.shape
    bad = 0
    for v in nb.prange(views):
        down, right = row_shift[v], col_shift[v]
        found = 0
        for row in range(height):
            outside = not 0 <= row + down < height
            for x in range(width if outside else min(max(-right, 0), width)):
                found += not np.isfinite(images[v, row, x])
            for x in range(max(width - right, 0), 0 if outside else width):
                found += not np.isfinite(images[v, row, x])
        bad += found
    return bad == 0


@nb.njit(nogil=True, cache=True)
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


@nb.njit(nogil=True, cache=True)
def _spread(total, squares, inverse) -> float:
    """Sum of squared deviations from the mean, of 1 / `inverse` numbers of this sum and sum of squares."""
    return max(squares - total * total * inverse, 0.0)


@compiled
def interpolate_green(green: np.ndarray, raw: np.ndarray, cells: np.ndarray) -> None:
    """Green at every pixel of a mosaic (H, W): Eqs. 4 and 5 of Muniraj et al. 2017.

    `cells` (2, 2) are the colours of the Bayer cells. The image goes on by reflection about its border
    pixels.
    """
    height, width = raw.shape
    for i in nb.prange(height):
        here, above, below = raw[i], raw[_reflected(i - 1, height)], raw[_reflected(i + 1, height)]
        far_above, far_below = raw[_reflected(i - 2, height)], raw[_reflected(i + 2, height)]
        for parity in range(2):
            if cells[i % 2, parity] == 1:
                for j in range(parity, width, 2):
                    green[i, j] = here[j]
                continue
            for j in range(parity, width, 2):
                if 2 <= j < width - 2:
                    left, right, far_left, far_right = here[j - 1], here[j + 1], here[j - 2], here[j + 2]
                else:
                    left, right = here[_reflected(j - 1, width)], here[_reflected(j + 1, width)]
                    far_left, far_right = here[_reflected(j - 2, width)], here[_reflected(j + 2, width)]
                alpha = abs((far_left + far_right) / 2 - here[j])
                beta = abs((far_above[j] + far_below[j]) / 2 - here[j])
                if alpha < beta:
                    green[i, j] = (left + right) / 2
                elif alpha > beta:
                    green[i, j] = (above[j] + below[j]) / 2
                else:  # a corner case for photographs, the usual case for photon counts: most are 0
                    green[i, j] = (above[j] + left + right + below[j]) / 4


@compiled
def interpolate_chroma(image: np.ndarray, green: np.ndarray, raw: np.ndarray, cells: np.ndarray) -> None:
    """Colours (H, W, 3) from a mosaic and its green: Eq. 6, differences from green at their own sites."""
    height, width = raw.shape
    for i in nb.prange(height):
        up, down = _reflected(i - 1, height), _reflected(i + 1, height)
        for parity in range(2):
            own, beside = cells[i % 2, parity], cells[i % 2, 1 - parity]
            across = cells[1 - i % 2, parity]
            for j in range(parity, width, 2):
                left, right = j - 1, j + 1
                if j == 0 or j == width - 1:
                    left, right = _reflected(left, width), _reflected(right, width)
                here = green[i, j]
                image[i, j, 1] = here
                if own == 1:
                    horizontal = (raw[i, left] - green[i, left]) + (raw[i, right] - green[i, right])
                    vertical = (raw[up, j] - green[up, j]) + (raw[down, j] - green[down, j])
                    image[i, j, beside] = horizontal / 2 + here
                    image[i, j, across] = vertical / 2 + here
                else:
                    above = (raw[up, left] - green[up, left]) + (raw[up, right] - green[up, right])
                    diagonal = above + (raw[down, left] - green[down, left])
                    diagonal += raw[down, right] - green[down, right]
                    image[i, j, own] = raw[i, j]
                    image[i, j, 2 - own] = diagonal / 4 + here


@nb.njit(nogil=True, cache=True)
def _reflected(index: int, size: int) -> int:
    """The index inside 0 .. size-1 that stands for this one under reflection about the border pixels."""
    while index < 0 or index >= size:
        index = -index if index < 0 else 2 * (size - 1) - index
    return index
