"""Compiled functions for one row of a section: sums of shifted images, and of their squared deviations.

`moves` are `Moves` and `groups` are `Groups` of `image_moves`. Running sums of groups of images are `total`,
`squares` and `first`, (G, H, N) float64, N columns times channels: sums of the samples or, if variances are
wanted, of their differences from the `first` one, which is NaN where there is none yet, and of these
differences squared. Else the last two are None, and so is `variance`: what is done with them is not compiled.
"""

import numpy as np

from pcii.base.compiled_loops import helper


@helper
def not_finite(values) -> int:
    """How many of the values (G, N) are NaN or infinite."""
    found = 0
    for g in range(values.shape[0]):
        for x in range(values.shape[1]):
            found += not np.isfinite(values[g, x])
    return found


@helper
def add_rows(total, squares, first, images, moves, top, start, stop) -> int:
    """Add all images to the rows `start` to `stop` of a band of a section that begins at row `top`.

    The rows of an image are read in the order in which they lie in memory. Returns how many pixels of these
    rows are not finite and fall outside the section.
    """
    _, height, width = images.shape
    source, row_shift, col_shift, ends = moves
    begin = bad = 0
    for g in range(ends.size):
        if squares is not None:
            for line in range(start, stop):
                _find_first(first[g, line], images, top + line, moves, begin, ends[g])
        for m in range(begin, ends[g], 4):
            four = np.arange(m, min(m + 4, ends[g]))
            for line in range(start, stop):
                row = top + line
                for n in four:
                    if 0 <= row - row_shift[n] < height:
                        bad += _bad_outside(images[source[n], row - row_shift[n]], col_shift[n])
                if squares is not None:
                    running_row = total[g, line], squares[g, line], first[g, line]
                    _add_deviations_of_four(running_row, images, row, moves, four)
                    continue
                for n in four:
                    at, shift = row - row_shift[n], col_shift[n]
                    low, high = max(0, shift), min(width, width + shift)
                    if 0 <= at < height and low < high:
                        values = images[source[n], at, low - shift : high - shift]
                        _add(total[g, line, low:high], values)
        begin = ends[g]
    return bad


@helper
def _find_first(first, images, row, moves, from_move, to_move) -> None:
    """Set `first` to the first sample of each voxel of a row that has none yet."""
    _, height, width = images.shape
    source, row_shift, col_shift = moves.source, moves.row_shift, moves.col_shift
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
    source, row_shift, col_shift = moves.source, moves.row_shift, moves.col_shift
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


@helper
def _bad_outside(values, shift) -> int:
    """How many of a row's pixels are not finite and fall outside the section; others show in its sums."""
    bad = 0
    for x in range(min(max(-shift, 0), values.size)):
        bad += not np.isfinite(values[x])
    for x in range(max(values.size - shift, 0), values.size):
        bad += not np.isfinite(values[x])
    return bad


@helper
def bad_rows(images, moves) -> int:
    """How many pixels are not finite in the rows that are moved above or below the section."""
    source, row_shift = moves.source, moves.row_shift
    height, bad = images.shape[1], 0
    for m in range(source.size):
        for row in range(min(max(-row_shift[m], 0), height)):
            bad += _bad_outside(images[source[m], row], images.shape[2])
        for row in range(max(height - row_shift[m], 0), height):
            bad += _bad_outside(images[source[m], row], images.shape[2])
    return bad


@helper
def merge_line(sums, variance, total, squares, first, groups, top, line) -> None:
    """One row of `merge_groups`; groups of one colour are merged as by Chan, Golub and LeVeque 1983."""
    _, width, channels = sums.shape
    by_row, by_col, phases = groups
    row = top + line
    if not phases.size:
        rows = by_row[0, row] + by_row[1, row]
        for col in range(width):
            n = rows * (by_col[0, col] + by_col[1, col])
            inverse, unbiased = 1 / max(n, 1), 1 / max(n - 1, 1)
            for colour in range(channels):
                index = col * channels + colour
                voxel_sum = total[0, line, index]
                if variance is not None:
                    squared = _deviations(voxel_sum, squares[0, line, index], inverse)
                    variance[line, col, colour] = squared * unbiased
                    voxel_sum += first[0, line, index] * n if n > 0 else 0.0
                sums[line, col, colour] = voxel_sum
        return
    for parity in range(2):
        for phase in range(2):  # red and blue samples of a voxel are all in one group
            p, q = (row + phases[phase, 0]) % 2, (parity + phases[phase, 1]) % 2
            rows, colour, g = by_row[p, row], 2 * phase, 2 * p + q
            for col in range(parity, width, 2):
                voxel_sum, n = total[g, line, col], rows * by_col[q, col]
                if variance is not None:
                    squared = _deviations(voxel_sum, squares[g, line, col], 1 / max(n, 1))
                    variance[line, col, colour] = squared / max(n - 1, 1)
                    voxel_sum += first[g, line, col] * n if n > 0 else 0.0
                sums[line, col, colour] = voxel_sum
        p, q = (row + phases[2, 0]) % 2, (parity + phases[2, 1]) % 2
        g, h = 2 * p + q, 3 - 2 * p - q  # the two green cells are diagonal neighbours
        for col in range(parity, width, 2):
            n, m = by_row[p, row] * by_col[q, col], by_row[1 - p, row] * by_col[1 - q, col]
            a, b = total[g, line, col], total[h, line, col]
            voxel_sum = a + b
            if variance is not None:
                inverse_n, inverse_m = 1 / max(n, 1), 1 / max(m, 1)
                squared = _deviations(a, squares[g, line, col], inverse_n) + _deviations(
                    b, squares[h, line, col], inverse_m
                )
                first_n = first[g, line, col] if n > 0 else 0.0
                first_m = first[h, line, col] if m > 0 else 0.0
                difference = (first_m - first_n) + (b * inverse_m - a * inverse_n)
                squared += difference * difference * (n * m / max(n + m, 1))
                variance[line, col, 1] = squared / max(n + m - 1, 1)
                voxel_sum += first_n * n + first_m * m
            sums[line, col, 1] = voxel_sum


@helper
def _deviations(total, squares, inverse) -> float:
    """Sum of squared deviations from the mean, of 1 / `inverse` numbers of this sum and sum of squares."""
    return max(squares - total * (total * inverse), 0.0)  # the square of the total could be infinite
