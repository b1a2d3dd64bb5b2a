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

from pcii.exchange.stated_cameras import AS_STORED, ViewOrder
from pcii.imaging.blocks import block_sums, evenly_chosen
from pcii.store.dataset_writer import check_depth_range
from pcii.types.camera_grid import CameraGrid
from pcii.types.geometry import depth_of_total_disparity_mm, parallax_px, total_disparity_px
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

MOST_CAMERAS = 5
"""Largest number of camera rows, and of columns, that are used: first, last, and equally spread between."""
COARSE_CELLS, FINE_CELLS = 128, 512
"""Largest side of the views in cells, to try orders and to refine depths."""
FEWEST_CELLS = 16
"""Smaller views are not judged."""
PHOTONS_PER_CELL = 4.0
"""Of counts; with fewer the noise hides the texture."""
BLUR_CELLS, BACKGROUND_CELLS = 0.7, 8.0
"""Views are blurred, so that half cells do not matter, and lose what is smooth, such as vignetting."""
BLUR_PLANES = 1.0
"""Of what is sharp at each plane, half a fine cell apart; with less one surface may be named twice."""
WINDOW_CELLS, LEAST_SHARE = 5, 0.6
"""Side of the window over which the variance is averaged; share of the views that have to reach a cell, and
of the cells that have to be reached in a window."""
BETTER, RANDOM_ORDERS = 0.75, 3
"""An order is better than another one, or than random ones, if at most this share of the variance remains."""
SHARP, FEWEST_SHARP = 0.5, 0.02
"""At a surface the variance is at most this share of its mean over the planes; least share of such cells."""
PEAK_SHARE, MOST_PEAKS = 0.08, 4
"""Least share of what is sharp that a depth has, and the largest number of depths."""
BEHIND_SHARE = 0.12
"""Largest share of what seems sharp by chance behind the cameras."""
RANGE_FACTOR = 4.0
"""How far beyond a stated range depths are looked at, as a factor of parallax."""


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
    outside_mm: float | None = None
    """A depth outside the stated range, if most of what is sharp is sharp outside."""


def check_grid(
    images: Views | PhotonCounts,
    z_range_mm: tuple[float, float] | None = None,
    *,
    order: ViewOrder = AS_STORED,
    counted: bool = False,
) -> CameraFit:
    """Where views are sharp, and what explains them better than their cameras.

    They were stored in the `order`, as a table or `counted` one by one. Without a range all depths are looked
    at whose parallax is not larger than the views. Small views, single ones and those without texture, or
    with too few photons, are not judged. Raises `InputError` for a range that is not 0 < near < far, and for
    views that hold NaN or infinity.
    """
    if z_range_mm is not None:
        check_depth_range(z_range_mm)
    grid, side = images.grid, _cell_side(images, COARSE_CELLS)
    if grid.view_count < 2 or min(grid.height, grid.width) < FEWEST_CELLS * side:
        return CameraFit()
    reach = float(max(grid.height, grid.width))
    if z_range_mm is not None:
        ends = total_disparity_px(grid, np.array(z_range_mm)) - _still_px(grid)
        reach = min(reach, max(RANGE_FACTOR * float(np.abs(ends).max()), FEWEST_CELLS / 2 * side))
    shifts_px = side * np.arange(-np.ceil(reach / side), np.ceil(reach / side) + 1)
    cells, table = _cells_of(images, side), np.arange(grid.view_count).reshape(grid.rows, grid.cols)
    variance, best_order, best_grid = _sweep(cells, table, grid, shifts_px, side), order, grid
    limit = BETTER * _remaining(variance)
    for other, other_table in _other_orders(grid, order, counted):
        other_grid = replace(grid, rows=other_table.shape[0], cols=other_table.shape[1])
        other_variance = _sweep(cells, other_table, other_grid, shifts_px, side)
        if _remaining(other_variance) < limit:
            variance, best_order, best_grid = other_variance, other, other_grid
            limit = _remaining(variance)
    rng = np.random.default_rng(0)
    by_chance = [
        _remaining(_sweep(cells, rng.permutation(table.ravel()).reshape(table.shape), grid, shifts_px, side))
        for _ in range(RANDOM_ORDERS)
    ]
    sharpness, is_sharp = _sharpness(variance)
    mass, total_px = _by_plane(variance, sharpness * is_sharp), shifts_px + _still_px(best_grid)
    nearest_px = np.maximum(total_px[-1], side)
    fit = CameraFit(nearest_mm=float(depth_of_total_disparity_mm(grid, nearest_px)))
    if is_sharp.mean() < FEWEST_SHARP or _remaining(variance) > BETTER * np.mean(by_chance):
        return fit
    fit = replace(fit, order=None if best_order == order else best_order)
    if mass[total_px < -side].sum() > BEHIND_SHARE:
        turned_px = _still_px(best_grid) - shifts_px
        is_behind = turned_px < -side
        if mass[is_behind].sum() <= BEHIND_SHARE and not is_behind[_peaks(mass)].any():
            flips = best_order.flip_rows ^ (best_grid.rows > 1), best_order.flip_cols ^ (best_grid.cols > 1)
            return replace(fit, order=replace(best_order, flip_rows=flips[0], flip_cols=flips[1]))
        least_px = float(shifts_px[np.searchsorted(mass.cumsum(), 0.02)])
        x, y = 2 * max(-least_px, 0.0) * _per_total(best_grid)  # as far in front as it was behind
        return replace(fit, shear_px=(float(f"{x:.2g}"), float(f"{y:.2g}")))
    if fit.order is not None:
        return fit
    near_px, far_px = np.inf, 0.0
    if z_range_mm is not None:
        near_px, far_px = total_disparity_px(grid, np.array(z_range_mm)).tolist()
    # A plane more on either side belongs to the range: it may be nearest to one that does.
    inside = np.where((total_px >= far_px - side) & (total_px <= near_px + side) & (total_px > 0), mass, 0)
    if z_range_mm is not None and inside.sum() < 0.5:
        outside_px = total_px[np.where((inside == 0) & (total_px > 0), mass, 0).argmax()]
        return replace(fit, outside_mm=float(depth_of_total_disparity_mm(grid, outside_px)))
    return replace(fit, z_mm=_refined_depths(images, variance, inside, total_px, side))


