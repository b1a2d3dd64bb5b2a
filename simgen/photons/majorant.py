"""How bright it can get where: the majorant from which photon candidates are drawn.

The majorant is kept on the tiles of layers of disparity (see `disparity_layers`). A path belongs to the tile
of its pixel in the layer of its first hit, if that tile is listed, else to the coarse tile of its pixel,
which stands still and is dim: the places that no pilot found bright. Each path belongs to one tile, so
candidates drawn for each tile and accepted only if theirs give exactly the light there is, however wrong the
guess; what the guess decides is the cost.

A first hit comes with a guess of its radiance that needs no light path: unshadowed light of the lamps.
A tile has two numbers per colour: `bound`, which its radiance does not exceed, and `radiance_ratio_bound`,
how many times its own guess a path's radiance is at most. A candidate whose guess is low can so be rejected
before any light is looked for. Nothing is ever taken to be darker than a coarse tile, in no colour: no place
may be left out for having looked black.

Plain NumPy; see `candidates` for use.
"""

from copy import deepcopy

import numpy as np

from pcii.types import CameraGrid
from simgen.photons.disparity_layers import DisparityLayers, Samples, squares_around
from simgen.truth import over_squares

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

    def copy(self) -> "Majorant":
        """Another of the same bounds, which are raised apart from these."""
        return deepcopy(self)

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
            exceeding = exceeding.take(~faint)
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
            rows, cols = squares_around(row, col, reach - 1, self.coarse_rows, self.coarse_cols)
            self._raise_entries(rows * self.coarse_cols + cols, exceeding.take(coarse))
        if not coarse.all():
            entry = owner[~coarse]
            tiles = layers.flat(self.layer[entry], self.row[entry], self.col[entry])
            near = self.entry_of[layers.around(tiles, reach)]
            self._raise_entries(np.where(near < 0, entry[:, None], near), exceeding.take(~coarse))

    def _raise_entries(self, entries: np.ndarray, exceeding: Samples) -> None:
        """Raise the limits of entries (N, M) above the radiance of paths (N,)."""
        light, ratio = exceeding.light, exceeding.light / exceeding.guess
        for levels, needed in ((self.bound, light), (self.radiance_ratio_bound, ratio)):
            _raise_rows(levels, entries.ravel(), RAISE_FACTOR * needed.repeat(entries.shape[1], axis=0))

    def is_above(self, below: "Majorant") -> np.ndarray:
        """Which entries have been raised since `below` was copied, (E,) bool."""
        raised = (self.bound > below.bound) | (self.radiance_ratio_bound > below.radiance_ratio_bound)
        return np.asarray(raised.any(axis=1))


def fit(grid: CameraGrid, layers: DisparityLayers, samples: Samples, dim: np.ndarray) -> Majorant:
    """The majorant that a pilot suggests; `dim` (C,) is the bound of the coarse tiles.

    A tile is listed with the eight around it, and has the largest guess of these nine: what one ray showed
    of it is off by what other cameras see beside. Gaps of up to `GAP_TILES` between listed tiles of a layer
    are listed too, with the largest guess around them: a surface goes on between the places where rays
    happened to hit it.
    """
    samples = samples.take(np.any(np.fmax(samples.light, samples.guess) > dim, axis=1))
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
    side = 2 * GAP_TILES + 1
    shape = len(layers.row_shift), layers.rows, layers.cols
    mask = np.zeros(shape, dtype=bool)
    mask.flat[tiles] = True
    closed = [
        over_squares(np.minimum, over_squares(np.maximum, np.pad(of_layer, side - 1), side), side)
        for of_layer in mask
    ]
    return np.flatnonzero(closed)


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
