"""Sections of dense images: whole rows of every view added to whole rows of the section.

A view moves by whole pixels, so each of its rows is added to a row of the section in one run. For
mosaics the moves are sorted into four groups by the parities of their shifts: within a group all samples of a
voxel have one colour, and rows are added without regard to colours. Variances are sums of squared differences
from the first sample, in double precision, whose relative error is 1e-6 where the mean is a million standard
deviations.
"""

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from pcii.base import InputError, helper, shared
from pcii.types import FocalPlanes, PhotonCounts, Shifts, Views, colour_cells

BAND = 16
"""Rows of a section that images are added to at a time: their sums stay in the cache."""
BATCH = 8
"""Views that are read from disk at a time; as many are added meanwhile."""
MOST_BYTES = 1 << 31
"""Of views that are read from disk once, to be used for many sections."""


def sum_views(
    data: Views, focal_planes: FocalPlanes, shifts: Shifts, *, variance: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H, W, C) of the samples at each voxel; float64 for float64 data.

    A view is read once, however many planes. A voxel below two samples has the variance 0.
    Raises `InputError` for radiance that is NaN or infinite, or whose sums or variances would be.
    """
    kind, images = _dtype(data), _as_one_array(data)
    running = (_RunningSums(data, focal_planes.take([p]), shifts, variance) for p in range(len(focal_planes)))
    if images is not None:  # plane by plane, so that the running sums of one are in memory
        _check_finite(data, all(_are_finite(images)))
        sections = [sums.add(np.arange(len(images)), images).merged(kind) for sums in running]
    else:
        planes = list(running)
        for views, batch in _batches(data):
            _check_finite(data, all(_are_finite(batch)))
            for plane in planes:
                plane.add(views, batch)
        sections = [plane.merged(kind) for plane in planes]
    sums = _stacked([sums for sums, _ in sections])
    variances = [variance for _, variance in sections if variance is not None]
    _check_finite(data, all(np.isfinite(part).all() for part in (sums, *variances)))
    return sums, _stacked(variances) if variance else None


def sum_counts(data: PhotonCounts, focal_planes: FocalPlanes, shifts: Shifts) -> np.ndarray:
    """Photons per voxel (Z, H, W, C), int64, from counts that are kept dense: the same as from events.

    Sums run in double precision, which is exact if no voxel has more than 2^53 photons.
    """
    size = data.dense.dtype.itemsize
    # Loops are compiled for four types. Counts are from 0 to 2^40, whose bits mean the same without a sign.
    images = data.dense.view(np.int64 if size == 8 else f"u{size}")
    images = images.reshape(data.grid.view_count, data.grid.height, -1)
    running = (_RunningSums(data, focal_planes.take([p]), shifts, False) for p in range(len(focal_planes)))
    return _stacked([sums.add(np.arange(len(images)), images).merged(np.int64)[0] for sums in running])


def _stacked(planes: list[np.ndarray]) -> np.ndarray:
    """Planes as one array; a single one without copying it."""
    return np.stack(planes) if len(planes) > 1 else planes[0][None]


class _RunningSums:
    """The section at one plane while views are added: total, squares and first samples of `_add_views`."""

    def __init__(
        self, data: Views | PhotonCounts, plane: FocalPlanes, shifts: Shifts, variance: bool
    ) -> None:
        self.grid = data.grid
        cfa, self.colours = colours_apart(data, shifts)
        self.cells = None if cfa is None else colour_cells(cfa)
        (self.row_px,), (self.col_px,) = plane.nearest_shifts_px(step_px(shifts))
        H, W = self.grid.shape_HW
        groups = (1, H, W * self.colours) if self.cells is None else (4, H, W)
        self.sums = np.zeros((3 if variance else 1, *groups))
        self.sums[2:] = np.nan

    def add(self, views: np.ndarray, images: np.ndarray) -> "_RunningSums":
        """Add images (V, H, N) of the views of these numbers (V,).

        Group 2 p + q of mosaics has the views whose row and column shifts have the parities p and q.
        """
        down, right = self.row_px[views // self.grid.cols], self.col_px[views % self.grid.cols]
        group = np.zeros_like(down) if self.cells is None else 2 * (down % 2) + right % 2
        # The images that move least cover most of a section, so they come first.
        order = np.lexsort((np.abs(down) + np.abs(right), group))
        ends = np.searchsorted(group[order], np.arange(self.sums.shape[1]), side="right")
        channels = self.colours if self.cells is None else 1
        moves = order, down[order], right[order] * channels, ends
        total, squares, first = self.sums if len(self.sums) == 3 else (self.sums[0], None, None)
        _add_views(total, squares, first, images, moves)
        return self

    def merged(self, kind: Any) -> tuple[np.ndarray, np.ndarray | None]:
        """Sums and, if it is wanted, variance (H, W, C) of all samples at each voxel, of type `kind`."""
        H, W = self.grid.shape_HW
        by_row, by_col = _cameras_by_parity(self.row_px, H), _cameras_by_parity(self.col_px, W)
        sums = np.empty((H, W, self.colours), kind)
        variance = np.empty_like(sums) if len(self.sums) == 3 else None
        with np.errstate(over="ignore", invalid="ignore"):
            if self.cells is None:
                number = (by_row.sum(axis=0)[:, None] * by_col.sum(axis=0))[..., None]
                sums[...], squared = _of_one_group(number, self.sums.reshape(-1, *sums.shape))
                if variance is not None:
                    variance[...] = squared * (1 / np.maximum(number - 1, 1))
                return sums, variance
            for r, c, colour in np.ndindex(2, 2, self.colours):
                groups: list[tuple[np.ndarray, np.ndarray]] = []
                for i, j in np.argwhere(self.cells == colour):
                    p, q = (r + i) % 2, (c + j) % 2
                    number = by_row[p, r::2][:, None] * by_col[q, c::2]
                    groups.append((number, self.sums[:, 2 * p + q, r::2, c::2]))
                one, *others = groups
                voxels = np.s_[r::2, c::2, colour]
                sums[voxels], squared = _of_two_groups(one, others[0]) if others else _of_one_group(*one)
                if variance is not None:
                    variance[voxels] = squared / np.maximum(sum(number for number, _ in groups) - 1, 1)
        return sums, variance


def _of_one_group(number: np.ndarray, running: np.ndarray) -> tuple[np.ndarray, np.ndarray | float]:
    """Sum of `number` samples, and of their squared deviations from the mean, from their running sums."""
    if len(running) == 1:
        return running[0], 0.0
    total, squares, first = running
    deviations = _deviations(number, total, squares)
    return total + np.where(number > 0, first, 0.0) * number, deviations


def _of_two_groups(
    one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray | float]:
    """The same of the samples of two groups together: Chan, Golub and LeVeque 1983."""
    (n, sums_n), (m, sums_m) = one, other
    if len(sums_n) == 1:
        return sums_n[0] + sums_m[0], 0.0
    (a, squares_n, first_n), (b, squares_m, first_m) = sums_n, sums_m
    squared = _deviations(n, a, squares_n) + _deviations(m, b, squares_m)
    first_n, first_m = np.where(n > 0, first_n, 0.0), np.where(m > 0, first_m, 0.0)
    difference = (first_m - first_n) + (b * (1 / np.maximum(m, 1)) - a * (1 / np.maximum(n, 1)))
    squared += difference * difference * (n * m / np.maximum(n + m, 1))
    return (a + b) + (first_n * n + first_m * m), squared


def _deviations(number: np.ndarray, total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Sum of squared deviations from the mean; the square of the total alone could be infinite."""
    return np.maximum(squares - total * (total * (1 / np.maximum(number, 1))), 0.0)


