"""How well views agree at each of many depths: a plane sweep at reduced resolution.

At the depth of a surface, the views of it lie on each other and their variance is small. Notation: V views,
(h, w) reduced pixels, P planes.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from pcii.core.geometry import disparity_px
from pcii.imaging.blocks import block_sums, evenly_chosen

MOST_CAMERAS = 5
"""Most camera rows, and columns, that are used: first, last, and equally spread between."""
BLUR_PX, BACKGROUND_PX = 0.7, 8.0
"""Views are blurred, so that half pixels do not matter, and lose what is smooth, such as vignetting."""
WINDOW_PX = 5
"""Side of the window over which the variance is averaged."""
FEWEST_SHARE = 0.6
"""Share of the views that have to reach a pixel, and of the pixels that have to be reached in a window."""


@dataclass(frozen=True, eq=False)
class SmallViews:
    """Some views (V, h, w), float32, reduced by the factor `scale`, of the cameras `rows` and `cols` (V,)."""

    images: np.ndarray
    rows: np.ndarray
    cols: np.ndarray
    scale: int


@dataclass(frozen=True, eq=False)
class Sweep:
    """Variance of the views in a window around each pixel at each plane, (P, h, w); inf where few reach."""

    variance: np.ndarray

    @property
    def covered(self) -> np.ndarray:
        """Pixels (h, w), bool, that enough views reach at some plane."""
        return np.asarray(np.isfinite(self.variance).any(axis=0))

    @property
    def least(self) -> np.ndarray:
        """Least variance (h, w) over the planes, 0 where there is none."""
        return np.where(self.covered, self.variance.min(axis=0), 0)


def small_views(view: Callable[[int, int], np.ndarray], grid: CameraGrid, most_px: int) -> SmallViews:
    """Views (H, W) of up to 5 x 5 cameras, averaged over cells of pixels so that no side exceeds `most_px`.

    Cells are of an even number of pixels, so that each holds all colours of a Bayer pattern, unless the views
    are small.
    """
    rows, cols = (np.array(evenly_chosen(count, MOST_CAMERAS)) for count in (grid.rows, grid.cols))
    scale = -(-max(grid.height, grid.width) // most_px)
    scale = max(1, min(scale + scale % 2 if scale > 1 else 1, grid.height, grid.width))
    images = [_reduced(_finite(view(k, l), k, l), scale) for k in rows for l in cols]
    return SmallViews(np.stack(images), np.repeat(rows, cols.size), np.tile(cols, rows.size), scale)


def _finite(image: np.ndarray, k: int, l: int) -> np.ndarray:
    if not np.isfinite(image).all():
        raise InputError(f"view: view ({k}, {l}) holds NaN or infinity")
    return image


def _reduced(image: np.ndarray, scale: int) -> np.ndarray:
    """Band-passed square root of the mean light of cells: noise and contrast no longer follow brightness."""
    from scipy.ndimage import gaussian_filter

    h, w = (size // scale for size in image.shape)
    largest = float(np.abs(image).max(initial=0))
    if largest > 1e30 or 0 < largest < 1e-30:  # squares and sums in single precision
        image = image / largest
    cells = block_sums(image[: h * scale, : w * scale], scale, np.float32) / scale**2
    light = np.sqrt(np.maximum(cells, 0))
    light /= max(float(light.mean()), 1e-30)
    return gaussian_filter(light, BLUR_PX) - gaussian_filter(light, BACKGROUND_PX)


def shifts_px(small: SmallViews, grid: CameraGrid, z_mm: np.ndarray) -> np.ndarray:
    """By how many reduced pixels each view moves down and right at each depth, (2, P, V)."""
    across, down = disparity_px(grid, z_mm)
    rows, cols = small.rows - (grid.rows - 1) / 2, small.cols - (grid.cols - 1) / 2
    return np.stack([down[:, None] * rows, across[:, None] * cols]) / small.scale


def sweep(small: SmallViews, grid: CameraGrid, z_mm: np.ndarray, *, interpolated: bool = False) -> Sweep:
    """Variance of the views at planes of the depths `z_mm`, if they were taken by the cameras of `grid`.

    Views move by whole pixels, unless `interpolated`.
    """
    from scipy.ndimage import uniform_filter

    exact = shifts_px(small, grid, z_mm)
    whole = np.floor(exact if interpolated else exact + 0.5).astype(int)
    _, h, w = small.images.shape
    fewest = max(2, FEWEST_SHARE * len(small.images))
    variance = np.full((z_mm.size, h, w), np.inf, np.float32)
    for plane in range(z_mm.size):
        total, squares, number = (np.zeros((h, w), np.float32) for _ in range(3))
        for number_of_view, image in enumerate(small.images):
            dy, dx = whole[:, plane, number_of_view]
            if abs(dy) >= h or abs(dx) >= w:
                continue
            if interpolated:
                image = _between(image, *(exact - whole)[:, plane, number_of_view])
            target = _overlap(h, dy), _overlap(w, dx)
            moved = image[_overlap(h, -dy), _overlap(w, -dx)]
            total[target] += moved
            squares[target] += moved * moved
            number[target] += 1
        enough = number >= fewest
        spread = (squares - total**2 / np.maximum(number, 1)) / np.maximum(number - 1, 1)
        reached = uniform_filter(enough.astype(np.float32), WINDOW_PX, mode="constant")
        summed = uniform_filter(np.where(enough, np.maximum(spread, 0), 0), WINDOW_PX, mode="constant")
        known = reached >= FEWEST_SHARE
        variance[plane][known] = summed[known] / reached[known]
    return Sweep(variance)


def _between(image: np.ndarray, down: float, right: float) -> np.ndarray:
    """An image that is moved by shares of a pixel, by linear interpolation."""
    moved = image.copy()
    moved[1:] += np.float32(down) * (image[:-1] - image[1:])
    image = moved.copy()
    moved[:, 1:] += np.float32(right) * (image[:, :-1] - image[:, 1:])
    return moved


def _overlap(size: int, shift: int) -> slice:
    """Pixels of an axis onto which others that move by `shift` fall."""
    return slice(max(0, shift), size + min(0, shift))
