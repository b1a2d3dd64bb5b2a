"""Sections of dense images: whole rows of every view added to whole rows of the section.

A view moves by whole pixels, so each of its rows is added to a row of the section in one run. For
mosaics the views are sorted into four groups by the parities of their shifts: within a group all samples
of a voxel have one colour, and rows are added without looking at colours. Variances are sums of squared
differences from the first sample, in double precision, which keeps them right to 1e-6 where the mean is
a million deviations.
"""

from collections.abc import Iterator

import numpy as np

from pcii.bayer import colour_cells
from pcii.errors import InputError
from pcii.geometry import nearest_shifts_px
from pcii.types import Views

BATCH = 8
"""Views that are held at a time when they are read from disk."""
BAND = 32
"""Rows of a section that are summed at a time when all views are in memory: their sums stay in the cache."""


def sum_views(data: Views, z: np.ndarray, *, variance: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H, W, C) of the samples at each voxel; float64 for float64 data.

    A view is read once, however many planes. A voxel below two samples has the variance 0.
    Raises `InputError` for radiance that is NaN or infinite.
    """
    grid = data.grid
    whole = _in_memory(data)
    planes = [_Plane(data, depth, variance) for depth in z]
    if whole is not None:
        everything = np.arange(grid.view_count)
        for plane in planes:
            for top in range(0, grid.height, BAND):
                plane.start(top, min(BAND, grid.height - top))
                plane.add(everything, whole)
                plane.finish()
        finite = planes[0].finite_beside(everything, whole)
    else:
        finite = True
        for plane in planes:
            plane.start(0, grid.height)
        for views, images in _batches(data):
            finite = finite and planes[0].finite_beside(views, images)
            for plane in planes:
                plane.add(views, images)
        for plane in planes:
            plane.finish()
    if not finite or not all(plane.finite for plane in planes):
        _name_the_bad_one(data)
    sums = np.stack([plane.sums for plane in planes]) if len(planes) > 1 else planes[0].sums[None]
    if not variance:
        return sums, None
    return sums, np.stack([p.variance for p in planes]) if len(planes) > 1 else planes[0].variance[None]


class _Plane:
    """One section in the making: its result, and running sums of a band of its rows."""

    def __init__(self, data: Views, z_mm: float, spread: bool) -> None:
        grid, C = data.grid, data.channel_count
        self.row_shift, self.col_shift = nearest_shifts_px(grid, z_mm)
        self.columns, self.cfa, self.spread, self.finite = grid.cols, data.cfa, spread, True
        self.by_row = _numbers(self.row_shift, grid.height)
        self.by_col = _numbers(self.col_shift, grid.width)
        self.channels, self.groups = (1, 4) if data.cfa is not None else (C, 1)
        dtype = _dtype(data)
        self.sums = np.empty((grid.height, grid.width, C), dtype)
        self.variance = np.empty(self.sums.shape if spread else (0, 0, 0), dtype)

    def start(self, top: int, height: int) -> None:
        """Begin with the rows from `top` on."""
        shape = (self.groups, height, self.sums.shape[1] * self.channels)
        self.top, self.total = top, np.zeros(shape)
        self.squares = np.zeros(shape if self.spread else (0, 0, 0))
        self.first = np.full(self.squares.shape, np.nan)

    def add(self, views: np.ndarray, images: np.ndarray) -> None:
        """Add images (V, H, N) of these views."""
        from pcii import kernels

        row_shift, col_shift = self._shifts(views)
        group = np.zeros_like(views)
        if self.groups == 4:
            group = 2 * (row_shift % 2) + col_shift % 2
        order = np.argsort(group, kind="stable")
        ends = np.searchsorted(group[order], np.arange(self.groups), side="right")
        sums = self.total, self.squares, self.first
        kernels.add_views(*sums, images, row_shift, col_shift, order, ends, self.top)

    def finite_beside(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Whether what of the images falls beside the section is finite; the rest shows in the sums."""
        from pcii import kernels

        return kernels.finite_beside(images, *self._shifts(views))

    def finish(self) -> None:
        """Bring the running sums of the band to the result."""
        from pcii import kernels

        if not np.isfinite(self.total).all():
            self.finite = False
            return
        rows = slice(self.top, self.top + self.total.shape[1])
        told = self.variance[rows] if self.spread else self.variance
        if self.cfa is not None:
            phases = _phases(self.cfa)
            state = self.total, self.squares, self.first, self.by_row, self.by_col
            kernels.merge_groups(self.sums[rows], told, *state, phases, self.top)
            return
        _, W, C = self.sums.shape
        number = np.outer(self.by_row.sum(axis=0)[rows], self.by_col.sum(axis=0))[..., None]
        self.sums[rows] = self.total.reshape(-1, W, C)
        if self.spread:
            total, squares, first = (
                part.reshape(-1, W, C) for part in (self.total, self.squares, self.first)
            )
            self.sums[rows] = total + np.where(number > 0, number * first, 0)
            deviation = np.maximum(squares - total**2 / np.maximum(number, 1), 0)
            self.variance[rows] = np.where(number > 1, deviation / np.maximum(number - 1, 1), 0)

    def _shifts(self, views: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.row_shift[views // self.columns], self.col_shift[views % self.columns] * self.channels


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
