"""Whether both halves of the cameras show the same structure: evidence of depth needs several cameras.

A structure of a single camera, such as a hot pixel, predicts itself at any depth. So the cameras are divided
like the squares of a chessboard, and a section is made of each half. In each half the photons of a block are
compared with those of the blocks around it. Where both halves show the same structure the differences have
the same sign, and their products p are positive on average. Blurred structures agree as well: this tests
that there is structure, not at what depth it is. For noise, and for structure in one half only, both signs
of a product are equally likely, so that for any weights w

    t = sum w p / sqrt(sum w^2 p^2),    P(t > T) <= exp(-T^2 / 2)

(Efron 1969, "Student's t-test under symmetry conditions"). One product, however large, gives t = 1. Where
photons are few, differences are not symmetric: most blocks are a little darker than their neighbours. So the
sum of squares is taken as at least its expectation for Poisson noise.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.evidence.cells import CELL_PX
from pcii.imaging.bright_regions import box_around

FALSE_RATE = 1e-3
"""Largest share of pure noise in which the halves may seem to agree."""
BLOCKS_CELLS = (1, 2, 4, 8)
"""Sides of the blocks that are compared, in cells: 4 to 32 px."""
WINDOWS_BLOCKS = (4.0, 8.0)
"""Gaussian windows over which products are summed, in blocks: t of N products is at most sqrt(N)."""
WINDOW_SIGMAS = 4.0
"""Half-width of the truncated windows, in standard deviations."""
ROUNDING = 1e-9
"""Differences below this share of the expected photons are rounding errors."""


@dataclass(frozen=True)
class Halves:
    """Products of the halves' differences for blocks of s x s cells, (Z, h / s, w / s) float64 for each s.

    `products` are p, `noise` the expectation of p^2 under Poisson noise alone.
    """

    products: Sequence[np.ndarray]
    noise: Sequence[np.ndarray]

    @property
    def planes(self) -> int:
        """Number of planes."""
        return len(self.products[0])

    def agreement(self, label: np.ndarray, where: np.ndarray) -> np.ndarray:
        """t (h, w) of the windows around each cell at the plane `label` (h, w), the largest of all windows.

        Computed for cells that are `where` (h, w) bool; 0 elsewhere.
        """
        result = np.zeros(label.shape)
        for z in np.unique(label[where]):
            at_plane = where & (label == z)
            for side, products, noise in zip(BLOCKS_CELLS, self.products, self.noise, strict=True):
                for sigma in WINDOWS_BLOCKS:
                    reach = int(WINDOW_SIGMAS * sigma)
                    box = box_around(_block_sums(at_plane, side) > 0, (reach, reach))
                    t = _windowed_t(products[z][box], noise[z][box], sigma)
                    t = t.repeat(side, axis=0).repeat(side, axis=1)
                    cells = tuple(slice(axis.start * side, axis.stop * side) for axis in box)
                    selected, largest = at_plane[cells], result[cells]
                    t = t[: largest.shape[0], : largest.shape[1]]
                    largest[selected] = np.maximum(largest, t)[selected]
        return result

    def agreement_over(self, rows: slice, cols: slice, where: np.ndarray) -> float:
        """t over the cells `where` (bool) of the box `rows`, `cols`, the largest of all planes and sizes.

        All planes, since the halves may agree best at the plane of a surface in front of a region.
        """
        cells = np.zeros(self.products[0].shape[1:])
        cells[rows, cols] = where
        largest = 0.0
        for side, products, noise in zip(BLOCKS_CELLS, self.products, self.noise, strict=True):
            weight = _block_sums(cells, side)
            inside = weight > 0
            weight, p, v = weight[inside], products[:, inside], noise[:, inside]
            squares = np.maximum(p**2 @ weight**2, v @ weight**2)
            largest = max(largest, float(_t(p @ weight, squares).max()))
        return largest


def least_agreement(planes: int) -> float:
    """The t that noise exceeds with probability `FALSE_RATE` at most at any of so many planes.

    sqrt(2 log(planes / FALSE_RATE)), from the bound of Efron. For normal products that is about ten times the
    probability itself, which leaves room for the several, overlapping windows.

    >>> round(least_agreement(100), 3)
    4.799
    """
    return float(np.sqrt(2 * np.log(planes / FALSE_RATE)))


def halves_of(counts: PhotonCounts, planes: FocalPlanes) -> Halves:
    """Products of the halves' differences in the sections at these planes."""
    from pcii.base.compiled_loops import threads

    grid, events = counts.grid, counts.events
    rows, cols = planes.whole_shifts_px
    h, w = -(-grid.height // CELL_PX), -(-grid.width // CELL_PX)
    half_of = (events.k + events.l) % 2
    place = events.k, events.l, events.i, events.j
    n = events.n.astype(np.float64)

    def compare(z: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
        from pcii.evidence.projection_kernels import cells_of_events, views_of_blocks

        cell = np.empty(n.size, np.int32)
        cells_of_events(*place, rows[z], cols[z], (grid.height, grid.width), cell)
        halves = []
        for half in (0, 1):
            in_half = (cell >= 0) & (half_of == half)
            photons = np.bincount(cell[in_half], n[in_half], h * w).reshape(h, w)
            samples = np.zeros((h, w))
            for parity in (0, 1):
                half_shifts = rows[z][parity::2], cols[z][(parity + half) % 2 :: 2]
                by_row, by_col = (
                    views_of_blocks(shifts, size, 2 * cells).reshape(cells, 2).sum(axis=1)
                    for shifts, size, cells in zip(
                        half_shifts, (grid.height, grid.width), (h, w), strict=True
                    )
                )
                samples += np.outer(by_row, by_col)
            halves.append((photons, samples))
        products, noise = zip(*(_products(halves, side) for side in BLOCKS_CELLS), strict=True)
        return list(products), list(noise)

    with ThreadPoolExecutor(threads()) as pool:
        by_plane = list(pool.map(compare, range(len(rows))))
    products, noise = (
        [np.stack(sizes) for sizes in zip(*quantity, strict=True)] for quantity in zip(*by_plane, strict=True)
    )
    return Halves(products, noise)


def _products(halves: Sequence[tuple[np.ndarray, np.ndarray]], side: int) -> tuple[np.ndarray, np.ndarray]:
    """Products, over the halves, of each block's relative difference from its neighbours, and their noise.

    `halves` has the photons and samples (h, w) of each half.
    """
    shape = _block_sums(halves[0][0], side).shape
    products, noise = np.ones(shape), np.ones(shape)
    for photons, samples in halves:
        block_photons, block_samples = _block_sums(photons, side), _block_sums(samples, side)
        near_photons, near_samples = _neighbour_sums(block_photons), _neighbour_sums(block_samples)
        covered = (block_samples > 0) & (near_samples > 0)
        expected = np.divide(block_samples * near_photons, near_samples, out=np.zeros(shape), where=covered)
        difference = np.where(covered, block_photons - expected, 0.0)
        difference[np.abs(difference) < ROUNDING * expected] = 0
        # Blocks darker than average have no more weight than average ones.
        scale = expected + expected.mean() + (expected.mean() == 0)
        products *= difference / scale
        noise *= expected / scale**2
    return products, noise


def _neighbour_sums(blocks: np.ndarray) -> np.ndarray:
    """Sums over the eight blocks around each."""
    padded = np.pad(blocks, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - blocks


def _block_sums(cells: np.ndarray, side: int) -> np.ndarray:
    """Sums over blocks of `side` x `side` cells, sizes rounded up."""
    h, w = cells.shape
    padded = np.pad(cells, ((0, -h % side), (0, -w % side)))
    return padded.reshape(padded.shape[0] // side, side, -1, side).sum(axis=(1, 3))


def _windowed_t(products: np.ndarray, noise: np.ndarray, sigma: float) -> np.ndarray:
    """t of Gaussian windows around each block, from the products and their noise."""
    from scipy.ndimage import gaussian_filter

    truncated = {"mode": "constant", "radius": int(WINDOW_SIGMAS * sigma)}
    total = 2 * np.pi * sigma**2 * gaussian_filter(products, sigma, **truncated)
    # The square of a Gaussian is a Gaussian of 1 / sqrt(2) the width, truncated at the same radius.
    squares, expected = (
        np.pi * sigma**2 * gaussian_filter(values, sigma / np.sqrt(2), **truncated)
        for values in (products**2, noise)
    )
    return _t(total, np.maximum(squares, expected))


def _t(total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    return np.divide(total, np.sqrt(np.maximum(squares, 0)), out=np.zeros_like(total), where=squares > 0)
