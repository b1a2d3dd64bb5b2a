"""Sections of dense images: whole rows of every view added to whole rows of the section.

A view moves by whole pixels, so each of its rows is added to a row of the section in one run. For
mosaics the moves are sorted into four groups by the parities of their shifts: within a group all samples of a
voxel have one colour, and rows are added without regard to colours. Variances are sums of squared differences
from the first sample, in double precision, whose relative error is 1e-6 where the mean is a million standard
deviations.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import colour_cells
from pcii.core.focal_planes import FocalPlanes
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.section_stack import Shifts
from pcii.sections.image_moves import Moves, groups_of, moves_of, step_px
from pcii.sections.recycled_memory import empty

BATCH = 8
"""Views that are read from disk at a time; as many are added meanwhile."""


def sum_views(
    data: Views, focal_planes: FocalPlanes, shifts: Shifts, *, variance: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H, W, C) of the samples at each voxel; float64 for float64 data.

    A view is read once, however many planes. A voxel below two samples has the variance 0.
    Raises `InputError` for radiance that is NaN or infinite, or whose sums or variances would be.
    """
    kind = _dtype(data)
    planes = [_Plane(data, focal_planes, p, shifts, kind, variance) for p in range(len(focal_planes))]
    images = _in_memory(data)
    if images is not None:
        views = np.arange(data.grid.view_count)
        finite = all(plane.sum(views, images) for plane in planes)
    else:
        for plane in planes:
            plane.start()
        finite = all(plane.add(*batch) for batch in _batches(data) for plane in planes)
        finite = finite and all(plane.finish() for plane in planes)
    if not finite:
        _raise_not_finite(data)
    sums = _stacked([plane.sums for plane in planes])
    variances = [plane.variance for plane in planes if plane.variance is not None]
    return sums, _not_faint(data, _stacked(variances)) if variance else None


def sum_counts(data: PhotonCounts, focal_planes: FocalPlanes, shifts: Shifts) -> np.ndarray:
    """Photons per voxel (Z, H, W, C), int64, from counts that are kept dense: the same as from events.

    Sums run in double precision, which is exact if no voxel has more than 2^53 photons.
    """
    images = _of_few_types(data.dense).reshape(data.grid.view_count, data.grid.height, -1)
    planes = [_Plane(data, focal_planes, p, shifts, np.int64, False) for p in range(len(focal_planes))]
    for plane in planes:
        plane.sum(np.arange(data.grid.view_count), images)
    return _stacked([plane.sums for plane in planes])


