"""How bright it can get where: the majorant from which photon candidates are drawn.

A point of the scene moves from view to view by its disparity. So the majorant is kept in layers of
disparity, each on square tiles that move along with it and are shared by all views: what is seen in one
view is known for all. A path belongs to the tile of its pixel in the layer of its first hit, if that tile
is listed, else to the coarse tile of its pixel, which stands still and is dim: the places that no pilot
found bright. Each path has one owner, so candidates drawn for each owner and accepted only if theirs give
exactly the light there is, however wrong the guess; what the guess decides is the cost.

A first hit comes with a guess of its radiance that needs no light path: unshadowed light of the lamps.
A tile has two numbers per colour: `bound`, which its radiance does not exceed, and `radiance_ratio_bound`,
how many times its own guess a path's radiance is at most. A candidate whose guess is low can so be rejected
before any light is looked for. Nothing is ever taken to be darker than a coarse tile, in no colour: no place
may be left out for having looked black.

Shifts and tiles are even, so that a tile holds whole Bayer cells. Plain NumPy; see `candidates` for use.
"""

from dataclasses import dataclass, replace

import numpy as np

from pcii.core.camera_grid import CameraGrid

TILES_ACROSS = 256
"""The longer side of a film has about so many tiles, whatever its pixels."""
COARSE_TILES = 8
"""Coarse tiles are 8 x 8 tiles."""
LAYER_BLUR_TILES = 0.5
"""Layers are so thin that their tiles are off by no more than this share of a tile in any view."""
MOST_LAYERS = 64
DIM_SHARE = 0.08
"""Coarse tiles take what is dimmer than this share of the mean radiance."""
DIM_MARGIN = 1.5
"""Their bound is so many times that."""
SMALL_SAMPLE = 16
"""A bound comes from at least so many followed paths."""
FAINT = 4.0
"""A coarse tile's bound is raised for what exceeds it by less; for more a tile is listed."""
LIFT = 1.25
"""Where a path exceeds its bound, the bound is raised above it by this factor."""

NEXT_LAYERS = (0, -1, 1)
"""Layers in which a path's tile is looked for: its own, then those beside it."""
ENDLESS = 1e30
"""Bound of the radiance ratio by which no guess rejects a candidate."""
_RING = np.array([(a, b) for a in range(-1, 3) for b in range(-1, 3)])


