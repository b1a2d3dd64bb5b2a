"""Do views fit the stated cameras? Where they are sharp, and which order or shift explains them better.

At the depth of a surface the views of it lie on each other, so that their variance is small. Planes of total
parallax t px are swept on both sides of infinity, since the disparities of rectified light fields, which were
shifted so that something stands still, have both signs. Counting rows and columns from the other ends turns
all signs: what is behind the cameras in one order is in front of them in the other.

Notation: V views, (h, w) cells of pixels, P planes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pcii.base import block_sums, evenly_chosen
from pcii.exchange import AS_STORED, ViewOrder
from pcii.types import (
    CameraGrid,
    PhotonCounts,
    Views,
    check_depth_range,
    depth_of_total_disparity_mm,
    parallax_per_total,
    total_disparity_px,
)

# What limits the work. More is slower; fewer cells place depths less exactly.
MAX_CAMERAS = 5
"""Largest number of camera rows, and of columns, that are used: first, last, and equally spread between."""
MAX_CELLS = 128
"""Largest side of the views in cells, to try orders; depths are placed with four times as many."""
RANGE_FACTOR = 4.0
"""How far beyond a stated range depths are looked at, as a factor of parallax: ranges are stated roughly."""

# What follows from the cells: views move by whole ones, and a cell has to hold texture above its noise.
PHOTONS_PER_CELL = 4.0
"""Least mean of counts: the root of a Poisson count has the standard deviation 1/2, here a quarter of it."""
BLUR_CELLS, BACKGROUND_CELLS = 0.7, 8.0
"""Standard deviations of the band that views are limited to: half cells do not matter, nor vignetting."""
WINDOW_CELLS, MIN_SHARE = 5, 0.6
"""Side of the window over which the variance is averaged; share of the views that have to reach a cell, and
of the cells that have to be reached in a window: more than half. A larger window averages away more noise,
and more of what is small. Views of less than three windows are not judged."""

# What decides, set by hand so that right views are not warned about and wrong ones are, as
# tests/pcii/evidence/test_texture_evidence.py keeps it. If a share of the variance is larger, noise decides.
BETTER = 0.75
"""An order is better than others if at most this share of their variance remains."""
SHARP = 0.5
"""At a surface the variance is at most this share of its mean over the planes."""
CHANCE_SHARE = 0.02
"""Share of the cells that are sharp by chance, and of what is sharp that the advised shear leaves behind the
cameras. If it is smaller, noise is taken for surfaces, and single cells make the shear larger; if larger,
small things are not seen, and the shear leaves more behind the cameras."""
MAX_BEHIND_SHARE = 0.12
"""Largest share of what is sharp that may lie behind the cameras without a warning. If it is smaller, chance,
which puts some there, makes warnings; if larger, shears of which little lies behind are not warned about."""
MAX_DEPTHS, MIN_DEPTH_SHARE = 4, 0.08
"""Largest number of depths that are proposed, as many as a report has room for; least share of all surfaces
that lie around each. If the share is smaller, chance makes depths; if larger, small surfaces are left out."""


@dataclass(frozen=True)
class CameraFit:
    """Where views are sharp, and what explains them better than the stated cameras."""

    z_mm: tuple[float, ...] = ()
    """Depths at which most is sharp, from near to far; empty if nothing is, or the cameras are wrong."""
    nearest_mm: float | None = None
    """The nearest depth that was looked at, as far as infinity; None for views that cannot be judged."""
    order: ViewOrder | None = None
    """An order of the stored views that explains them clearly better than the stated one."""
    shear_px: tuple[float, float] | None = None
    """A shift that brings all that is sharp in front of the cameras, where no order does."""


def check_grid(
    images: Views | PhotonCounts,
    z_range_mm: tuple[float, float] | None = None,
    *,
    order: ViewOrder = AS_STORED,
) -> CameraFit:
    """Where views are sharp, and what explains them better than their cameras.

    They were stored in the `order`. All depths are looked at whose
    parallax is not larger than the views, or four times that of a range. Small views, single ones and those
    without texture, or with too few photons, are not judged. Raises `InputError` for a range that is not
    0 < near < far, and for views that hold NaN or infinity.
    """
    if z_range_mm is not None:
        check_depth_range(z_range_mm)
    grid, side = images.grid, _cell_side(images, MAX_CELLS)
    if grid.view_count < 2 or min(grid.height, grid.width) < 3 * WINDOW_CELLS * side:
        return CameraFit()
    reach = float(max(grid.height, grid.width))
    if z_range_mm is not None:
        ends = total_disparity_px(grid, np.array(z_range_mm)) - _still_px(grid)
        reach = min(reach, max(RANGE_FACTOR * float(np.abs(ends).max()), 1.5 * WINDOW_CELLS * side))
    shifts_px = side * np.arange(-np.ceil(reach / side), np.ceil(reach / side) + 1)
    cells = _cells_of(images, side)
    tables = _tables_of_orders(grid, order)
    grids = {one: replace(grid, rows=table.shape[0], cols=table.shape[1]) for one, table in tables.items()}
    variances = {one: _sweep(cells, table, grids[one], shifts_px, side) for one, table in tables.items()}
    remaining = {one: _remaining(variance) for one, variance in variances.items()}
    best = min(remaining, key=lambda one: remaining[one])
    if remaining[best] >= BETTER * remaining[order]:
        best = order
    variance, total_px = variances[best], shifts_px + _still_px(grids[best])
    nearest_px = np.maximum(total_px[-1], side)
    fit = CameraFit(nearest_mm=float(depth_of_total_disparity_mm(grid, nearest_px)))
    sharpness, is_sharp = _sharpness(variance)
    wrong = np.mean([value for one, value in remaining.items() if one != best])
    if is_sharp.mean() < CHANCE_SHARE or remaining[best] > BETTER * wrong:
        return fit
    fit = replace(fit, order=None if best == order else best)
    mass = _by_plane(variance, sharpness * is_sharp)
    if mass[total_px < -side].sum() > MAX_BEHIND_SHARE:
        return _in_front(fit, best, grids[best], mass, shifts_px, side)
    if fit.order is not None:
        return fit
    peaks = _peaks(np.where(total_px > 0, mass, 0))
    depths_mm = _placed_mm(images, tables[order], (variance, is_sharp), shifts_px, peaks, side)
    return replace(fit, z_mm=tuple(sorted({*depths_mm})))


def _in_front(
    fit: CameraFit, order: ViewOrder, grid: CameraGrid, mass: np.ndarray, shifts_px: np.ndarray, side: int
) -> CameraFit:
    """The fit of views in which much is sharp behind the cameras: the order or the shear that mends it."""
    is_behind = _still_px(grid) - shifts_px < -side  # of views whose two axes are turned
    if mass[is_behind].sum() <= MAX_BEHIND_SHARE and not is_behind[_peaks(mass)].any():
        rows, cols = order.flip_rows ^ (grid.rows > 1), order.flip_cols ^ (grid.cols > 1)
        return replace(fit, order=replace(order, flip_rows=rows, flip_cols=cols))
    least_px = float(shifts_px[np.searchsorted(mass.cumsum(), CHANCE_SHARE)])
    x, y = 2 * max(-least_px, 0.0) * parallax_per_total(grid)  # as far in front as it was behind
    return replace(fit, shear_px=(float(f"{x:.2g}"), float(f"{y:.2g}")))


def _placed_mm(
    images: Views | PhotonCounts,
    table: np.ndarray,
    coarse: tuple[np.ndarray, np.ndarray],
    shifts_px: np.ndarray,
    peaks: list[int],
    side: int,
) -> Iterator[float]:
    """The depths of the surfaces around planes of which much is sharp, by finer cells and planes.

    `coarse` are the variance (P, h, w) and whether cells are sharp (h, w), in cells of `side` px.
    """
    variance, is_sharp = coarse
    fine = min(_cell_side(images, 4 * MAX_CELLS), side)
    fine_cells = _cells_of(images, fine)
    for peak in peaks:
        near_px = shifts_px[peak] + np.arange(-2 * side, 2 * side + fine / 4, fine / 2)
        close = _sweep(fine_cells, table, images.grid, near_px, fine)
        is_surface = is_sharp & (np.abs(variance.argmin(axis=0) - peak) <= 1)
        rows, cols = (  # of the coarse cell in which each fine one is
            np.minimum(np.arange(count) * fine // side, most - 1)
            for count, most in zip(close.shape[1:], is_surface.shape, strict=True)
        )
        is_reached = is_surface[np.ix_(rows, cols)] & np.isfinite(close).all(axis=0)
        if is_reached.any():
            curve = close[:, is_reached].mean(axis=1)
            weight = np.maximum(curve.mean() - curve, 0) ** 2 + 1e-30
            place_px = weight @ near_px / weight.sum() + _still_px(images.grid)
            yield float(depth_of_total_disparity_mm(images.grid, place_px))


def _tables_of_orders(grid: CameraGrid, order: ViewOrder) -> dict[ViewOrder, np.ndarray]:
    """The number of each camera's view, (K, L), in orders that differ by more than a turn of both axes."""

    def numbers(one: ViewOrder, rows: int, cols: int) -> np.ndarray:
        stored = (cols, rows) if one.swap_axes else (rows, cols)
        return one.arrange(np.arange(rows * cols).reshape(stored))

    view_of_stored = np.argsort(numbers(order, grid.rows, grid.cols), axis=None)
    tables = {}
    for swap, flip in ((False, False), (False, True), (True, False), (True, True)):
        other = replace(order, swap_axes=order.swap_axes ^ swap, flip_cols=order.flip_cols ^ flip)
        shape = (grid.cols, grid.rows) if swap else (grid.rows, grid.cols)
        tables[other] = view_of_stored[numbers(other, *shape)]
    return tables


