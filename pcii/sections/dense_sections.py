"""Sections of dense images: whole rows of every view added to whole rows of the section.

A view moves by whole pixels, so each of its rows is added to a row of the section in one run; bilinear
shifts are up to four such moves of each view, with weights. For mosaics the moves are sorted into four
groups by the parities of their shifts: within a group all samples of a voxel have one colour, and rows are
added without looking at colours. Variances are sums of squared differences from the first sample, in
double precision, which keeps them right to 1e-6 where the mean is a million deviations.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from pcii.core.bayer import colour_cells
from pcii.core.camera_grid import CameraGrid
from pcii.core.errors import InputError
from pcii.core.geometry import exact_shifts_px, nearest_shifts_px, target_indices
from pcii.core.images import Shifts, Views
from pcii.core.photon_counts import PhotonCounts

BATCH = 8
"""Views that are held at a time when they are read from disk."""


def sum_views(
    data: Views, z: np.ndarray, shifts: Shifts, *, variance: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H, W, C) of the samples at each voxel; float64 for float64 data.

    A view is read once, however many planes. A voxel below two samples has the variance 0.
    Raises `InputError` for radiance that is NaN or infinite.
    """
    planes = [_Plane(data, depth, shifts, _dtype(data), variance) for depth in z]
    everything = _in_memory(data)
    if everything is not None:
        numbers = np.arange(data.grid.view_count)
        finite = all(plane.sum(numbers, everything) for plane in planes)
    else:
        for plane in planes:
            plane.start()
        finite = all(plane.add(*batch) for batch in _batches(data) for plane in planes)
        finite = finite and all(plane.finish() for plane in planes)
    if not finite:
        _name_the_bad_one(data)
    sums = _stacked([plane.sums for plane in planes])
    return sums, _stacked([plane.variance for plane in planes]) if variance else None


def sum_counts(data: PhotonCounts, z: np.ndarray, shifts: Shifts) -> np.ndarray:
    """Photons per voxel (Z, H, W, C), int64, from counts that are kept dense: the same as from events.

    Sums run in double precision, which is exact: no voxel has 2^53 photons.
    """
    images = data.dense.reshape(data.grid.view_count, data.grid.height, -1)
    planes = [_Plane(data, depth, shifts, np.int64, spread=False) for depth in z]
    for plane in planes:
        plane.sum(np.arange(data.grid.view_count), images)
    return _stacked([plane.sums for plane in planes])


