"""Do both halves of the cameras show the same thing? Evidence of depth needs several cameras.

What a single camera shows, a hot pixel or a texture that no other camera confirms, predicts itself at any
depth. So the cameras are parted as the squares of a chessboard are, and a section is made of each half. In
each the light of a block is compared with that of the blocks around it. Where both halves see the same the
differences agree in sign and place, and their products p are positive on average; blurred light agrees, too:
this tells that something is seen, not at what depth. Of noise, and of what one half alone shows, products are
as often of either sign, so that for any weights w

    t = sum w p / sqrt(sum w^2 p^2),    P(t > T) <= exp(-T^2 / 2)

(Efron 1969, "Student's t-test under symmetry conditions"). One product, however large, gives t = 1. Where
photons are few differences are not symmetric: most blocks are a little darker than what is around them. So
the sum of squares counts as no less than Poisson noise makes it.
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
"""Where there is nothing but noise at most such a share is answered."""
BLOCKS_CELLS = (1, 2, 4, 8)
"""Sides of the blocks that are compared, in cells: 4 to 32 px."""
WINDOWS_BLOCKS = (4.0, 8.0)
"""Gaussian windows over which products are summed, in blocks: t is at most the root of how many there are."""
WINDOW_SIGMAS = 4.0
"""Windows end so far out."""
ROUNDING = 1e-9
"""Differences of less than this share of the light are rounding errors."""


@dataclass(frozen=True)
class Halves:
    """What the halves show, of blocks of s x s cells for each s, (Z, h / s, w / s) float64 each.

    `products` p, and what Poisson noise alone makes of p^2 on average: `noise`.
    """

    products: Sequence[np.ndarray]
    noise: Sequence[np.ndarray]

    @property
    def planes(self) -> int:
        """How many depths were looked at."""
        return len(self.products[0])

    def agreement(self, label: np.ndarray, where: np.ndarray) -> np.ndarray:
        """t (h, w) around each cell at the plane (h, w) that is its label, the largest of all windows.

        Only cells that are `where` (h, w) are looked at; the others have 0.
        """
        result = np.zeros(label.shape)
        for z in np.unique(label[where]):
            here = where & (label == z)
            for side, products, noise in zip(BLOCKS_CELLS, self.products, self.noise, strict=True):
                for sigma in WINDOWS_BLOCKS:
                    reach = int(WINDOW_SIGMAS * sigma)
                    box = box_around(_summed(here, side) > 0, (reach, reach))
                    t = _around_each(products[z][box], noise[z][box], sigma)
                    t = t.repeat(side, axis=0).repeat(side, axis=1)
                    cells = tuple(slice(part.start * side, part.stop * side) for part in box)
                    mine, part = here[cells], result[cells]
                    part[mine] = np.maximum(part, t[: part.shape[0], : part.shape[1]])[mine]
        return result

    def agreement_over(self, rows: slice, cols: slice, where: np.ndarray) -> float:
        """t over the cells that are `where` in this box, the largest of all planes and block sizes.

        Of all planes, since the halves agree on what is behind leaves less than on the leaves.
        """
        whole = np.zeros(self.products[0].shape[1:])
        whole[rows, cols] = where
        largest = 0.0
        for side, products, noise in zip(BLOCKS_CELLS, self.products, self.noise, strict=True):
            weight = _summed(whole, side)
            here = weight > 0
            weight, p, v = weight[here], products[:, here], noise[:, here]
            squares = np.maximum(p**2 @ weight**2, v @ weight**2)
            largest = max(largest, float(_ratio(p @ weight, squares).max()))
        return largest


def least_agreement(planes: int) -> float:
    """What t must exceed so that by chance it does in `FALSE_RATE` of places, at any of so many planes.

    The bound is some ten times what normal products exceed it by: enough for all windows, which overlap.
    """
    return float(np.sqrt(2 * np.log(planes / FALSE_RATE)))


def halves_of(counts: PhotonCounts, planes: FocalPlanes) -> Halves:
    """What the halves show in the sections at these planes."""
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
        shown = []
        for which in (0, 1):
            mine = (cell >= 0) & (half_of == which)
            photons = np.bincount(cell[mine], n[mine], h * w).reshape(h, w)
            samples = np.zeros((h, w))
            for parity in (0, 1):
                own = rows[z][parity::2], cols[z][(parity + which) % 2 :: 2]
                by_row, by_col = (
                    views_of_blocks(shifts, size, 2 * cells).reshape(cells, 2).sum(axis=1)
                    for shifts, size, cells in zip(own, (grid.height, grid.width), (h, w), strict=True)
                )
                samples += np.outer(by_row, by_col)
            shown.append((photons, samples))
        products, noise = zip(*(_products(shown, side) for side in BLOCKS_CELLS), strict=True)
        return list(products), list(noise)

    with ThreadPoolExecutor(threads()) as pool:
        found = list(pool.map(compare, range(len(rows))))
    products, noise = (
        [np.stack(planes) for planes in zip(*part, strict=True)] for part in zip(*found, strict=True)
    )
    return Halves(products, noise)


def _products(shown: Sequence[tuple[np.ndarray, np.ndarray]], side: int) -> tuple[np.ndarray, np.ndarray]:
    """Products of how far the light of blocks differs in each half from that around them, and their noise."""
    shape = _summed(shown[0][0], side).shape
    products, noise = np.ones(shape), np.ones(shape)
    for photons, samples in shown:
        light, seen = _summed(photons, side), _summed(samples, side)
        around, views = _of_neighbours(light), _of_neighbours(seen)
        both = (seen > 0) & (views > 0)
        smooth = np.divide(seen * around, views, out=np.zeros(shape), where=both)
        difference = np.where(both, light - smooth, 0.0)
        difference[np.abs(difference) < ROUNDING * smooth] = 0
        # What is darker than average says no more than what is average.
        scale = smooth + smooth.mean() + (smooth.mean() == 0)
        products *= difference / scale
        noise *= smooth / scale**2
    return products, noise


def _of_neighbours(blocks: np.ndarray) -> np.ndarray:
    """Sums over the eight blocks around each."""
    padded = np.pad(blocks, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - blocks


def _summed(cells: np.ndarray, side: int) -> np.ndarray:
    """Sums over blocks of so many cells along each side, sizes rounded up."""
    h, w = cells.shape
    padded = np.pad(cells, ((0, -h % side), (0, -w % side)))
    return padded.reshape(padded.shape[0] // side, side, -1, side).sum(axis=(1, 3))


def _around_each(products: np.ndarray, noise: np.ndarray, sigma: float) -> np.ndarray:
    """t of Gaussian windows about each block, from the products and their noise."""
    from scipy.ndimage import gaussian_filter

    ends = {"mode": "constant", "radius": int(WINDOW_SIGMAS * sigma)}
    total = 2 * np.pi * sigma**2 * gaussian_filter(products, sigma, **ends)
    # The square of a Gaussian is one of 1 / sqrt(2) the width; both end at the same place.
    squares, expected = (
        np.pi * sigma**2 * gaussian_filter(part, sigma / np.sqrt(2), **ends) for part in (products**2, noise)
    )
    return _ratio(total, np.maximum(squares, expected))


def _ratio(total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    return np.divide(total, np.sqrt(np.maximum(squares, 0)), out=np.zeros_like(total), where=squares > 0)
