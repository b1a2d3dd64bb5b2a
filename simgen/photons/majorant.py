"""How bright it can get where: the majorant from which photon candidates are drawn.

A point of the scene moves from view to view by its disparity. A layer of disparity holds what has nearly the
same, on square tiles that move along with it: what is found in one view is known for all. Shifts and tiles
are even, so that a tile holds whole Bayer cells.

The majorant is kept on these tiles. A path belongs to the tile of its pixel in the layer of its first hit, if
that tile is listed, else to the coarse tile of its pixel, which stands still and is dim: the places that no
pilot found bright. Each path belongs to one tile, so candidates drawn for each tile and accepted only if
theirs give exactly the light there is, however wrong the guess; what the guess decides is the cost.

A first hit comes with a guess of its radiance that needs no light path: unshadowed light of the lamps.
A tile has two numbers per colour: `bound`, which its radiance does not exceed, and `radiance_ratio_bound`,
how many times its own guess a path's radiance is at most. A candidate whose guess is low can so be rejected
before any light is looked for. Nothing is ever taken to be darker than a coarse tile, in no colour: no place
may be left out for having looked black.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pcii.types import CameraGrid
from simgen.base import take_rows

TILES_ACROSS = 256
"""Largest number of tiles along the longer side of a film, about, whatever its pixels."""
RAYS_PER_TILE = 4
"""Rays of a pilot: with one in each quarter of a tile hardly a piece of surface is missed."""
LAYER_BLUR_TILES = 0.5
"""Layers are so thin that their tiles are off by no more than this share of a tile in any view."""
MAX_LAYERS = 64
COARSE_TILES = 8
"""Coarse tiles are 8 x 8 tiles."""
DIM_SHARE = 0.08
"""Coarse tiles take what is dimmer than this share of the mean radiance."""
DIM_MARGIN = 1.5
"""The bound of a coarse tile is this many times that."""
SMALL_SAMPLE = 16
"""Least number of followed paths that a bound comes from."""
FAINT = 4.0
"""A coarse tile's bound is raised for what exceeds it by less; for more a tile is listed."""
GAP_TILES = 3
"""Gaps of this many tiles to every side are closed in a layer."""
RAISE_FACTOR = 1.25
"""Where a path exceeds its bound, the bound is raised to this many times its radiance."""
EXCESS_SHARE = 1e-5
"""Share of the light that the warm-up leaves above the majorant."""
NEXT_LAYERS = (0, -1, 1)
"""Layers in which a path's tile is looked for: that of its first hit, then those beside it."""
ENDLESS = 1e30
"""Bound of the radiance ratio by which no guess rejects a candidate."""


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
        layer, row, col = np.unravel_index(tiles, (len(self.row_shift), self.rows, self.cols))
        return layer, row, col

    def around(self, tiles: np.ndarray, reach: int = 1) -> np.ndarray:
        """Flat indices (N, (2 reach + 1)^2) of the tiles up to `reach` away; the border's own beyond it."""
        layer, row, col = self.layer_row_col(tiles)
        return self.flat(layer[:, None], *_squares_around(row, col, reach, self.rows, self.cols))

    def merged(self, side: int) -> "DisparityLayers":
        """The same layers with tiles of `side` x `side` of these."""
        rows, cols = -(-self.rows // side), -(-self.cols // side)
        return replace(self, tile_px=side * self.tile_px, rows=rows, cols=cols)

    def merge(self, tiles: np.ndarray, side: int) -> np.ndarray:
        """Flat indices, in `merged(side)`, of the tiles that these lie in."""
        layer, row, col = self.layer_row_col(tiles)
        return self.merged(side).flat(layer, row // side, col // side)


def _squares_around(
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

    def even_shifts_px(axis: int, count: int) -> np.ndarray:
        shifts_px = (disparity * grid.pitch_mm[axis] / longer - grid.shear_px[axis]) * np.arange(count)
        even = 2 * np.rint(shifts_px / 2).astype(np.int64)
        return even - even.min(axis=1, keepdims=True)

    col, row = even_shifts_px(0, grid.cols), even_shifts_px(1, grid.rows)
    rows = -(-(grid.height + int(row.max())) // tile_px)
    cols = -(-(grid.width + int(col.max())) // tile_px)
    return DisparityLayers(tile_px, step_px, disparity_mm, layer_at, row, col, rows, cols)


def tile_px_for(grid: CameraGrid, rays: int) -> int:
    """Side of tiles that hold `RAYS_PER_TILE` of `rays` over the film; no finer than `TILES_ACROSS`."""
    finest = max(grid.height, grid.width) / TILES_ACROSS
    side = np.sqrt(RAYS_PER_TILE * grid.height * grid.width / rays)
    return 2 * max(1, round(max(finest, side) / 2))


class Majorant:
    """Upper bounds of radiance: coarse tiles of the film first, then the listed tiles of the layers.

    Of entry e: `layer` (-1 for coarse tiles), tile `row` and `col`, and (E, C) `bound` and
    `radiance_ratio_bound`. `entry_of` is each tile's entry, -1 if it has none.
    """

    def __init__(self, grid: CameraGrid, layers: DisparityLayers, dim: np.ndarray) -> None:
        self.layers, self.dim = layers, dim
        self.coarse_px = COARSE_TILES * layers.tile_px
        self.coarse_rows = -(-grid.height // self.coarse_px)
        self.coarse_cols = -(-grid.width // self.coarse_px)
        self.coarse_count = self.coarse_rows * self.coarse_cols
        self.row, self.col = np.divmod(np.arange(self.coarse_count), self.coarse_cols)
        self.layer = np.full(self.coarse_count, -1)
        self.bound = np.tile(DIM_MARGIN * dim, (self.coarse_count, 1))
        self.radiance_ratio_bound = np.full(self.bound.shape, ENDLESS)
        self.entry_of = np.full(layers.tiles, -1, dtype=np.int32)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Both bounds of every entry."""
        return self.bound, self.radiance_ratio_bound

    @property
    def side_px(self) -> np.ndarray:
        """Side of each entry's tile, (E,)."""
        return np.where(self.layer < 0, self.coarse_px, self.layers.tile_px)

    def owner_of(self, samples: Samples) -> np.ndarray:
        """The entry that each path belongs to, (N,)."""
        owner = samples.row // self.coarse_px * self.coarse_cols + samples.col // self.coarse_px
        for aside in reversed(NEXT_LAYERS):
            entry = self.entry_of[self.layers.tiles_of(samples, aside)]
            owner = np.where(entry < 0, owner, entry)
        return owner

    def list_tiles(self, tiles: np.ndarray, bound: np.ndarray, radiance_ratio_bound: np.ndarray) -> None:
        """Add tiles (N,), each once and not listed before, with both bounds (N, C).

        `bound` is raised to `dim`.
        """
        self.entry_of[tiles] = np.arange(self.layer.size, self.layer.size + tiles.size)
        known, new = (self.layer, self.row, self.col), self.layers.layer_row_col(tiles)
        self.layer, self.row, self.col = map(np.append, known, new)
        self.bound = np.concatenate([self.bound, np.maximum(bound, self.dim)])
        self.radiance_ratio_bound = np.concatenate([self.radiance_ratio_bound, radiance_ratio_bound])

    def scale(self, factor: float) -> None:
        """Multiply the limits of all listed tiles."""
        listed = slice(self.coarse_count, None)
        self.bound[listed] = np.maximum(self.bound[listed] * factor, self.dim)
        self.radiance_ratio_bound[listed] *= factor

    def fit_scale(self, ratio: np.ndarray) -> float:
        """Scale the limits so that at most `EXCESS_SHARE` of the light lies above them; and by how much.

        `ratio` (N,) is radiance over limit of paths.
        """
        allowed, factor = EXCESS_SHARE * ratio.sum(), 1.0
        ratio = np.sort(ratio)[::-1]
        # Above the n-th largest lies the sum of the n - 1 that are larger less as many times itself.
        above = np.cumsum(ratio) - np.arange(1, ratio.size + 1) * ratio
        if allowed > 0:
            factor = float(np.clip(ratio[min(np.searchsorted(above, allowed), ratio.size - 1)], 0.5, 2.0))
        self.scale(factor)
        return factor

    def list_and_raise(self, exceeding: Samples, reach: int = 1) -> None:
        """Raise limits above the radiance of these paths, on their tiles and on those up to `reach` away.

        Tiles that are not listed yet are added, unless the path is `FAINT`.
        """
        owner = self.owner_of(exceeding)
        faint = (owner < self.coarse_count) & (exceeding.light < FAINT * self.bound[owner]).all(axis=1)
        if faint.any():
            _raise_rows(self.bound, owner[faint], RAISE_FACTOR * exceeding.light[faint])
            exceeding = take_rows(exceeding, ~faint)
        if not exceeding.k.size:
            return
        around = self.layers.around(self.layers.tiles_of(exceeding), reach)
        near = around.ravel()
        unlisted = np.unique(near[self.entry_of[near] < 0])
        nothing = np.zeros((unlisted.size, exceeding.light.shape[1]))
        self.list_tiles(unlisted, nothing, nothing)
        self._raise_entries(self.entry_of[around], exceeding)

    def raise_bounds(self, exceeding: Samples, reach: int) -> None:
        """Raise limits above the radiance of these paths, on their own tiles and those up to `reach` away.

        No tile is listed, so that each path belongs to the same one as before and no limit of it falls.
        """
        owner, layers = self.owner_of(exceeding), self.layers
        coarse = owner < self.coarse_count
        if coarse.any():
            row, col = self.row[owner[coarse]], self.col[owner[coarse]]
            rows, cols = _squares_around(row, col, reach - 1, self.coarse_rows, self.coarse_cols)
            self._raise_entries(rows * self.coarse_cols + cols, take_rows(exceeding, coarse))
        if not coarse.all():
            entry = owner[~coarse]
            tiles = layers.flat(self.layer[entry], self.row[entry], self.col[entry])
            near = self.entry_of[layers.around(tiles, reach)]
            self._raise_entries(np.where(near < 0, entry[:, None], near), take_rows(exceeding, ~coarse))

    def _raise_entries(self, entries: np.ndarray, exceeding: Samples) -> None:
        """Raise the limits of entries (N, M) above the radiance of paths (N,)."""
        light, ratio = exceeding.light, exceeding.light / exceeding.guess
        for levels, needed in zip(self.bounds, (light, ratio), strict=True):
            _raise_rows(levels, entries.ravel(), RAISE_FACTOR * needed.repeat(entries.shape[1], axis=0))


def fit(grid: CameraGrid, layers: DisparityLayers, samples: Samples, dim: np.ndarray) -> Majorant:
    """The majorant that a pilot suggests; `dim` (C,) is the bound of the coarse tiles.

    A tile is listed with the eight around it, and has the largest guess of these nine: what one ray showed
    of it is off by what other cameras see beside. Gaps of up to `GAP_TILES` between listed tiles of a layer
    are listed too, with the largest guess around them: a surface goes on between the places where rays
    happened to hit it.
    """
    samples = take_rows(samples, np.any(np.fmax(samples.light, samples.guess) > dim, axis=1))
    tiles, followed = layers.tiles_of(samples), samples.followed
    light = samples.light[followed]
    near = _Near(layers, tiles[followed], np.concatenate([light, light / samples.guess[followed]], axis=1))
    table = np.zeros((layers.tiles, dim.size), dtype=np.float32)
    _raise_rows(table, tiles, samples.guess)
    hit = np.flatnonzero(table.any(axis=1))
    is_bright = (table[hit] * near.largest(hit)[:, dim.size :] > dim).any(axis=1)
    listed = _without_gaps(layers, layers.around(hit[is_bright]).ravel())
    guess = _highest(table, layers.around(listed))
    empty = guess.max(axis=1, initial=0) <= 0
    table[:], table[listed] = 0, guess
    guess[empty] = _highest(table, layers.around(listed[empty], GAP_TILES))
    light, radiance_ratio_bound = np.split(near.largest(listed), 2, axis=1)
    majorant = Majorant(grid, layers, dim)
    majorant.list_tiles(listed, np.minimum(light, guess * radiance_ratio_bound), radiance_ratio_bound)
    return majorant


def _without_gaps(layers: DisparityLayers, tiles: np.ndarray) -> np.ndarray:
    """These tiles (N,), each once, and those in gaps between them: a closing of each layer by a square."""
    from scipy.ndimage import grey_closing

    mask = np.zeros((len(layers.row_shift), layers.rows, layers.cols), dtype=np.uint8)
    mask.flat[tiles] = 1
    border, side = 2 * GAP_TILES, 2 * GAP_TILES + 1
    padded = np.pad(mask, ((0, 0), (border, border), (border, border)))
    closed = grey_closing(padded, size=(1, side, side), mode="constant")
    return np.flatnonzero(closed[:, border:-border, border:-border])


class _Near:
    """Largest of `values` (N, C), found on `tiles` (N,), in the smallest neighbourhood that shows enough."""

    def __init__(self, layers: DisparityLayers, tiles: np.ndarray, values: np.ndarray) -> None:
        self.layers, self.anywhere = layers, values.max(axis=0)
        self.levels: list[tuple[int, DisparityLayers, np.ndarray, np.ndarray]] = []
        for side in (1, 2, 4, COARSE_TILES):
            merged, blocks = layers.merged(side), layers.merge(tiles, side)
            largest = np.zeros((merged.tiles, values.shape[1]), dtype=np.float32)
            _raise_rows(largest, blocks, values)
            self.levels.append((side, merged, largest, np.bincount(blocks, minlength=merged.tiles)))

    def largest(self, tiles: np.ndarray) -> np.ndarray:
        """The largest near each tile (M,), in its layer only or else anywhere: (M, C)."""
        result = np.tile(self.anywhere, (tiles.size, 1))
        missing = np.arange(tiles.size)
        for side, merged, largest, number in self.levels:
            blocks, inverse = np.unique(self.layers.merge(tiles[missing], side), return_inverse=True)
            around = merged.around(blocks)
            enough = (number[around].sum(axis=1) >= SMALL_SAMPLE)[inverse]
            result[missing[enough]] = _highest(largest, around)[inverse[enough]]
            missing = missing[~enough]
        return result


def _highest(table: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Largest of a table's rows (T, C) among each list of indices (N, M): (N, C)."""
    highest = table[near[:, 0]]
    for index in near.T[1:]:
        np.maximum(highest, table[index], out=highest)
    return highest


def _raise_rows(table: np.ndarray, rows: np.ndarray, values: np.ndarray) -> None:
    """Raise rows (N,), of which some may be the same, of a table (T, C) to at least `values` (N, C)."""
    for column, heights in zip(table.T, values.astype(table.dtype).T, strict=True):
        np.maximum.at(column, rows, heights)
