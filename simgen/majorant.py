"""How bright it can get where: the majorant from which photon candidates are drawn.

The majorant M is constant on square tiles of film and per colour, and shared by all views. A point of
the scene moves from view to view by its disparity, so the tiles move along with the disparity at which
most of the light is; what little disparity is left blurs the majorant's edges and costs candidates,
never correctness. Shifts and tiles are even, so that a tile holds whole Bayer cells.
"""

from dataclasses import dataclass, replace

import numpy as np

from pcii.types import CameraGrid
from simgen import seeds
from simgen.build import Built
from simgen.light import LUMINANCE
from simgen.paths import Paths, Rays, trace

TILES_ACROSS = 256
"""The longer side of a film has about so many tiles, whatever its pixels."""
COARSE_TILES = 8
"""The first, uniform pilot is pooled over 8 x 8 tiles; the second is drawn from what it found."""
PILOT_PATHS = (1 << 16, 1 << 17)
FLOOR_SHARE = 0.05
"""No tile's majorant is below this share of the mean radiance, so that no place is never looked at."""
EXCESS_SHARE = 3e-4
"""Share of the light that the pilot leaves above the majorant; `photons` lifts it as it goes."""
LARGEST_FACTOR = 2.0
"""What exceeds the bound by more is rare and local, and is lifted where it shows."""
SMALL_SAMPLE = 16


@dataclass(frozen=True)
class Majorant:
    """Upper bound of radiance on tiles: `bound` (tile rows, tile columns, C), C colours of the sensor.

    Pixel (i, j) of camera (k, l) lies on the tile of row (i + row_shift[k]) // tile_px, and likewise
    for columns; the shifts are even and not negative, and `tile_px` is even.
    """

    tile_px: int
    row_shift: np.ndarray
    col_shift: np.ndarray
    bound: np.ndarray
    paths: int
    """Paths that the pilot took."""

    def tiles_of(self, rays: Rays) -> tuple[np.ndarray, np.ndarray]:
        """Tile row and column of each ray's pixel."""
        row = (np.rint(rays.row_px).astype(np.int64) + self.row_shift[rays.k]) // self.tile_px
        col = (np.rint(rays.col_px).astype(np.int64) + self.col_shift[rays.l]) // self.tile_px
        return row, col


def sensed(radiance: np.ndarray, channels: int) -> np.ndarray:
    """Radiance (N, 3) as the sensor's colours (N, C): R, G, B, or luminance for a monochrome one."""
    return radiance if channels == 3 else (radiance @ LUMINANCE)[:, None]


def explore(built: Built, grid: CameraGrid, channels: int, *, max_depth: int, seed: int) -> Majorant | None:
    """A majorant from two pilots; None if no light at all was found.

    The first pilot samples all films evenly. It shows the disparity of the light and where it is
    bright. The second is drawn from that: half of it sets the bound, the other half tells by how much
    the bound has to be raised for all but `EXCESS_SHARE` of the light to lie below.
    """
    rng = seeds.generator(seed, view=0, stage="pilot")
    first = _even_rays(grid, PILOT_PATHS[0], rng)
    paths = trace(built, grid, first, max_depth=max_depth, seed=seeds.integer(seed, view=0, stage="pilot"))
    light = sensed(paths.radiance, channels)
    mean = light.mean(axis=0)
    if not light.any():
        return None
    row_shift, col_shift = _shifts(grid, paths, light)
    tile_px = 2 * max(1, round(max(grid.height, grid.width) / (2 * TILES_ACROSS)))
    rows = _tiles(grid.height + row_shift.max(), tile_px)
    cols = _tiles(grid.width + col_shift.max(), tile_px)
    level = np.broadcast_to(mean, (rows, cols, channels))
    start = Majorant(tile_px, row_shift, col_shift, level, sum(PILOT_PATHS))
    coarse = replace(start, bound=_coarse_bound(start, first, light, FLOOR_SHARE * mean))

    second, weight = draw_even_tiles(coarse, grid, PILOT_PATHS[1], rng)
    part_seed = seeds.integer(seed, view=0, stage="pilot", part=1)
    light = sensed(trace(built, grid, second, max_depth=max_depth, seed=part_seed).radiance, channels)
    half = np.arange(len(light)) % 2 == 0
    known = replace(coarse, bound=_fine_bound(coarse, second, light, half, FLOOR_SHARE * mean))
    factor = _needed_factor(known, second, light, weight, ~half)
    both = np.ones(len(light), dtype=bool)
    final = _fine_bound(coarse, second, light, both, FLOOR_SHARE * mean)
    return replace(coarse, bound=final * factor)


