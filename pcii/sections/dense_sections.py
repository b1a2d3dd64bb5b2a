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

from pcii.base import InputError
from pcii.types import FocalPlanes, PhotonCounts, Shifts, Views, colour_cells

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
    from pcii.sections import kernels

    kind, images = _dtype(data), _as_one_array(data)
    running = (_RunningSums(data, focal_planes.take([p]), shifts, variance) for p in range(len(focal_planes)))
    if images is not None:  # plane by plane, so that the running sums of one are in memory
        _check_finite(data, all(kernels.are_finite(images)))
        sections = [sums.add(np.arange(len(images)), images).merged(kind) for sums in running]
    else:
        planes = list(running)
        for views, batch in _batches(data):
            _check_finite(data, all(kernels.are_finite(batch)))
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


def sum_fine(data: Views, rows: np.ndarray, cols: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Sums (Z, H M, W M, C), float64, of radiance on finer voxels.

    `rows` (Z, K, H) and `cols` (Z, L, W) are `FocalPlanes.voxel_indices`, which send no two pixels of a view
    to the same voxel. A view is read once, however many planes. Raises `InputError` for radiance that is NaN
    or infinite, or whose sums would be.
    """
    from pcii.sections import kernels

    total, cells = np.zeros(shape), np.zeros((0, 2), np.int64) if data.cfa is None else colour_cells(data.cfa)
    for k, l in np.ndindex(data.grid.rows, data.grid.cols):
        image = data.view(k, l).astype(np.float64)
        for section, row_of, col_of in zip(total, rows[:, k], cols[:, l], strict=True):
            kernels.add_fine(section, image, row_of, col_of, cells)
    _check_finite(data, bool(np.isfinite(total).all()))
    return total


def _stacked(planes: list[np.ndarray]) -> np.ndarray:
    """Planes as one array; a single one without copying it."""
    return np.stack(planes) if len(planes) > 1 else planes[0][None]


class _RunningSums:
    """The section at one plane while views are added: total, squares and first samples of `kernels`."""

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
        from pcii.sections import kernels

        down, right = self.row_px[views // self.grid.cols], self.col_px[views % self.grid.cols]
        group = np.zeros_like(down) if self.cells is None else 2 * (down % 2) + right % 2
        # The images that move least cover most of a section, so they come first.
        order = np.lexsort((np.abs(down) + np.abs(right), group))
        ends = np.searchsorted(group[order], np.arange(self.sums.shape[1]), side="right")
        channels = self.colours if self.cells is None else 1
        moves = order, down[order], right[order] * channels, ends
        total, squares, first = self.sums if len(self.sums) == 3 else (self.sums[0], None, None)
        kernels.add_views(total, squares, first, images, moves)
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
