"""Small pictures of many views: photons binned so that they can be seen, full-light views averaged."""

import numpy as np

from pcii.bayer import channel_count, colour_cells, colour_index
from pcii.photon_counts import PhotonCounts
from pcii.types import CameraGrid, Views

GAP_PX = 2
MOST_TILES = 12
"""So many tiles stand in a row or column at most; of more views some are left out."""
COUNTS_PER_BIN = 1.5
BINS = (24, 128)
"""Bins along the longer side of a photon tile, at least and at most."""
WHITE_SHARE = 0.99


def evenly_chosen(number: int, most: int) -> np.ndarray:
    """At most `most` of the indices 0 .. number - 1, evenly apart, with the first and the last."""
    return np.unique(np.round(np.linspace(0, number - 1, min(number, most))).astype(np.int64))


def count_tiles(counts: PhotonCounts) -> np.ndarray:
    """Photon counts of the views in bins, (K, L, h, w, 3): mean counts per pixel of each colour.

    A bin is large enough to hold a photon or two where there is light: half of the film, one guesses.
    Grids of more than `MOST_TILES` cameras to a side are told by some of their views.
    """
    grid, events = counts.grid, counts.events
    chosen = [evenly_chosen(number, MOST_TILES) for number in (grid.rows, grid.cols)]
    height, width = tile_size(grid, int(events.n.sum()) / grid.view_count)
    row, col = bins(grid.height, height), bins(grid.width, width)
    rank = [np.full(number, -1) for number in (grid.rows, grid.cols)]
    for ranks, own in zip(rank, chosen, strict=True):
        ranks[own] = np.arange(own.size)
    k, l = rank[0][events.k], rank[1][events.l]
    kept = (k >= 0) & (l >= 0)
    i, j = events.i[kept], events.j[kept]
    channels = channel_count(counts.cfa)
    colour = colour_cells(counts.cfa)[i % 2, j % 2]
    shape = (chosen[0].size, chosen[1].size, height, width, channels)
    index = np.ravel_multi_index((k[kept], l[kept], row[i], col[j], colour), shape)
    total = np.bincount(index, events.n[kept], minlength=int(np.prod(shape))).reshape(shape)
    mean = total / np.maximum(_pixels_of_colour(grid, counts.cfa, row, col, height, width), 1)
    return np.repeat(mean, 3, axis=-1) if channels == 1 else mean


def tile_size(grid: CameraGrid, photons_per_view: float) -> tuple[int, int]:
    """Rows and columns of bins of a view, in its aspect, never more than its pixels."""
    longer = max(grid.height, grid.width)
    bright = 0.5 * grid.height * grid.width / longer**2
    side = int(np.clip(np.sqrt(photons_per_view / (COUNTS_PER_BIN * bright)), *BINS))
    return tuple(max(1, min(size, round(side * size / longer))) for size in (grid.height, grid.width))  # type: ignore[return-value]


def bins(pixels: int, number: int) -> np.ndarray:
    """The bin (of `number`) of each of so many pixels."""
    return np.arange(pixels) * number // pixels


def _pixels_of_colour(
    grid: CameraGrid, cfa: str | None, row: np.ndarray, col: np.ndarray, height: int, width: int
) -> np.ndarray:
    """Pixels of each colour in each bin, (height, width, C)."""
    shape = (height, width, channel_count(cfa))
    colour = colour_index(grid.height, grid.width, cfa).astype(np.int64)
    index = (row[:, None] * width + col[None, :]) * shape[2] + colour
    return np.bincount(index.ravel(), minlength=int(np.prod(shape))).reshape(shape)


def radiance_tiles(views: Views, most: int, side_px: int) -> np.ndarray:
    """Full-light views, at most `most` x `most`, averaged to small RGB pictures (k, l, h, w, 3)."""
    grid = views.grid
    scale = max(1.0, max(grid.height, grid.width) / side_px)
    height, width = max(1, int(grid.height / scale)), max(1, int(grid.width / scale))
    rows, cols = evenly_chosen(grid.rows, most), evenly_chosen(grid.cols, most)
    row, col = bins(grid.height, height), bins(grid.width, width)
    pixels = np.maximum(_pixels_of_colour(grid, views.cfa, row, col, height, width), 1)
    colour = colour_index(grid.height, grid.width, views.cfa).astype(np.int64)
    tiles = np.zeros((rows.size, cols.size, height, width, 3))
    for (a, b), tile in ((ab, tiles[ab]) for ab in np.ndindex(rows.size, cols.size)):
        image = views.view(int(rows[a]), int(cols[b]))
        place = row[:, None] * width + col[None, :]
        if image.shape[2] == 3:
            sums = [np.bincount(place.ravel(), image[..., c].ravel(), height * width) for c in range(3)]
            number = np.bincount(place.ravel(), minlength=height * width)[:, None]
            tile[:] = (np.stack(sums, axis=-1) / number).reshape(height, width, 3)
        else:
            channels = pixels.shape[2]
            index = (place * channels + colour).ravel()
            total = np.bincount(index, image.ravel(), height * width * channels)
            tile[:] = total.reshape(pixels.shape) / pixels
    return tiles


def joined(tiles: np.ndarray) -> np.ndarray:
    """Tiles (K, L, h, w, 3) as one picture with gaps of white, linear values scaled to 0 .. 1 sRGB."""
    lit = tiles[tiles > 0]
    white = float(np.quantile(lit, WHITE_SHARE)) if lit.size else 1.0
    shown = np.clip(tiles / white, 0, 1) ** (1 / 2.2)
    framed = np.pad(shown, ((0, 0), (0, 0), (0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=1.0)
    K, L, h, w, _ = framed.shape
    return framed.transpose(0, 2, 1, 3, 4).reshape(K * h, L * w, 3)[:-GAP_PX, :-GAP_PX]
