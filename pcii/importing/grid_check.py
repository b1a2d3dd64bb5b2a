"""Whether views fit the cameras that were told: where they are sharp, and which mistake explains them better.

Each of the possible mistakes (rows or columns counted the other way, exchanged, taken to and fro, exchanged
pitches, another range of depths) is a camera grid of its own. The one that the views agree with best over a
sweep of planes is compared with what was told.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.geometry import depth_of_total_disparity_mm, total_disparity_px
from pcii.importing.camera_order import AS_STORED, ViewOrder
from pcii.importing.plane_sweep import SmallViews, Sweep, shifts_px, small_views, sweep
from pcii.io.dataset_writer import check_depth_range

COARSE_PX, FINE_PX = 144, 512
"""Largest side of the reduced views of which all mistakes are tried, and of those that refine depths."""
MOST_PLANES, MOST_FINE = 160, 16
MOST_CLOSE = 32
"""Planes that are looked at again at the higher resolution, at the most. A plane has 13 times the pixels
there, so that is 2.5 times the work of `MOST_PLANES` at the lower one, which tells surfaces among more
planes apart already."""
FEWEST_PX = 24
"""Smaller views are not judged."""
CLEARLY = 0.75
"""Another grid has to leave at most this share of the variance."""
SHARP = 0.5
"""At a surface the variance is at most this share of its mean over the planes."""
FEWEST_SHARP = 0.02
"""Least share of the pixels that have to be sharp anywhere."""
PEAK_SHARE, MOST_PEAKS = 0.08, 4
SAME_PITCH = 0.01
NEAR_LEAST = 0.3
"""Planes count whose variance is above the least by less than this share of the rise to its mean."""
RANDOM_ORDERS = 3
"""Random orders with which the one that was told is compared, if no other explains the views."""
BEYOND = 4.0
"""How much nearer and farther than the range is looked, as a factor of disparity."""
ViewOf = Callable[[int, int], np.ndarray]
ORDERS = tuple(
    ViewOrder(serpentine=serpentine, swap_axes=swap, flip_rows=rows, flip_cols=cols)
    for serpentine in (False, True)
    for swap in (False, True)
    for rows in (False, True)
    for cols in (False, True)
)


@dataclass(frozen=True)
class GridCheck:
    """What a check found."""

    z_mm: tuple[float, ...] = ()
    """Depths at which most is sharp, from near to far; empty if nothing is."""
    order: ViewOrder | None = None
    """An order of the stored views that explains them clearly better than the one that was told."""
    pitches_exchanged: bool = False
    """Whether they are explained clearly better with the two pitches exchanged."""
    outside_mm: float | None = None
    """A depth outside the range, if most of what is sharp is sharp outside."""
    in_no_order: bool = False
    """Whether the views fit together no better than in a random order, which those without texture do."""


def check_grid(
    view: ViewOf,
    grid: CameraGrid,
    z_range_mm: tuple[float, float] | None = None,
    *,
    order: ViewOrder = AS_STORED,
    counted: bool = False,
) -> GridCheck:
    """Where the views (H, W) that `view(k, l)` gives are sharp, and what explains them better than `grid`.

    They were stored in the `order`, as a table or `counted` one by one. Without a range all depths are
    looked at whose parallax is not larger than the views. Small views, single ones and such without texture
    are not judged. Raises `InputError` for a view that holds NaN or infinity, and for a range that is not
    0 < near < far.
    """
    if z_range_mm is not None:
        check_depth_range(z_range_mm)
    if grid.view_count < 2 or min(grid.height, grid.width) < FEWEST_PX:
        return GridCheck()
    small = small_views(view, grid, COARSE_PX)
    z_mm = _planes(grid, z_range_mm, small)
    if z_mm.size < 2:
        return GridCheck()
    told = sweep(small, grid, z_mm)
    if not told.covered.any():
        return GridCheck()
    best, least = GridCheck(), CLEARLY * _remaining(told)
    for mistake, other, numbers in _mistakes(grid, order, counted):
        images = small_views(lambda k, l, n=numbers: view(*divmod(int(n[k, l]), grid.cols)), other, COARSE_PX)
        remaining = _remaining(sweep(images, other, z_mm))
        if remaining < least:
            best, least = mistake, remaining
    if best != GridCheck():
        return best
    z_wide, wide = z_mm, told
    if z_range_mm is not None:
        near, far = z_range_mm
        z_wide = _planes(grid, (near / BEYOND, far * BEYOND), small)
        wide = sweep(small, grid, z_wide)
    if _remaining(wide) > CLEARLY * _remaining_in_random_orders(view, grid, z_wide):
        return GridCheck(in_no_order=True)
    if z_range_mm is not None:
        outside = _outside(wide, z_wide, z_range_mm)
        if outside is not None:
            return GridCheck(outside_mm=outside)
    fine = small_views(view, grid, FINE_PX)
    z_close, close = _closer(fine, grid, z_mm, told)
    found = {_refined(fine, grid, z_close, close, peak) for peak in _peaks(close)}
    return GridCheck(tuple(sorted(found)))


def _remaining_in_random_orders(view: ViewOf, grid: CameraGrid, z_mm: np.ndarray) -> float:
    """What remains of the variance at planes if the views are shuffled, on average."""
    rng, right = np.random.default_rng(0), np.arange(grid.view_count)
    remaining: list[float] = []
    while len(remaining) < RANDOM_ORDERS:
        numbers = rng.permutation(grid.view_count)
        if (numbers == right).all():
            continue
        table = numbers.reshape(grid.rows, grid.cols)
        images = small_views(lambda k, l, n=table: view(*divmod(int(n[k, l]), grid.cols)), grid, COARSE_PX)
        remaining.append(_remaining(sweep(images, grid, z_mm)))
    return float(np.mean(remaining))


def _mistakes(
    grid: CameraGrid, order: ViewOrder, counted: bool
) -> Iterator[tuple[GridCheck, CameraGrid, np.ndarray]]:
    """Each mistake: what would be said of it, the grid without it, and which view its cameras have."""
    K, L = grid.rows, grid.cols
    place = np.argsort(order.numbers(K, L), axis=None)
    for other in ORDERS:
        exchanged = other.swap_axes != order.swap_axes and not counted
        rows, cols = (L, K) if exchanged else (K, L)
        if other != order:
            numbers = place[other.numbers(rows, cols)]
            yield GridCheck(order=other), replace(grid, rows=rows, cols=cols), numbers
    across, down = grid.pitch_mm
    if abs(across / down - 1) > SAME_PITCH:
        same = np.arange(K * L).reshape(K, L)
        yield GridCheck(pitches_exchanged=True), replace(grid, pitch_mm=(down, across)), same


def _planes(grid: CameraGrid, z_range_mm: tuple[float, float] | None, small: SmallViews) -> np.ndarray:
    """Depths from far to near, evenly spread in disparity, at which views move by different whole pixels.

    They are a reduced pixel of total disparity apart if that are not too many.
    """
    largest = max(grid.height, grid.width)
    if z_range_mm is None:
        shear = (max(grid.rows, grid.cols) - 1) * max(map(abs, grid.shear_px))
        far, near = small.scale / 4, shear + largest
    else:
        near, far = (float(total_disparity_px(grid, z)) for z in z_range_mm)
        near = min(near, far + 2 * largest)
    count = int(np.clip(np.ceil((near - far) / small.scale) + 1, 2, MOST_PLANES))
    return _distinct(grid, np.linspace(far, near, count), small)


def _distinct(grid: CameraGrid, total_px: np.ndarray, small: SmallViews) -> np.ndarray:
    """Depths of those total disparities (P,) at which views move by other whole pixels than before."""
    z_mm = depth_of_total_disparity_mm(grid, total_px)
    whole = np.floor(shifts_px(small, grid, z_mm) + 0.5)
    return z_mm[np.append(True, (np.diff(whole, axis=1) != 0).any(axis=(0, 2)))]


def _sharpness(found: Sweep) -> np.ndarray:
    """By how much less the variance (h, w) is at its least than its mean over the planes; 0 if not much."""
    known = np.isfinite(found.variance)
    mean = np.where(known, found.variance, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return np.where(found.least < SHARP * mean, mean - found.least, 0)


def _remaining(found: Sweep) -> float:
    """Mean over the pixels of the least variance."""
    return float(found.least[found.covered].mean()) if found.covered.any() else np.inf


def _mass(found: Sweep) -> np.ndarray:
    """How much is sharp at each plane (P,), with its sum 1; 0 if next to nothing is sharp at all."""
    sharpness = _sharpness(found)
    if np.count_nonzero(sharpness) < FEWEST_SHARP * sharpness.size:
        return np.zeros(len(found.variance))
    best = found.variance.argmin(axis=0)
    mass = np.bincount(best.ravel(), sharpness.ravel(), minlength=len(found.variance))
    return mass / mass.sum()


def _outside(wide: Sweep, z_mm: np.ndarray, z_range_mm: tuple[float, float]) -> float | None:
    """The depth outside the range at which most is sharp, if more is sharp outside than inside; else None."""
    mass = _mass(wide)
    # A plane more on either side belongs to the range: it may be nearest to one that does.
    inside = (z_mm >= z_range_mm[0]) & (z_mm <= z_range_mm[1])
    inside = np.convolve(inside, [1, 1, 1], "same") > 0
    if mass[~inside].sum() <= 0.5:
        return None
    return float(z_mm[np.where(inside, 0, mass).argmax()])


def _peaks(found: Sweep) -> list[int]:
    """Planes at which more is sharp than at their neighbours, those of most first."""
    mass = _mass(found)
    padded = np.pad(mass, 1)
    around = padded[:-2] + padded[1:-1] + padded[2:]
    is_peak = (mass > padded[:-2]) & (mass >= padded[2:]) & (around >= PEAK_SHARE)
    return sorted(np.flatnonzero(is_peak).tolist(), key=lambda plane: -around[plane])[:MOST_PEAKS]


def _closer(fine: SmallViews, grid: CameraGrid, z_mm: np.ndarray, found: Sweep) -> tuple[np.ndarray, Sweep]:
    """Planes a pixel of `fine` apart where anything is sharp, and their sweep; unchanged if these are many.

    Surfaces that are at neighbouring planes of the reduced views are one peak, whose depth is between them.
    """
    sharp = np.flatnonzero(_mass(found) >= PEAK_SHARE / 4)
    if not sharp.size:
        return z_mm, found
    total = total_disparity_px(grid, z_mm)
    first, last = total[max(sharp[0] - 1, 0)], total[min(sharp[-1] + 1, total.size - 1)]
    count = int(np.ceil((last - first) / fine.scale)) + 1
    if count > MOST_CLOSE:
        return z_mm, found
    planes = _distinct(grid, np.linspace(first, last, count), fine)
    close = sweep(fine, grid, planes)
    return (planes, close) if _peaks(close) else (z_mm, found)


def _refined(fine: SmallViews, grid: CameraGrid, z_mm: np.ndarray, found: Sweep, peak: int) -> float:
    """The depth near a plane at which what is sharp there agrees best, at a higher resolution."""
    total = total_disparity_px(grid, z_mm)
    ends = total[max(peak - 2, 0)], total[min(peak + 2, total.size - 1)]
    count = int(np.clip(np.ceil(2 * (ends[1] - ends[0]) / fine.scale), 3, MOST_FINE)) + 1
    planes = depth_of_total_disparity_mm(grid, np.linspace(*ends, count))
    variance = sweep(fine, grid, planes, interpolated=True).variance
    best = found.variance.argmin(axis=0)
    chosen = (np.abs(best - peak) <= 1) & (_sharpness(found) > 0)
    sizes = zip(variance.shape[1:], chosen.shape, strict=True)
    known = chosen[np.ix_(*(np.arange(size) * reduced // size for size, reduced in sizes))]
    known &= np.isfinite(variance).all(axis=0)
    if not known.any():
        return float(z_mm[peak])
    cost = variance[:, known].mean(axis=1)
    weight = np.maximum(cost.min() + NEAR_LEAST * (cost.mean() - cost.min()) - cost, 0)
    if not weight.any():
        return float(z_mm[peak])
    best_px = (weight * total_disparity_px(grid, planes)).sum() / weight.sum()
    return float(depth_of_total_disparity_mm(grid, best_px))