def sum_fine(
    data: Views, rows: np.ndarray, cols: np.ndarray, coverage: np.ndarray, *, variance: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H M, W M, C), float64, of radiance on finer voxels.

    `rows` (Z, K, H) and `cols` (Z, L, W) are `FocalPlanes.voxel_indices`; `coverage` is (Z, H M, W M, C).
    A view is read once, however many planes. Raises `InputError` for radiance that is NaN or infinite, or
    whose sums or variances would be.
    """
    from pcii.sections import dense_kernels

    grid, cells = data.grid, np.zeros((0, 2), np.int64) if data.cfa is None else colour_cells(data.cfa)
    total = np.zeros(coverage.shape)
    squares = np.zeros(coverage.shape if variance else (len(rows), 0, 0, 0))
    first = np.full(squares.shape, np.nan)
    for k, l in np.ndindex(grid.rows, grid.cols):
        image = data.view(k, l).astype(np.float64)
        for p, running in enumerate(zip(total, squares, first, strict=True)):
            dense_kernels.add_fine(*running, image, rows[p, k], cols[p, l], cells)
    sums, sample_variance = total, None
    if variance:
        with np.errstate(over="ignore", invalid="ignore"):
            deviations = np.maximum(squares - total * (total / np.maximum(coverage, 1)), 0)
            sums = np.where(coverage > 0, total + first * coverage, 0)
        sample_variance = _not_faint(data, deviations / np.maximum(coverage.astype(np.int64) - 1, 1))
    if not all(np.isfinite(part).all() for part in (sums, squares)):
        _raise_not_finite(data)
    return sums, sample_variance


def _stacked(planes: list[np.ndarray]) -> np.ndarray:
    """Planes as one array; a single one without copying it."""
    return np.stack(planes) if len(planes) > 1 else planes[0][None]


class _Plane:
    """The section at one plane while it is summed: its result, and running sums if views come in batches."""

    def __init__(
        self,
        data: Views | PhotonCounts,
        planes: FocalPlanes,
        plane: int,
        shifts: Shifts,
        dtype: Any,
        variance: bool,
    ) -> None:
        grid = data.grid
        cfa, C = colours_apart(data, shifts)
        self.row_px, self.col_px = (px[plane] for px in planes.nearest_shifts_px(step_px(shifts)))
        self.is_mosaic = cfa is not None
        self.channels, self.group_count = (1, 4) if self.is_mosaic else (C, 1)
        self.groups = groups_of(self.row_px, self.col_px, grid, cfa)
        self.sums = empty((*grid.shape_HW, C), dtype)
        self.variance = empty(self.sums.shape, dtype) if variance else None

    def sum(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Make the section of images (V, H, N) of all views; returns whether it and the images are finite."""
        from pcii.sections import dense_kernels

        moves = self._moves(views)
        return all(dense_kernels.sum_views(self.sums, self.variance, images, moves, self.groups))

    def start(self) -> None:
        """Begin a section of views that come in batches."""
        H, W, _ = self.sums.shape
        shape = (self.group_count, H, W * self.channels)
        self.total = np.zeros(shape)
        self.squares = np.zeros(shape) if self.variance is not None else None
        self.first = np.full(shape, np.nan) if self.variance is not None else None

    def add(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Add images (V, H, N) of these views; returns whether the pixels outside the section are finite."""
        from pcii.sections import dense_kernels

        running = self.total, self.squares, self.first
        return all(dense_kernels.add_views(*running, images, self._moves(views)))

    def finish(self) -> bool:
        """Compute the result from the running sums; returns whether it is finite."""
        from pcii.sections import dense_kernels

        running = self.total, self.squares, self.first
        return all(dense_kernels.merge_groups(self.sums, self.variance, *running, self.groups))

    def _moves(self, views: np.ndarray) -> Moves:
        return moves_of(self.row_px, self.col_px, views, self.channels, self.is_mosaic)


def colours_apart(data: Views | PhotonCounts, shifts: Shifts) -> tuple[str | None, int]:
    """The Bayer pattern and number of colours that are summed apart: none and 1 for even shifts."""
    return (None, 1) if shifts == "even" else (data.cfa, data.channel_count)


def _dtype(data: Views) -> np.dtype:
    """Type of the sums: float32 for float16 and float32 data, float64 for all others."""
    kind = getattr(data.radiance, "dtype", None)
    return np.dtype(np.float32) if kind in (np.float16, np.float32) else np.dtype(np.float64)


def _of_few_types(counts: np.ndarray) -> np.ndarray:
    """The same counts, not copied, as one of four types, for each of which loops are compiled.

    None is negative, nor above 2^40, so that bits mean the same with a sign and without.
    """
    size = counts.dtype.itemsize
    return counts.view(np.int64 if size == 8 else f"u{size}")


def _in_memory(data: Views) -> np.ndarray | None:
    """All images (V, H, N) if they are a contiguous array in memory of the type of the sums, else None."""
    radiance = data.radiance
    if isinstance(radiance, np.ndarray) and radiance.dtype == _dtype(data) and radiance.flags.c_contiguous:
        return radiance.reshape(data.grid.view_count, data.grid.height, -1)
    return None


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


def _not_faint(data: Views, variance: np.ndarray) -> np.ndarray:
    """The variance; raises `InputError` if no difference in the data has a square that its type can hold."""
    least = float(np.finfo(variance.dtype).tiny)
    if variance.size and variance.max() >= least:
        return variance
    grid = data.grid
    views = (data.view(k, l) for k, l in np.ndindex(grid.rows, grid.cols))
    lowest, highest = np.array([(view.min(), view.max()) for view in views], dtype=np.float64).T
    most = float(highest.max()) - float(lowest.min())
    if 0 < most < np.sqrt(least):
        raise InputError(
            f"radiance: differences of at most {most:.2g} are too small for their variance to be a number of "
            f"{variance.dtype}; multiply all values by a constant"
        )
    return variance


def _raise_not_finite(data: Views) -> None:
    for k, l in np.ndindex(data.grid.rows, data.grid.cols):
        data.view(k, l)  # raises for a view with NaN or infinity
    raise InputError("radiance: values are too large for their sum, or for their variance, to be a number")
