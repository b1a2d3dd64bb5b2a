"""Small pictures of many views: photons binned so that they can be seen, full-light views averaged."""

import itertools

import numpy as np

from pcii.base.srgb import linear_to_srgb
from pcii.core.bayer import channel_count, colour_cells
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts

Box = tuple[slice, slice]
"""Rows and columns of a film."""
GAP_PX = 2
MOST_TILES = 12
"""So many tiles stand in a row or column at most; of more views some are left out."""
COUNTS_PER_BIN = 1.5
LIT_SHARE = 0.25
BINS = (24, 128)
"""Bins along the longer side of a photon tile, at least and at most."""
WHITE_SHARE = 0.99


def evenly_chosen(number: int, most: int) -> np.ndarray:
    """At most `most` of the indices 0 .. number - 1, evenly apart, with the first and the last."""
    return np.unique(np.round(np.linspace(0, number - 1, min(number, most))).astype(np.int64))


def count_tiles(counts: PhotonCounts, box: Box) -> np.ndarray:
    """Photon counts of the views in bins, (K, L, h, w, 3): mean counts per pixel of each colour.

    Of each view the part `box`. A bin is large enough to hold a photon or two where there is light: on a
    quarter of the pixels, one guesses. Grids of more than `MOST_TILES` cameras to a side show some
    of their views.
    """
    grid, events = counts.grid, counts.events
    chosen = [evenly_chosen(number, MOST_TILES) for number in (grid.rows, grid.cols)]
    tile = [np.full(number, -1) for number in (grid.rows, grid.cols)]
    for ranks, own in zip(tile, chosen, strict=True):
        ranks[own] = np.arange(own.size)
    k, l = tile[0][events.k], tile[1][events.l]
    inside = [
        (at >= part.start) & (at < part.stop) for at, part in zip((events.i, events.j), box, strict=True)
    ]
    kept = (k >= 0) & (l >= 0) & inside[0] & inside[1]
    n = events.n[kept]
    binned = _Binned(counts.cfa, box, *_bins_for(counts, box, n.sum() / chosen[0].size / chosen[1].size))
    shape = (chosen[0].size, chosen[1].size, *binned.shape)
    place = binned.place_of(events.i[kept], events.j[kept])
    index = (k[kept] * chosen[1].size + l[kept]) * int(np.prod(binned.shape)) + place
    total = np.bincount(index, n, minlength=int(np.prod(shape))).reshape(shape)
    return _as_rgb(total / binned.pixels)


def _bins_for(counts: PhotonCounts, box: Box, photons_per_view: float) -> tuple[int, int]:
    sizes = [part.stop - part.start for part in box]
    pixels_with_light = LIT_SHARE * sizes[0] * sizes[1] / max(sizes) ** 2
    side = int(np.clip(np.sqrt(photons_per_view / (COUNTS_PER_BIN * pixels_with_light)), *BINS))
    return _bin_numbers(box, side, counts.cfa)


def _bin_numbers(box: Box, longer: int, cfa: str | None) -> tuple[int, int]:
    """Rows and columns of bins, so many along the longer side; each holds a pixel of every colour."""
    sizes = [part.stop - part.start for part in box]
    smallest = 1 if cfa is None else 2
    rows, cols = (max(1, min(size // smallest, round(longer * size / max(sizes)))) for size in sizes)
    return rows, cols


def radiance_tiles(views: Views, most: int, side_px: int, box: Box) -> np.ndarray:
    """The part `box` of at most `most` x `most` full-light views, averaged to small RGB (k, l, h, w, 3)."""
    grid = views.grid
    binned = _Binned(views.cfa, box, *_bin_numbers(box, side_px, views.cfa))
    rows, cols = evenly_chosen(grid.rows, most), evenly_chosen(grid.cols, most)
    i, j = np.mgrid[box]
    place = binned.place_of(i.ravel(), j.ravel())
    tiles = []
    for k, l in itertools.product(rows, cols):
        image = views.view(int(k), int(l))[box]
        if image.shape[2] == 3:
            sums = [np.bincount(place, image[..., c].ravel(), binned.pixels.size) for c in range(3)]
            mean = np.stack(sums, axis=-1).reshape(*binned.shape[:2], 3) / binned.pixels
        else:
            mean = np.bincount(place, image.ravel(), binned.pixels.size).reshape(binned.shape) / binned.pixels
        tiles.append(_as_rgb(mean))
    return np.array(tiles).reshape(rows.size, cols.size, *binned.shape[:2], 3)


class _Binned:
    """Bins of the part `box` of a film, of each colour: which bin a pixel is in, pixels in each."""

    def __init__(self, cfa: str | None, box: Box, rows: int, cols: int) -> None:
        self.shape = (rows, cols, channel_count(cfa))
        self._cells, self._box = colour_cells(cfa), box
        i, j = np.mgrid[box]
        number = np.bincount(self.place_of(i.ravel(), j.ravel()), minlength=int(np.prod(self.shape)))
        self.pixels = np.maximum(number, 1).reshape(self.shape)

    def place_of(self, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Index into the flat bins of pixels (N,) inside the box."""
        rows, cols, channels = self.shape
        row = (i - self._box[0].start) * rows // (self._box[0].stop - self._box[0].start)
        col = (j - self._box[1].start) * cols // (self._box[1].stop - self._box[1].start)
        return (row * cols + col) * channels + self._cells[i % 2, j % 2]


def _as_rgb(mean: np.ndarray) -> np.ndarray:
    return np.repeat(mean, 3, axis=-1) if mean.shape[-1] == 1 else mean


def joined(tiles: np.ndarray) -> np.ndarray:
    """Tiles (K, L, h, w, 3) as one picture with gaps of white, linear values scaled to 0 .. 1 sRGB."""
    positive = tiles[tiles > 0]
    white = float(np.quantile(positive, WHITE_SHARE)) if positive.size else 1.0
    shown = linear_to_srgb(tiles / white)
    framed = np.pad(shown, ((0, 0), (0, 0), (0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=1.0)
    K, L, h, w, _ = framed.shape
    return framed.transpose(0, 2, 1, 3, 4).reshape(K * h, L * w, 3)[:-GAP_PX, :-GAP_PX]
