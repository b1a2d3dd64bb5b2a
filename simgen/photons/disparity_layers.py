"""Layers of disparity and their tiles: pieces of surface that all views share.

A point of the scene moves from view to view by its disparity. A layer holds what has nearly the same
disparity, on square tiles that move along with it: what is found in one view is known for all. Shifts and
tiles are even, so that a tile holds whole Bayer cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pcii.types import CameraGrid

TILES_ACROSS = 256
"""Largest number of tiles along the longer side of a film, about, whatever its pixels."""
RAYS_PER_TILE = 4
"""Rays of a pilot: with one in each quarter of a tile hardly a piece of surface is missed."""
LAYER_BLUR_TILES = 0.5
"""Layers are so thin that their tiles are off by no more than this share of a tile in any view."""
MAX_LAYERS = 64


class Samples(NamedTuple):
    """Paths (N,): where they went through which film, and the radiance that they found.

    `guess` and `light` are (N, C); `light` is NaN for paths that were not followed beyond the first
    hit.
    """

    k: np.ndarray
    l: np.ndarray
    row: np.ndarray
    col: np.ndarray
    z_mm: np.ndarray
    guess: np.ndarray
    light: np.ndarray

    @property
    def followed(self) -> np.ndarray:
        """Which paths were, (N,) bool."""
        return np.isfinite(self.light[:, 0])

    def take(self, which: np.ndarray) -> "Samples":
        """Some of them, by mask or index."""
        return Samples(*(column[which] for column in self))

    @staticmethod
    def joined(parts: "Sequence[Samples]") -> "Samples":
        """Those of all parts, one part after the other."""
        return Samples(*map(np.concatenate, zip(*parts, strict=True)))


@dataclass(frozen=True)
class DisparityLayers:
    """Layers of disparity and their tiles.

    Pixel (i, j) of camera (k, l) lies on the tile of row (i + row_shift[n, k]) // tile_px of layer n,
    and likewise for columns. What has a disparity near d `step_px`, in px per camera step along the
    longer pitch, is in layer `layer_at[d]`.
    """

    tile_px: int
    step_px: float
    disparity_mm: float
    """Disparity in px times z in mm."""
    layer_at: np.ndarray
    row_shift: np.ndarray
    col_shift: np.ndarray
    rows: int
    cols: int

    @property
    def tiles(self) -> int:
        """How many tiles all layers have."""
        return len(self.row_shift) * self.rows * self.cols

    def layer_of(self, z_mm: np.ndarray) -> np.ndarray:
        """Layer of first hits at planar depth `z_mm`; of what is nearer than all, the nearest layer."""
        per_mm = self.disparity_mm / self.step_px
        nearness = per_mm / np.maximum(z_mm, per_mm / self.layer_at.size)
        return self.layer_at[np.minimum(np.rint(nearness), self.layer_at.size - 1).astype(np.int64)]

    def tiles_of(self, samples: Samples, aside: int = 0) -> np.ndarray:
        """Flat index (layer, row, column) of each path's tile, in its own layer or one beside it."""
        layer = np.clip(self.layer_of(samples.z_mm) + aside, 0, len(self.row_shift) - 1)
        row = (samples.row + self.row_shift[layer, samples.k]) // self.tile_px
        col = (samples.col + self.col_shift[layer, samples.l]) // self.tile_px
        return self.flat(layer, row, col)

    def flat(self, layer: np.ndarray, row: np.ndarray, col: np.ndarray) -> np.ndarray:
        """One index for the tile (row, column) of a layer."""
        return (layer * self.rows + row) * self.cols + col

    def layer_row_col(self, tiles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Layer, row and column of flat indices."""
        rest, col = np.divmod(tiles, self.cols)
        layer, row = np.divmod(rest, self.rows)
        return layer, row, col

    def around(self, tiles: np.ndarray, reach: int = 1) -> np.ndarray:
        """Flat indices (N, (2 reach + 1)^2) of the tiles up to `reach` away; the border's own beyond it."""
        layer, row, col = self.layer_row_col(tiles)
        return self.flat(layer[:, None], *squares_around(row, col, reach, self.rows, self.cols))

    def merged(self, side: int) -> "DisparityLayers":
        """The same layers with tiles of `side` x `side` of these."""
        rows, cols = -(-self.rows // side), -(-self.cols // side)
        return replace(self, tile_px=side * self.tile_px, rows=rows, cols=cols)

    def merge(self, tiles: np.ndarray, side: int) -> np.ndarray:
        """Flat indices, in `merged(side)`, of the tiles that these lie in."""
        layer, row, col = self.layer_row_col(tiles)
        return self.merged(side).flat(layer, row // side, col // side)


def squares_around(
    row: np.ndarray, col: np.ndarray, reach: int, rows: int, cols: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns (N, (2 reach + 1)^2) of places up to `reach` away; the border's own beyond it."""
    down, right = np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1) - reach
    return np.clip(row[:, None] + down, 0, rows - 1), np.clip(col[:, None] + right, 0, cols - 1)


def layers_for(grid: CameraGrid, tile_px: int, z_mm: np.ndarray) -> DisparityLayers:
    """Layers for the depths of a pilot's first hits; depths in between go to the nearest of these."""
    longer = max(grid.pitch_mm)
    disparity_mm = grid.focal_mm * longer / grid.pixel_mm
    cameras = max(grid.rows, grid.cols)
    # A point that moves by more than a film from camera to camera, as in their own plane, is seen by one.
    disparity_px = disparity_mm / np.maximum(z_mm, disparity_mm / max(grid.height, grid.width))
    thin = 4 * LAYER_BLUR_TILES * tile_px / max(cameras - 1, 1)
    step_px = max(thin, float(disparity_px.max()) / MAX_LAYERS)
    levels = np.unique(np.rint(disparity_px / step_px))
    steps = np.arange(int(levels[-1]) + 1)
    layer_at = np.abs(steps[:, None] - levels).argmin(axis=1)
    # Further right a camera sees the point further left, but for shear, so its film moves right by as much.
    disparity = levels[:, None] * step_px
    col = _from_zero((disparity * grid.pitch_mm[0] / longer - grid.shear_px[0]) * np.arange(grid.cols))
    row = _from_zero((disparity * grid.pitch_mm[1] / longer - grid.shear_px[1]) * np.arange(grid.rows))
    rows = -(-(grid.height + int(row.max())) // tile_px)
    cols = -(-(grid.width + int(col.max())) // tile_px)
    return DisparityLayers(tile_px, step_px, disparity_mm, layer_at, row, col, rows, cols)


def _from_zero(shifts_px: np.ndarray) -> np.ndarray:
    """Shifts (N, K) rounded to even pixels, the least of each layer 0."""
    even = 2 * np.rint(shifts_px / 2).astype(np.int64)
    return even - even.min(axis=1, keepdims=True)


def tile_px_for(grid: CameraGrid, rays: int) -> int:
    """Side of tiles that hold `RAYS_PER_TILE` of `rays` over the film; no finer than `TILES_ACROSS`."""
    finest = max(grid.height, grid.width) / TILES_ACROSS
    side = np.sqrt(RAYS_PER_TILE * grid.height * grid.width / rays)
    return 2 * max(1, round(max(finest, side) / 2))