def draw_even_tiles(
    majorant: Majorant, grid: CameraGrid, number: int, rng: np.random.Generator
) -> tuple[Rays, np.ndarray]:
    """Rays from all views, tiles chosen by their bound's mean over colours; and weights 1 / density."""
    density = majorant.bound.mean(axis=2)
    flat = np.searchsorted(np.cumsum(density.ravel()) / density.sum(), rng.random(number))
    flat = np.minimum(flat, density.size - 1)
    k, l = rng.integers(0, grid.rows, number), rng.integers(0, grid.cols, number)
    inside = rng.random((2, number)) * majorant.tile_px - 0.5
    row = flat // density.shape[1] * majorant.tile_px - majorant.row_shift[k] + inside[0]
    col = flat % density.shape[1] * majorant.tile_px - majorant.col_shift[l] + inside[1]
    keep = (row >= -0.5) & (row < grid.height - 0.5) & (col >= -0.5) & (col < grid.width - 0.5)
    return Rays(k[keep], l[keep], row[keep], col[keep]), 1 / density.ravel()[flat[keep]]


def _even_rays(grid: CameraGrid, number: int, rng: np.random.Generator) -> Rays:
    k, l = rng.integers(0, grid.rows, number), rng.integers(0, grid.cols, number)
    row, col = rng.random(number) * grid.height - 0.5, rng.random(number) * grid.width - 0.5
    return Rays(k, l, row, col)


def _shifts(grid: CameraGrid, paths: Paths, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Even shifts, from 0 up, that hold still what most of the light comes from.

    The disparity is the median weighted by squared radiance: tiles that are bright cost most.
    """
    near = np.isfinite(paths.z_mm)
    weight = light.sum(axis=1, dtype=np.float64) ** 2 * near
    order = np.argsort(paths.z_mm)
    half = np.searchsorted(np.cumsum(weight[order]), weight.sum() / 2)
    z_mm = float(paths.z_mm[order[min(half, order.size - 1)]])
    px_per_mm = grid.focal_mm / (z_mm * grid.pixel_mm) if np.isfinite(z_mm) else 0.0
    # Further right a camera sees the point further left, so its film moves right by as much.
    col = 2 * np.rint(np.arange(grid.cols) * grid.pitch_mm[0] * px_per_mm / 2).astype(np.int64)
    row = 2 * np.rint(np.arange(grid.rows) * grid.pitch_mm[1] * px_per_mm / 2).astype(np.int64)
    return row, col


def _tiles(pixels: int, tile_px: int) -> int:
    """Tiles that cover so many pixels, a whole number of coarse ones."""
    coarse = tile_px * COARSE_TILES
    return -(-int(pixels) // coarse) * COARSE_TILES


def _tile_maximum(
    majorant: Majorant, rays: Rays, light: np.ndarray, tiles: int
) -> tuple[np.ndarray, np.ndarray]:
    """Largest radiance found on each block of `tiles` x `tiles` tiles by colour, and how many rays."""
    rows, cols, channels = majorant.bound.shape
    row, col = majorant.tiles_of(rays)
    flat = (row // tiles) * (cols // tiles) + col // tiles
    size = (rows // tiles) * (cols // tiles)
    largest = np.zeros((size, channels))
    np.maximum.at(largest, flat, light)
    number = np.bincount(flat, minlength=size)
    shape = (rows // tiles, cols // tiles)
    return largest.reshape(*shape, channels), number.reshape(shape)


def _coarse_bound(majorant: Majorant, rays: Rays, light: np.ndarray, floor: np.ndarray) -> np.ndarray:
    from scipy.ndimage import maximum_filter

    largest, _ = _tile_maximum(majorant, rays, light, COARSE_TILES)
    spread = np.maximum(maximum_filter(largest, (3, 3, 1)), floor)
    return spread.repeat(COARSE_TILES, axis=0).repeat(COARSE_TILES, axis=1)


def _fine_bound(
    coarse: Majorant, rays: Rays, light: np.ndarray, use: np.ndarray, floor: np.ndarray
) -> np.ndarray:
    """Bound per tile from the rays in `use` on it and its neighbours; coarse where these are few."""
    from scipy.ndimage import maximum_filter, uniform_filter

    chosen = Rays(rays.k[use], rays.l[use], rays.row_px[use], rays.col_px[use])
    largest, number = _tile_maximum(coarse, chosen, light[use], 1)
    # Neighbours count in full: an outline may cross a tile in few views, and is bright there.
    around = maximum_filter(largest, (3, 3, 1))
    nearby = uniform_filter(number.astype(np.float64), 3) * 9
    bound = np.where((nearby < SMALL_SAMPLE)[..., None], coarse.bound, around)
    return np.maximum(bound, floor)


def _needed_factor(
    majorant: Majorant, rays: Rays, light: np.ndarray, weight: np.ndarray, use: np.ndarray
) -> float:
    """By how much to raise the bound for the light above it to be at most `EXCESS_SHARE`."""
    row, col = majorant.tiles_of(rays)
    bound = majorant.bound[row, col][use]
    part, weight = light[use], weight[use, None]
    total = (part * weight).sum(dtype=np.float64)
    factor = 0.5
    while factor < LARGEST_FACTOR:
        excess = (np.maximum(part - factor * bound, 0) * weight).sum(dtype=np.float64)
        if excess <= EXCESS_SHARE * total:
            break
        factor *= 1.04
    return factor