def _cell_side(images: Views | PhotonCounts, most_cells: int) -> int:
    """Pixels of the side of a cell: even, for all colours of a Bayer pattern, and of a few photons."""
    grid = images.grid
    side = -(-max(grid.height, grid.width) // most_cells)
    if isinstance(images, PhotonCounts):
        per_pixel = max(images.total, 1) / np.prod(grid.shape_KLHW, dtype=float)
        side = max(side, int(np.ceil(np.sqrt(PHOTONS_PER_CELL / per_pixel))))
    return side + side % 2 if side > 1 else 1


def _cells_of(images: Views | PhotonCounts, side: int) -> Callable[[int], np.ndarray]:
    """A function that returns a view (h, w) by its number.

    It is the band-passed square root of the mean light of cells: noise and contrast no longer follow
    brightness.
    """
    from scipy.ndimage import gaussian_filter

    @cache
    def cells(number: int) -> np.ndarray:
        image = images.view(*divmod(number, images.grid.cols))
        h, w = (size // side for size in image.shape[:2])
        image = image.mean(axis=2, dtype=np.float64) if image.ndim == 3 else image
        sums = block_sums(image[: h * side, : w * side], side, np.float64)  # of any numbers of float32
        light = np.sqrt(np.maximum(sums, 0))
        light = (light / max(float(light.mean()), 1e-30)).astype(np.float32)
        return gaussian_filter(light, BLUR_CELLS) - gaussian_filter(light, BACKGROUND_CELLS)

    return cells


def _still_px(grid: CameraGrid) -> float:
    """Total parallax of what stands still in all views, because they are shifted by the shear."""
    return float(np.mean(np.array(grid.shear_px) / parallax_per_total(grid)))


def _sweep(
    cells: Callable[[int], np.ndarray], table: np.ndarray, grid: CameraGrid, shifts_px: np.ndarray, side: int
) -> np.ndarray:
    """Variance (P, h, w) of the views in a window around each cell; inf where few views reach.

    A point whose total parallax is `shifts_px` (P,) more than that of what stands still is in focus. `table`
    (K, L) has the number of each camera's view.
    """
    from scipy.ndimage import uniform_filter

    rows, cols = (np.array(evenly_chosen(count, MAX_CAMERAS)) for count in table.shape)
    images = [cells(int(table[k, l])) for k in rows for l in cols]
    steps = np.array([(k - (grid.rows - 1) / 2, l - (grid.cols - 1) / 2) for k in rows for l in cols])
    total_px = shifts_px + _still_px(grid)
    per_total, shear_px = parallax_per_total(grid)[::-1], np.array(grid.shear_px[::-1])  # down, right
    disparity = total_px[:, None] * per_total - shear_px
    moves = np.floor(disparity[:, None] * steps / side + 0.5).astype(int)  # (P, V, 2)
    h, w = images[0].shape
    fewest = max(2, MIN_SHARE * len(images))
    variance = np.full((len(shifts_px), h, w), np.inf, np.float32)
    for plane, of_views in enumerate(moves.tolist()):
        total, squares, number = (np.zeros((h, w), np.float32) for _ in range(3))
        for image, (dy, dx) in zip(images, of_views, strict=True):
            if abs(dy) < h and abs(dx) < w:
                to = slice(max(0, dy), h + min(0, dy)), slice(max(0, dx), w + min(0, dx))
                moved = image[max(0, -dy) : h + min(0, -dy), max(0, -dx) : w + min(0, -dx)]
                total[to] += moved
                squares[to] += moved * moved
                number[to] += 1
        enough = number >= fewest
        spread = (squares - total**2 / np.maximum(number, 1)) / np.maximum(number - 1, 1)
        reached = uniform_filter(enough.astype(np.float32), WINDOW_CELLS, mode="constant")
        summed = uniform_filter(np.where(enough, np.maximum(spread, 0), 0), WINDOW_CELLS, mode="constant")
        known = reached >= MIN_SHARE
        variance[plane][known] = summed[known] / reached[known]
    return variance


def _remaining(variance: np.ndarray) -> float:
    """Mean over the cells of the least variance."""
    covered = np.isfinite(variance).any(axis=0)
    return float(variance.min(axis=0)[covered].mean()) if covered.any() else np.inf


def _sharpness(variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By how much the least variance (h, w) is below its mean over the planes, and whether that is sharp."""
    known = np.isfinite(variance)
    mean = np.where(known, variance, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    least = np.where(known.any(axis=0), variance.min(axis=0), 0)
    return mean - least, least < SHARP * mean


def _by_plane(variance: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Share (P,) of the weight (h, w) of cells whose variance is least at each plane.

    Planes at which views move by the same cells are equal: a cell counts for the first and the last of them.
    """
    first = variance.argmin(axis=0)
    last = len(variance) - 1 - variance[::-1].argmin(axis=0)
    planes = np.concatenate([first.ravel(), last.ravel()])
    mass = np.bincount(planes, np.tile(weight.ravel(), 2), minlength=len(variance))
    return mass / max(mass.sum(), 1e-30)


def _peaks(mass: np.ndarray) -> list[int]:
    """Planes at which more is sharp than at their neighbours, those of most first."""
    padded = np.pad(mass, 1)
    around = padded[:-2] + padded[1:-1] + padded[2:]
    is_peak = (mass > padded[:-2]) & (mass >= padded[2:]) & (around >= MIN_DEPTH_SHARE)
    return sorted(np.flatnonzero(is_peak).tolist(), key=lambda plane: -around[plane])[:MAX_DEPTHS]