@dataclass(frozen=True)
class Samples:
    """Paths (N,): where they went through which film, and what they brought.

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
        return Samples(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def join(self, other: "Samples") -> "Samples":
        """These and others."""
        names = self.__dataclass_fields__
        return Samples(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in names))


@dataclass(frozen=True)
class Frame:
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
        """Layer of first hits at planar depth `z_mm`; what is too near for all is put in the nearest."""
        nearness = np.divide(self.disparity_mm / self.step_px, z_mm)
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

    def split(self, tiles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Layer, row and column of flat indices."""
        rest, col = np.divmod(tiles, self.cols)
        layer, row = np.divmod(rest, self.rows)
        return layer, row, col

    def around(self, tiles: np.ndarray, reach: int = 1) -> np.ndarray:
        """Flat indices (N, (2 reach + 1)^2) of the tiles up to `reach` away; the border's own beyond it."""
        layer, row, col = self.split(tiles)
        offsets = np.argwhere(np.ones((2 * reach + 1, 2 * reach + 1))) - reach
        return self._beside(layer, row, col, offsets)

    def ring(self, doubled: np.ndarray) -> np.ndarray:
        """Flat indices (N, 16) of the 2 x 2 tiles that each tile of twice the size holds, and around."""
        layer, row, col = self.merged(2).split(doubled)
        return self._beside(layer, 2 * row, 2 * col, _RING)

    def _beside(self, layer: np.ndarray, row: np.ndarray, col: np.ndarray, offsets: np.ndarray) -> np.ndarray:
        """Flat indices (N, M) of the tiles at M offsets from each; of those on the border beyond it."""
        near_row = np.clip(row[:, None] + offsets[:, 0], 0, self.rows - 1)
        near_col = np.clip(col[:, None] + offsets[:, 1], 0, self.cols - 1)
        return self.flat(layer[:, None], near_row, near_col)

    def merged(self, side: int) -> "Frame":
        """The same layers with tiles of `side` x `side` of these."""
        rows, cols = -(-self.rows // side), -(-self.cols // side)
        return replace(self, tile_px=side * self.tile_px, rows=rows, cols=cols)

    def merge(self, tiles: np.ndarray, side: int) -> np.ndarray:
        """Flat indices, in `merged(side)`, of the tiles that these lie in."""
        layer, row, col = self.split(tiles)
        return self.merged(side).flat(layer, row // side, col // side)


def frame_for(grid: CameraGrid, tile_px: int, z_mm: np.ndarray) -> Frame:
    """Layers for the depths of a pilot's first hits; depths in between go to the nearest of these."""
    longer = max(grid.pitch_mm)
    disparity_mm = grid.focal_mm * longer / grid.pixel_mm
    cameras = max(grid.rows, grid.cols)
    disparity_px = disparity_mm / z_mm
    thin = 4 * LAYER_BLUR_TILES * tile_px / max(cameras - 1, 1)
    step_px = max(thin, float(disparity_px.max()) / MOST_LAYERS)
    seen = np.unique(np.rint(disparity_px / step_px))
    steps = np.arange(int(seen[-1]) + 1)
    layer_at = np.abs(steps[:, None] - seen).argmin(axis=1)
    # Further right a camera sees the point further left, but for shear, so its film moves right by as much.
    disparity = seen[:, None] * step_px
    col = _from_zero((disparity * grid.pitch_mm[0] / longer - grid.shear_px[0]) * np.arange(grid.cols))
    row = _from_zero((disparity * grid.pitch_mm[1] / longer - grid.shear_px[1]) * np.arange(grid.rows))
    rows = -(-(grid.height + int(row.max())) // tile_px)
    cols = -(-(grid.width + int(col.max())) // tile_px)
    return Frame(tile_px, step_px, disparity_mm, layer_at, row, col, rows, cols)


def _from_zero(shifts_px: np.ndarray) -> np.ndarray:
    """Shifts (N, K) rounded to even pixels, the least of each layer 0."""
    even = 2 * np.rint(shifts_px / 2).astype(np.int64)
    return even - even.min(axis=1, keepdims=True)


def tile_px_for(grid: CameraGrid) -> int:
    """Side of the fine tiles."""
    return 2 * max(1, round(max(grid.height, grid.width) / (2 * TILES_ACROSS)))


class Majorant:
    """Upper bounds of radiance: coarse tiles of the film first, then the listed tiles of the layers.

    Of entry e: `layer` (-1 for coarse tiles), tile `row` and `col`, and (E, C) `bound` and
    `radiance_ratio_bound`. `entry_of` tells a tile's entry, -1 if it has none.
    """

    def __init__(self, grid: CameraGrid, frame: Frame, dim: np.ndarray) -> None:
        self.frame, self.dim = frame, dim
        self.coarse_px = COARSE_TILES * tile_px_for(grid)
        self.coarse_cols = -(-grid.width // self.coarse_px)
        self.coarse_count = -(-grid.height // self.coarse_px) * self.coarse_cols
        self.row, self.col = np.divmod(np.arange(self.coarse_count), self.coarse_cols)
        self.layer = np.full(self.coarse_count, -1)
        self.bound = np.tile(DIM_MARGIN * dim, (self.coarse_count, 1))
        self.radiance_ratio_bound = np.full(self.bound.shape, ENDLESS)
        self.entry_of = np.full(frame.tiles, -1, dtype=np.int32)

    @property
    def side_px(self) -> np.ndarray:
        """Side of each entry's tile, (E,)."""
        return np.where(self.layer < 0, self.coarse_px, self.frame.tile_px)

    def owner_of(self, samples: Samples) -> np.ndarray:
        """The entry that each path belongs to, (N,)."""
        owner = samples.row // self.coarse_px * self.coarse_cols + samples.col // self.coarse_px
        for aside in reversed(NEXT_LAYERS):
            entry = self.entry_of[self.frame.tiles_of(samples, aside)]
            owner = np.where(entry < 0, owner, entry)
        return owner

    def list_tiles(self, tiles: np.ndarray, bound: np.ndarray, radiance_ratio_bound: np.ndarray) -> None:
        """Add tiles (N,), each once and not listed before, with both bounds (N, C).

        `bound` is raised to `dim`.
        """
        layer, row, col = self.frame.split(tiles)
        self.entry_of[tiles] = np.arange(self.layer.size, self.layer.size + tiles.size)
        self.layer, self.row = np.append(self.layer, layer), np.append(self.row, row)
        self.col = np.append(self.col, col)
        self.bound = np.concatenate([self.bound, np.maximum(bound, self.dim)])
        self.radiance_ratio_bound = np.concatenate([self.radiance_ratio_bound, radiance_ratio_bound])

    def scale(self, factor: float) -> None:
        """Multiply the limits of all listed tiles."""
        listed = slice(self.coarse_count, None)
        self.bound[listed] = np.maximum(self.bound[listed] * factor, self.dim)
        self.radiance_ratio_bound[listed] *= factor

    def lift(self, over: Samples, reach: int = 1) -> None:
        """Raise limits above what these paths brought, on their tiles and on those up to `reach` away."""
        owner = self.owner_of(over)
        faint = (owner < self.coarse_count) & (over.light < FAINT * self.bound[owner]).all(axis=1)
        if faint.any():
            lifted, height = _largest(owner[faint], LIFT * over.light[faint])
            self.bound[lifted] = np.maximum(self.bound[lifted], height)
            over = over.take(~faint)
        if not over.k.size:
            return
        around = self.frame.around(self.frame.tiles_of(over), reach)
        near = around.ravel()
        unlisted = _distinct(near[self.entry_of[near] < 0])
        nothing = np.zeros((unlisted.size, over.light.shape[1]))
        self.list_tiles(unlisted, nothing, nothing)
        entry = self.entry_of[near]
        for levels, needed in (
            (self.bound, over.light),
            (self.radiance_ratio_bound, over.light / over.guess),
        ):
            lifted, height = _largest(entry, LIFT * needed.repeat(around.shape[1], axis=0))
            levels[lifted] = np.maximum(levels[lifted], height)


def fit(grid: CameraGrid, frame: Frame, samples: Samples, dim: np.ndarray) -> Majorant:
    """The majorant that a pilot suggests; `dim` (C,) is the bound of the coarse tiles.

    A tile is listed, and its largest guess looked up, with what lies within half a tile around it.
    """
    lit = np.any(np.fmax(samples.light, samples.guess) > dim, axis=1)
    samples = samples.take(np.asarray(lit))
    half = replace(frame, tile_px=frame.tile_px // 2, rows=2 * frame.rows, cols=2 * frame.cols)
    halves = half.tiles_of(samples)
    tiles, followed = half.merge(halves, 2), samples.followed
    light = samples.light[followed]
    near = _Near(frame, tiles[followed], np.concatenate([light, light / samples.guess[followed]], axis=1))
    seen, guess = _largest(halves, samples.guess)
    radiance_ratio_bound = near.largest(half.merge(seen, 2))[:, dim.size :]
    bright = (guess * radiance_ratio_bound > dim).any(axis=1)
    listed = _distinct(half.merge(half.around(seen[bright]).ravel(), 2))
    table = np.zeros((half.tiles, dim.size), dtype=np.float32)
    table[seen] = guess
    found = near.largest(listed)
    light, radiance_ratio_bound = found[:, : dim.size], found[:, dim.size :]
    majorant = Majorant(grid, frame, dim)
    guess = _highest(table, half.ring(listed))
    majorant.list_tiles(listed, np.minimum(light, guess * radiance_ratio_bound), radiance_ratio_bound)
    return majorant


class _Near:
    """Largest of `values` (N, C), found on `tiles` (N,), in the smallest neighbourhood that shows enough."""

    def __init__(self, frame: Frame, tiles: np.ndarray, values: np.ndarray) -> None:
        self.frame, self.anywhere = frame, values.max(axis=0)
        self.levels: list[tuple[int, Frame, np.ndarray, np.ndarray]] = []
        for side in (1, 2, 4, COARSE_TILES):
            merged = frame.merged(side)
            blocks = frame.merge(tiles, side)
            largest = np.zeros((merged.tiles, values.shape[1]), dtype=np.float32)
            found, highest = _largest(blocks, values)
            largest[found] = highest
            number = np.bincount(blocks, minlength=merged.tiles)
            self.levels.append((side, merged, largest, number))

    def largest(self, tiles: np.ndarray) -> np.ndarray:
        """The largest near each tile (M,), in its layer only or else anywhere: (M, C)."""
        result = np.tile(self.anywhere, (tiles.size, 1))
        missing = np.arange(tiles.size)
        for side, merged, largest, number in self.levels:
            if not missing.size:
                break
            blocks, inverse = np.unique(self.frame.merge(tiles[missing], side), return_inverse=True)
            around = merged.around(blocks)
            enough = (number[around].sum(axis=1) >= SMALL_SAMPLE)[inverse]
            highest = _highest(largest, around)
            result[missing[enough]] = highest[inverse[enough]]
            missing = missing[~enough]
        return result


def _highest(table: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Largest of a table's rows (T, C) among each list of indices (N, M): (N, C)."""
    highest = table[near[:, 0]]
    for index in near.T[1:]:
        np.maximum(highest, table[index], out=highest)
    return highest


def _distinct(keys: np.ndarray) -> np.ndarray:
    """Each once, sorted: faster than `np.unique` on some hundred thousand."""
    keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) > 0]


def _largest(keys: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct keys, sorted, and the largest of `values` (N, C) that each has."""
    order = np.argsort(keys)
    keys, values = keys[order], values[order]
    first = np.flatnonzero(np.diff(keys, prepend=-1))
    if not first.size:
        return keys, values
    return keys[first], np.maximum.reduceat(values, first, axis=0)