def sum_fine(
    data: Views, z: np.ndarray, subpixel: int, coverage: np.ndarray, *, variance: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Sums and unbiased variances (Z, H M, W M, C), float64, of radiance on finer voxels.

    `coverage` has the same shape. A view is read once, however many planes.
    """
    from pcii.sections import dense_kernels

    grid, cells = data.grid, np.zeros((0, 2), np.int64) if data.cfa is None else colour_cells(data.cfa)
    targets = [target_indices(grid, depth, subpixel) for depth in z]
    total = np.zeros(coverage.shape)
    squares = np.zeros(coverage.shape if variance else (len(z), 0, 0, 0))
    first = np.full(squares.shape, np.nan)
    for k, l in np.ndindex(grid.rows, grid.cols):
        image = data.view(k, l).astype(np.float64)
        for plane, (rows, cols) in enumerate(targets):
            dense_kernels.add_fine(total[plane], squares[plane], first[plane], image, rows[k], cols[l], cells)
    if not variance:
        return total, None
    spread = np.maximum(squares - total**2 / np.maximum(coverage, 1), 0)
    sums = np.where(coverage > 0, total + first * coverage, 0)
    return sums, spread / np.maximum(coverage.astype(np.int64) - 1, 1)


def _stacked(planes: list[np.ndarray]) -> np.ndarray:
    """Planes as one array; a single one without copying it."""
    return np.stack(planes) if len(planes) > 1 else planes[0][None]


class _Plane:
    """One section in the making: its result, and running sums where views come some at a time."""

    def __init__(
        self, data: Views | PhotonCounts, z_mm: float, shifts: Shifts, dtype: Any, spread: bool
    ) -> None:
        grid = data.grid
        cfa, C = colours_apart(data, shifts)
        self.row_moves, self.col_moves = moves(grid, z_mm, shifts)
        self.columns, self.spread = grid.cols, spread
        self.channels, self.groups = (1, 4) if cfa is not None else (C, 1)
        phases = np.zeros((0, 2), np.int64) if cfa is None else _phases(cfa)
        by_row, by_col = (
            _numbers(axis[0].px, size)
            for axis, size in ((self.row_moves, grid.height), (self.col_moves, grid.width))
        )
        self.merging = by_row, by_col, phases
        # One block of memory: an allocator hands back what is freed in one piece sooner than in two.
        whole = np.empty((1 + spread, grid.height, grid.width, C), dtype)
        self.sums, self.variance = whole[0], whole[1] if spread else whole[:0, 0]

    def sum(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Make the section of images (V, H, N) of all views; whether it and the images are finite."""
        from pcii.sections import dense_kernels

        result = self.sums, self.variance
        return dense_kernels.sum_views(*result, images, *self._moves(views), *self.merging)

    def start(self) -> None:
        """Begin a section of views that come some at a time."""
        H, W, _ = self.sums.shape
        shape = (self.groups, H, W * self.channels)
        self.total = np.zeros(shape)
        self.squares = np.zeros(shape if self.spread else (0, 0, 0))
        self.first = np.full(self.squares.shape, np.nan)

    def add(self, views: np.ndarray, images: np.ndarray) -> bool:
        """Add images (V, H, N) of these views; whether what falls beside the section is finite."""
        from pcii.sections import dense_kernels

        return dense_kernels.add_views(self.total, self.squares, self.first, images, *self._moves(views))

    def finish(self) -> bool:
        """Bring the running sums to the result; whether it is finite."""
        from pcii.sections import dense_kernels

        state = self.total, self.squares, self.first
        return dense_kernels.merge_groups(self.sums, self.variance, *state, *self.merging)

    def _moves(self, views: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of each move of these views: image, shifts and weight, by group; and where each group ends."""
        source, down, right, weight = [], [], [], []
        for row, col in product(self.row_moves, self.col_moves):
            share = row.weight[views // self.columns] * col.weight[views % self.columns]
            some = np.flatnonzero(share)
            source.append(some)
            weight.append(share[some])
            down.append(row.px[views[some] // self.columns])
            right.append(col.px[views[some] % self.columns])
        down, right = np.concatenate(down), np.concatenate(right)
        group = 2 * (down % 2) + right % 2 if self.groups == 4 else np.zeros_like(down)
        # What moves least shows most of a section, so it comes first.
        order = np.lexsort((np.abs(down) + np.abs(right), group))
        ends = np.searchsorted(group[order], np.arange(self.groups), side="right")
        source, weight = np.concatenate(source)[order], np.concatenate(weight)[order]
        return source, down[order], right[order] * self.channels, weight, ends


def colours_apart(data: Views | PhotonCounts, shifts: Shifts) -> tuple[str | None, int]:
    """The pattern by which samples are told apart, and into how many colours: with even shifts by none."""
    return (None, 1) if shifts == "even" else (data.cfa, data.channel_count)


def step_px(shifts: Shifts) -> int:
    """Of what number of pixels whole shifts are multiples."""
    return 2 if shifts == "even" else 1


@dataclass(frozen=True)
class Moves:
    """Whole pixels by which each row (or column) of cameras is moved, int64, and with what weight."""

    px: np.ndarray
    weight: np.ndarray


def moves(grid: CameraGrid, z_mm: float, shifts: Shifts) -> tuple[list[Moves], list[Moves]]:
    """Moves of the rows (K,) and of the columns (L,) of cameras; they add up to each camera's shift."""
    if shifts != "bilinear":
        whole = nearest_shifts_px(grid, z_mm, step_px(shifts))
        rows, cols = ([Moves(px, np.ones(px.size))] for px in whole)
        return rows, cols
    axes = []
    for exact in exact_shifts_px(grid, z_mm):
        px = np.floor(exact).astype(np.int64)
        axes.append([Moves(px, 1 - (exact - px)), Moves(px + 1, exact - px)])
    return axes[0], axes[1]


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