def colours_apart(data: Views | PhotonCounts, shifts: Shifts) -> tuple[str | None, int]:
    """The Bayer pattern and number of colours that are summed apart: none and 1 for even shifts."""
    return (None, 1) if shifts == "even" else (data.cfa, data.channel_count)


def _dtype(data: Views) -> np.dtype:
    """Type of the sums: float32 for float16 and float32 data, float64 for all others."""
    kind = getattr(data.radiance, "dtype", None)
    return np.dtype(np.float32) if kind in (np.float16, np.float32) else np.dtype(np.float64)


def _as_one_array(data: Views) -> np.ndarray | None:
    """All images (V, H, N) if they are a contiguous array in memory of the type of the sums, else None."""
    radiance = data.radiance
    if isinstance(radiance, np.ndarray) and radiance.dtype == _dtype(data) and radiance.flags.c_contiguous:
        return radiance.reshape(data.grid.view_count, data.grid.height, -1)
    return None


def in_memory(data: Views) -> Views:
    """The same views, read once, if they take `MOST_BYTES` at most; else they are read again at each use."""
    kind, shape = _dtype(data), data.radiance.shape
    if _as_one_array(data) is not None or math.prod(shape) * kind.itemsize > MOST_BYTES:
        return data
    images = np.empty((data.grid.view_count, data.grid.height, shape[3] * shape[4]), kind)
    for views, batch in _batches(data):
        images[views] = batch
    return replace(data, radiance=images.reshape(shape))


