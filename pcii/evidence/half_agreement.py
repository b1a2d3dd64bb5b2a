"""Whether both halves of the cameras show the same structure, and in focus: one camera shows no depth.

A structure of a single camera predicts itself at any depth, and light that varies slowly, in the scene or by
vignetting, is as likely at one depth as at another. So the cameras are divided like the squares of a
chessboard, and sections are made of each half. In each half the photons of a block are compared with those of
the blocks around it. Where both halves show the same structure the differences have the same sign, and their
products p are positive on average. Of a texture in focus they are larger than at planes so far away that it
is blurred over several blocks. For noise, and for structure in one half only, both signs of a product and of
a difference e of products are equally likely, so that for any weights w

    t = sum w e / sqrt(sum w^2 e^2),    P(t > T) <= exp(-T^2 / 2)

(Efron 1969, "Student's t-test under symmetry conditions"). One product, however large, gives t = 1. Where
photons are few, differences are not symmetric: most blocks are a little darker than their neighbours. So the
sum of squares is taken as at least its expectation for noise, and no product counts for more than a few
standard deviations, lest bright structures decide on what is far from them.

What lies outside the searched range is better in focus there, and what belongs to the films, as vignetting
and hot pixels do, at infinity. So planes outside the range are asked as well, and the smallest blocks that
show structure at any of them decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from pcii.evidence.cells import CELL_PX
from pcii.evidence.weighted_sums import camera_sums, whole_shifts_px
from pcii.imaging.blocks import block_sums, on_pixels
from pcii.imaging.bright_regions import box_around
from pcii.types.focal_planes import FocalPlanes
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

FALSE_RATE = 1e-3
"""Largest share of pure noise in which the halves may seem to agree."""
BLOCKS_CELLS = (1, 2, 4, 8)
"""Sides of the blocks that are compared, in cells: 4 to 32 px, of small films 2 to 16 px."""
OUT_OF_FOCUS_BLOCKS = 3
"""Change of total disparity, in blocks, to a plane out of focus: a block's difference from its neighbours is
averaged away by a blur as wide as all of them."""
OUTSIDE_STEP_PX = 8.0
"""Total disparity between planes outside the range, the first of which is half as far from its end: of
anything outside the smallest blocks, of half a step, are in focus at one plane at least."""
WINDOWS_BLOCKS = (4.0, 8.0)
"""Gaussian windows over which products are summed, in blocks: t of N products is at most sqrt(N)."""
WINDOW_SIGMAS = 4.0
"""Half-width of the truncated windows, in standard deviations."""
PRESENT_BLOCKS, PRESENT_SIGMAS = 1.0, 3.0
"""The windows are wide, and show what is far from their middle as well. So products are to be large in a
narrower one, too, in standard deviations of their noise."""
LEAST_CONTRAST = 0.01
"""Smaller relative differences are not of texture: of noise-free images every difference would be."""
MOST_SIGMAS = 3.0
"""How many standard deviations of its noise a product counts for at most."""


@dataclass(frozen=True)
class Products:
    """Products p of the halves' differences (Z, h, w) float32 in blocks of one size, and their noise.

    `noise` is the expectation of p^2 for noise alone; `compared` bool is where both halves reach a block and
    blocks around it. Elsewhere the others are 0.
    """

    p: np.ndarray
    noise: np.ndarray
    compared: np.ndarray

    def less(self, other: "Products") -> "Products":
        """The difference of products, where there are both."""
        compared = self.compared & other.compared
        return Products(
            np.where(compared, self.p - other.p, 0), np.where(compared, self.noise + other.noise, 0), compared
        )

    def at(self, index: Any) -> "Products":
        """The products of some planes, or of some blocks of each plane."""
        return Products(self.p[index], self.noise[index], self.compared[index])

    def limited(self) -> np.ndarray:
        """p, of which none counts for more than `MOST_SIGMAS` of its noise."""
        most = MOST_SIGMAS * np.sqrt(self.noise)
        return np.clip(self.p, -most, most)


@dataclass(frozen=True)
class Halves:
    """How well the halves agree at Z planes, at planes out of focus and at Y planes outside the range.

    Each has one entry for each size of blocks: `inside` (Z, ...) products at the planes, `outside` (Y, ...)
    those outside the range, `nearer` and `farther` (Z, ...) those out of focus, none unless `halves_of` was
    asked for them.
    """

    inside: Sequence[Products]
    outside: Sequence[Products]
    nearer: Sequence[Products] = ()
    farther: Sequence[Products] = ()

    @property
    def planes(self) -> int:
        """Number of planes."""
        return len(self.inside[0].p)

    def agree(self, label: np.ndarray, where: np.ndarray) -> np.ndarray:
        """Where (h, w) bool the halves agree, around each cell, that there is a surface at the plane `label`.

        `label` (h, w) are indices of planes, `where` (h, w) bool the cells that are asked about. The smallest
        blocks and windows decide in which the halves agree at that plane or at one outside the range.
        """
        agreed, undecided = np.zeros(label.shape, bool), where.copy()
        for size, sigma in product(range(len(BLOCKS_CELLS)), WINDOWS_BLOCKS):
            if not undecided.any():
                break
            here, own_sum = self._at_labels(size, sigma, label, undecided)
            outside, outside_sum = self._outside_range(size, sigma, undecided)
            is_inside = own_sum >= outside_sum
            agreed |= undecided & here & is_inside
            undecided &= ~here & (is_inside | ~outside)
        return agreed

    def agreement_of_film(self) -> float:
        """t over the whole film, the largest of all planes and sizes of blocks.

        Of blocks of a size for which the halves agree better outside the range it is 0. That there is
        structure is enough: at what depth, other evidence decides.
        """
        largest = 0.0
        for inside, outside in zip(self.inside, self.outside, strict=True):
            total = inside.p.sum(axis=(1, 2))
            if total.max() >= outside.p.sum(axis=(1, 2)).max(initial=-np.inf):
                squares = np.maximum((inside.p**2).sum(axis=(1, 2)), inside.noise.sum(axis=(1, 2)))
                largest = max(largest, float(_t(total, squares).max()))
        return largest

    def _at_labels(
        self, size: int, sigma: float, label: np.ndarray, where: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Whether the halves agree around each cell at its own plane (h, w), and the sums of products."""
        side, reach = BLOCKS_CELLS[size], int(WINDOW_SIGMAS * sigma)
        agreed, total = np.zeros(label.shape, bool), np.zeros(label.shape)
        for z in np.unique(label[where]):
            at_plane = where & (label == z)
            rows, cols = box_around(block_sums(at_plane, side, np.float64) > 0, (reach, reach))
            own, nearer, farther = (
                each[size].at((z, rows, cols)) for each in (self.inside, self.nearer, self.farther)
            )
            excess = own.less(nearer), own.less(farther)
            agree = np.minimum(*(_agreement(e, sigma) for e in excess)) >= least_agreement(self.planes)
            cells = tuple(slice(axis.start * side, axis.stop * side) for axis in (rows, cols))
            selected = at_plane[cells]
            for result, values in ((agreed, agree), (total, _windowed(own.p, sigma))):
                result[cells][selected] = on_pixels(values, side, selected.shape)[selected]
        return agreed, total

    def _outside_range(self, size: int, sigma: float, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether halves agree around the cells `where` on anything outside (h, w), and the largest sums."""
        side, reach, outside = BLOCKS_CELLS[size], int(WINDOW_SIGMAS * sigma), self.outside[size]
        agreed, largest = np.zeros(outside.p.shape[1:], bool), np.full(outside.p.shape[1:], -np.inf)
        box = box_around(block_sums(where, side, np.float64) > 0, (reach, reach))
        for z in range(len(outside.p)):
            there = outside.at((z, *box))
            agreed[box] |= _agreement(there, sigma) >= least_agreement(len(outside.p))
            np.maximum(largest[box], _windowed(there.p, sigma), out=largest[box])
        return on_pixels(agreed, side, where.shape), on_pixels(largest, side, where.shape)


def least_agreement(planes: int) -> float:
    """The t that noise exceeds with probability `FALSE_RATE` at most at any of so many planes.

    sqrt(2 log(planes / FALSE_RATE)), from the bound of Efron. For normal products that is about ten times the
    probability itself, which leaves room for the several, overlapping windows.

    >>> round(least_agreement(100), 3)
    4.799
    """
    return float(np.sqrt(2 * np.log(planes / FALSE_RATE)))


def halves_of(
    data: PhotonCounts | Views, planes: FocalPlanes, *, cell_px: int = CELL_PX, out_of_focus: bool = False
) -> Halves:
    """How well the halves of the cameras agree at these planes and outside their range.

    With `out_of_focus` also at planes nearer and farther than each, which `Halves.agree` needs. `cell_px` is
    the side of the cells, a multiple of `BLOCK_PX`; a thing with texture needs some six cells across.
    """
    own_px = planes.total_disparity_px
    nearest, farthest = own_px.max(), own_px.min()
    # From infinity, where the films' own structure is, to as far in front of the range.
    away_px = OUTSIDE_STEP_PX * (np.arange(np.ceil(nearest / OUTSIDE_STEP_PX)) + 0.5)
    behind_px = farthest - away_px
    outside_px = np.concatenate([np.maximum(behind_px[behind_px > -OUTSIDE_STEP_PX], 0), nearest + away_px])
    groups_px = [
        (own_px, outside_px, *(_out_of_focus_px(own_px, side * cell_px) if out_of_focus else ()))
        for side in BLOCKS_CELLS
    ]
    total_px = np.unique(np.concatenate([px for groups in groups_px for px in groups]))
    half = np.add.outer(np.arange(data.grid.rows), np.arange(data.grid.cols)) % 2
    weights = np.stack([half == 0, half == 1]).astype(np.float64)
    sums, samples = camera_sums(data, whole_shifts_px(data.grid, total_px), weights, cell_px)
    halves: list[list[Products]] = []
    for side, groups in zip(BLOCKS_CELLS, groups_px, strict=True):
        used, places = np.unique(np.searchsorted(total_px, np.concatenate(groups)), return_inverse=True)
        products = _products(sums, samples, used, side, is_counted=isinstance(data, PhotonCounts))
        ends = np.cumsum([px.size for px in groups])[:-1]
        halves.append([products.at(part) for part in np.split(places, ends)])
    return Halves(*zip(*halves, strict=True))


def _out_of_focus_px(own_px: np.ndarray, block_px: int) -> tuple[np.ndarray, np.ndarray]:
    """Total disparities (Z,) nearer and farther than those of the planes, for blocks of `block_px`."""
    # They need not be exact: rounded, those of many planes are the same.
    step_px, away_px = block_px / 2, OUT_OF_FOCUS_BLOCKS * block_px
    nearer, farther = (step_px * np.round((own_px + away) / step_px) for away in (away_px, -away_px))
    return nearer, farther


def _products(
    sums: np.ndarray, samples: np.ndarray, used: np.ndarray, side: int, *, is_counted: bool
) -> Products:
    """Products, over the halves, of each block's relative difference from its neighbours, at planes `used`.

    `sums` and `samples` (Z, 2, h, w) are those of the halves in cells.
    """
    from pcii.base.compiled_loops import each_in_threads

    def of_plane(z: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return _products_of_plane(sums[z], samples[z], side, is_counted=is_counted)

    planes = each_in_threads(of_plane, used.tolist())
    return Products(*(np.stack(part) for part in zip(*planes, strict=True)))


def _products_of_plane(
    sums: np.ndarray, samples: np.ndarray, side: int, *, is_counted: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    shape = block_sums(sums[0], side, np.float64).shape
    products, noise, compared = np.ones(shape), np.ones(shape), np.ones(shape, bool)
    for half_sums, half_samples in zip(sums, samples, strict=True):
        own_sums, own_samples = (block_sums(part, side, np.float64) for part in (half_sums, half_samples))
        near_sums, near_samples = _neighbour_sums(own_sums), _neighbour_sums(own_samples)
        covered = (own_samples > 0) & (near_samples > 0)
        expected = np.divide(own_samples * near_sums, near_samples, out=np.zeros(shape), where=covered)
        # Blocks darker than average have no more weight than average ones.
        scale = np.abs(expected) + np.abs(expected).mean()
        scale += scale == 0
        products *= (own_sums - expected) / scale
        noise *= LEAST_CONTRAST**2 + (np.maximum(expected, 0) / scale**2 if is_counted else 0.0)
        compared &= covered
    products, noise = (np.where(compared, part, 0).astype(np.float32) for part in (products, noise))
    return products, noise, compared


def _neighbour_sums(blocks: np.ndarray) -> np.ndarray:
    """Sums over the eight blocks around each."""
    padded = np.pad(blocks, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - blocks


def _windowed(values: np.ndarray, sigma: float) -> np.ndarray:
    """Sums of values in Gaussian windows around each block, of weight 1 at their centres."""
    from scipy.ndimage import gaussian_filter

    window = {"mode": "constant", "radius": int(np.ceil(WINDOW_SIGMAS * sigma))}
    return 2 * np.pi * sigma**2 * gaussian_filter(values, sigma, **window)


def _agreement(products: Products, sigma: float) -> np.ndarray:
    """t of Gaussian windows around each block; if a few blocks far from its middle alone show it, 0."""
    t, limited = _windowed_t(products.p, products.noise, sigma), products.limited()
    narrow = _t(_windowed(limited, PRESENT_BLOCKS), _windowed(products.noise, PRESENT_BLOCKS / np.sqrt(2)))
    return np.where(narrow >= PRESENT_SIGMAS, t, np.minimum(t, _windowed_t(limited, products.noise, sigma)))


def _windowed_t(p: np.ndarray, noise: np.ndarray, sigma: float) -> np.ndarray:
    """t of Gaussian windows around each block, from products and their noise."""
    # The square of a Gaussian is a Gaussian of 1 / sqrt(2) the width.
    squares, expected = (_windowed(values, sigma / np.sqrt(2)) for values in (p**2, noise))
    return _t(_windowed(p, sigma), np.maximum(squares, expected))


def _t(total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    return np.divide(total, np.sqrt(np.maximum(squares, 0)), out=np.zeros_like(total), where=squares > 0)
