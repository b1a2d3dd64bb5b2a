"""Sections of dense images: whole rows of every view added to whole rows of the section.

A view moves by whole pixels, so each of its rows is added to a row of the section in one run. For
mosaics the views are sorted into four groups by the parities of their shifts: within a group all samples
of a voxel have one colour, and rows are added without looking at colours. Variances are sums of squared
differences from the first sample, in double precision, which keeps them right to 1e-6 where the mean is
a million deviations.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from pcii.bayer import colour_cells
from pcii.errors import InputError
from pcii.geometry import nearest_shifts_px
from pcii.photon_counts import PhotonCounts
from pcii.types import Views

BATCH = 8
"""Views that are held at a time when they are read from disk."""


def sum_views(data: Views, z: np.ndarray, *, variance: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H, W, C) of the samples at each voxel; float64 for float64 data.

    A view is read once, however many planes. A voxel below two samples has the variance 0.
    Raises `InputError` for radiance that is NaN or infinite.
    """
    planes = [_Plane(data, depth, _dtype(data), variance) for depth in z]
    everything = _in_memory(data)
    if everything is not None:
        numbers = np.arange(data.grid.view_count)
        finite = planes[0].finite_beside(numbers, everything)
        finite = all(plane.sum(numbers, everything) for plane in planes) and finite
    else:
        finite = True
        for plane in planes:
            plane.start()
        for numbers, images in _batches(data):
            finite = planes[0].finite_beside(numbers, images) and finite
            for plane in planes:
                plane.add(numbers, images)
        finite = all(plane.finish() for plane in planes) and finite
    if not finite:
        _name_the_bad_one(data)
    sums = _stacked([plane.sums for plane in planes])
    return sums, _stacked([plane.variance for plane in planes]) if variance else None


def sum_counts(data: PhotonCounts, z: np.ndarray) -> np.ndarray:
    """Photons per voxel (Z, H, W, C), int64, from counts that are kept dense: the same as from events.

    Sums run in double precision, which is exact: no voxel has 2^53 photons.
    """
    images = data.dense.reshape(data.grid.view_count, data.grid.height, -1)
    planes = [_Plane(data, depth, np.int64, spread=False) for depth in z]
    for plane in planes:
        plane.sum(np.arange(data.grid.view_count), images)
    return _stacked([plane.sums for plane in planes])


def _stacked(planes: list[np.ndarray]) -> np.ndarray:
    """Planes as one array; a single one without copying it."""
    return np.stack(planes) if len(planes) > 1 else planes[0][None]


class _Plane:
    """One section in the making: its result, and running sums where views come some at a time."""

    def __init__(self, data: Views | PhotonCounts, z_mm: float, dtype: Any, spread: bool) -> None:
        grid, C = data.grid, data.channel_count
        self.row_shift, self.col_shift = nearest_shifts_px(grid, z_mm)
        self.columns, self.spread = grid.cols, spread
        self.channels, self.groups = (1, 4) if data.cfa is not None else (C, 1)
        phases = np.zeros((0, 2), np.int64) if data.cfa is None else _phases(data.cfa)
        self.merging = _numbers(self.row_shift, grid.height), _numbers(self.col_shift, grid.width), phases
        # One block of memory: an allocator hands back what is freed in one piece sooner than in two.
        whole = np.empty((1 + spread, grid.height, grid.width, C), dtype)
        self.sums, self.variance = whole[0], whole[1] if spread else whole[:0, 0]

    def sum(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Make the section of images (V, H, N) of all views; whether it is finite."""
        from pcii import kernels

        result = self.sums, self.variance
        return kernels.sum_views(*result, images, *self._moves(views), *self.merging)

    def start(self) -> None:
        """Begin a section of views that come some at a time."""
        H, W, _ = self.sums.shape
        shape = (self.groups, H, W * self.channels)
        self.total = np.zeros(shape)
        self.squares = np.zeros(shape if self.spread else (0, 0, 0))
        self.first = np.full(self.squares.shape, np.nan)

    def add(self, views: np.ndarray, images: np.ndarray) -> None:
        """Add images (V, H, N) of these views."""
        from pcii import kernels

        kernels.add_views(self.total, self.squares, self.first, images, *self._moves(views))

    def finish(self) -> bool:
        """Bring the running sums to the result; whether it is finite."""
        from pcii import kernels

        state = self.total, self.squares, self.first
        return kernels.merge_groups(self.sums, self.variance, *state, *self.merging)

    def finite_beside(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Whether what of the images falls beside the section is finite; the rest shows in the sums."""
        from pcii import kernels

        return kernels.finite_beside(images, *self._moves(views)[:2])

    def _moves(self, views: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Shifts of these views, their order by group, and where each group ends."""
        down, right = self.row_shift[views // self.columns], self.col_shift[views % self.columns]
        group = 2 * (down % 2) + right % 2 if self.groups == 4 else np.zeros_like(views)
        # The view that moves least shows most of a section, so it comes first.
        order = np.lexsort((np.abs(down) + np.abs(right), group))
        ends = np.searchsorted(group[order], np.arange(self.groups), side="right")
        return down, right * self.channels, order, ends


def _phases(cfa: str) -> np.ndarray:
    """Bayer cells (4, 2) of red, blue and twice green."""
    cells = colour_cells(cfa)
    return np.concatenate([np.argwhere(cells == colour) for colour in (0, 2, 1)])


def _dtype(data: Views) -> np.dtype:
    """float32 stays; what has more digits, is an integer or is unknown becomes float64."""
    kind = getattr(data.radiance, "dtype", None)
    return np.dtype(np.float32) if kind in (np.float16, np.float32) else np.dtype(np.float64)


def _in_memory(data: Views) -> np.ndarray | None:
    """All images (V, H, N) if they are in memory as they are needed."""
    whole = data.radiance
    if isinstance(whole, np.ndarray) and whole.dtype == _dtype(data) and whole.flags.c_contiguous:
        return whole.reshape(data.grid.view_count, data.grid.height, -1)
    return None


def _batches(data: Views) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """View numbers (V,) and images (V, H, N), some at a time."""
    K, L, H, W = data.grid.shape_KLHW
    held = np.empty((min(BATCH, K * L), H, W * data.radiance.shape[4]), dtype=_dtype(data))
    for part in np.split(np.arange(K * L), range(BATCH, K * L, BATCH)):
        for place, view in enumerate(part.tolist()):
            held[place] = np.asarray(data.radiance[view // L, view % L]).reshape(H, -1)
        yield part, held[: part.size]


def _numbers(shift: np.ndarray, size: int) -> np.ndarray:
    """How many cameras of even and of odd shift see each voxel row (or column), (2, size)."""
    place = np.arange(size) - shift[:, None]
    inside = (place >= 0) & (place < size)
    return np.array([inside[shift % 2 == parity].sum(axis=0) for parity in (0, 1)])


def _name_the_bad_one(data: Views) -> None:
    for k, l in np.ndindex(data.grid.rows, data.grid.cols):
        data.view(k, l)  # raises for the first that holds one
    raise InputError("radiance: values are too large for their sum to be a number")