def _other_orders(
    grid: CameraGrid, order: ViewOrder, counted: bool
) -> Iterator[tuple[ViewOrder, np.ndarray]]:
    """Orders that differ by more than a turn of both axes, and the number (K, L) of each camera's view."""

    def numbers(one: ViewOrder, rows: int, cols: int) -> np.ndarray:
        stored = (cols, rows) if one.swap_axes else (rows, cols)
        return one.arrange(np.arange(rows * cols).reshape(stored))

    view_of_stored = np.argsort(numbers(order, grid.rows, grid.cols), axis=None)
    changes = ((False, False, True), (False, True, False), (False, True, True), (True, False, False))
    for to_and_fro, swap, flip in changes:
        other = replace(
            order,
            serpentine=order.serpentine ^ to_and_fro,
            swap_axes=order.swap_axes ^ swap,
            flip_cols=order.flip_cols ^ flip,
        )
        shape = (grid.cols, grid.rows) if swap and not counted else (grid.rows, grid.cols)
        yield other, view_of_stored[numbers(other, *shape)]


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


def _per_total(grid: CameraGrid) -> np.ndarray:
    """Parallax (x, y) from camera to camera as a share of the total parallax of the longer axis."""
    return np.array(parallax_px(grid, 1.0)) / total_disparity_px(grid, 1.0)


def _still_px(grid: CameraGrid) -> float:
    """Total parallax of what stands still in all views, because they are shifted by the shear."""
    return float(np.mean(np.array(grid.shear_px) / _per_total(grid)))


def _sweep(
    cells: Callable[[int], np.ndarray], table: np.ndarray, grid: CameraGrid, shifts_px: np.ndarray, side: int
) -> np.ndarray:
    """Variance (P, h, w) of the views in a window around each cell; inf where few views reach.

    A point whose total parallax is `shifts_px` (P,) more than that of what stands still is in focus. `table`
    (K, L) has the number of each camera's view.
    """
    from scipy.ndimage import uniform_filter

    rows, cols = (np.array(evenly_chosen(count, MOST_CAMERAS)) for count in table.shape)
    images = [cells(int(table[k, l])) for k in rows for l in cols]
    steps = np.array([(k - (grid.rows - 1) / 2, l - (grid.cols - 1) / 2) for k in rows for l in cols])
    total_px = shifts_px + _still_px(grid)
    disparity = total_px[:, None] * _per_total(grid)[::-1] - np.array(grid.shear_px[::-1])  # down, right
    moves = np.floor(disparity[:, None] * steps / side + 0.5).astype(int)  # (P, V, 2)
    h, w = images[0].shape
    fewest = max(2, LEAST_SHARE * len(images))
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
        known = reached >= LEAST_SHARE
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
    is_peak = (mass > padded[:-2]) & (mass >= padded[2:]) & (around >= PEAK_SHARE)
    return sorted(np.flatnonzero(is_peak).tolist(), key=lambda plane: -around[plane])[:MOST_PEAKS]


def _refined_depths(
    images: Views | PhotonCounts, variance: np.ndarray, mass: np.ndarray, total_px: np.ndarray, side: int
) -> tuple[float, ...]:
    """Depths of the peaks, from near to far, by planes a fine cell apart around what is sharp."""
    from scipy.ndimage import gaussian_filter1d

    grid = images.grid
    fine = min(_cell_side(images, FINE_CELLS), side)
    active = np.convolve(mass >= PEAK_SHARE / 4, [1, 1, 1], "same") > 0
    planes = np.unique(np.concatenate([total_px[active] + step for step in np.arange(0, side, fine / 2)]))
    table = np.arange(grid.view_count).reshape(grid.rows, grid.cols)
    close = _sweep(_cells_of(images, fine), table, grid, planes - _still_px(grid), fine)
    contrast, _ = _sharpness(close)
    is_sharp = active[variance.argmin(axis=0)] & _sharpness(variance)[1]
    of_fine = (
        np.minimum(np.arange(size) * fine // side, most - 1)
        for size, most in zip(contrast.shape, is_sharp.shape, strict=True)
    )
    weight = np.where(is_sharp[np.ix_(*of_fine)], contrast, 0)
    fine_mass = gaussian_filter1d(_by_plane(close, weight), BLUR_PLANES, mode="constant")
    depths = []
    for peak in _peaks(fine_mass):
        near = slice(max(peak - 2, 0), peak + 3)
        px = (fine_mass[near] * planes[near]).sum() / fine_mass[near].sum()
        depths.append(float(depth_of_total_disparity_mm(grid, px)))
    return tuple(sorted(depths))