def _batches(data: Views) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Batches of view numbers (V,) and images (V, H, N); the next one is read while one is added."""
    K, L, H, W = data.grid.shape_KLHW

    def read(views: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        images = np.empty((views.size, H, W * data.radiance.shape[4]), dtype=_dtype(data))
        for number, view in enumerate(views.tolist()):
            images[number] = np.asarray(data.radiance[view // L, view % L]).reshape(H, -1)
        return views, images

    first, *others = np.split(np.arange(K * L), range(BATCH, K * L, BATCH))
    with ThreadPoolExecutor(1, "views") as reader:
        ahead = reader.submit(read, first)
        for views in others:
            batch, ahead = ahead.result(), reader.submit(read, views)
            yield batch
        yield ahead.result()


def _check_finite(data: Views, is_finite: bool) -> None:
    """Raise `InputError` that names the view with NaN or infinity, if there is one, unless all is finite."""
    if is_finite:
        return
    for k, l in np.ndindex(data.grid.rows, data.grid.cols):
        data.view(k, l)
    raise InputError("radiance: values are too large for their sum, or for their variance, to be a number")


def step_px(shifts: Shifts) -> int:
    """The number of pixels of which whole shifts are multiples."""
    return 2 if shifts == "even" else 1


def _cameras_by_parity(shift: np.ndarray, size: int) -> np.ndarray:
    """How many cameras of even and of odd shift reach each voxel row (or column), (2, size)."""
    pixel = np.arange(size) - shift[:, None]
    inside = (pixel >= 0) & (pixel < size)
    return np.array([inside[shift % 2 == parity].sum(axis=0) for parity in (0, 1)])


@shared(lambda images: len(images))
def _are_finite(first: int, last: int, images: np.ndarray) -> bool:
    """Whether no pixel of images (V, H, N) is NaN or infinite."""
    bad = 0
    for view in range(first, last):
        for row in range(images.shape[1]):
            for x in range(images.shape[2]):
                bad += not np.isfinite(images[view, row, x])
    return bad == 0


@shared(lambda total, *_: -(-total.shape[1] // BAND))
def _add_views(
    first_band: int,
    last_band: int,
    total: np.ndarray,
    squares: np.ndarray | None,
    first: np.ndarray | None,
    images: np.ndarray,
    moves: tuple[np.ndarray, ...],
) -> None:
    """Add images (V, H, N), N columns times channels, to running sums of groups of them, (G, H, N) float64.

    If variances are wanted, `total` has sums of differences from the `first` sample, which is NaN where there
    is none yet, and `squares` those of these differences squared; else `total` has sums of the samples and
    the other two are None: what is done with them is not compiled. `moves` are four arrays: the images (M,)
    in the order in which they are added, group after group; by how many rows (M,) and by how many columns
    times channels (M,) each is moved; and where each group ends (G,). The rows of an image are read in the
    order in which they lie in memory.
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
