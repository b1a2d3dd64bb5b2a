"""Small pictures of many views at one exposure: photons in blocks so that they can be seen, full light."""

from collections.abc import Iterator, Sequence

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.view_figures import colours_and_samples
from pcii.figures.exposure import block_px, exposed
from pcii.imaging.blocks import evenly_chosen

Box = tuple[slice, slice]
"""Rows and columns of a film."""
GAP_PX = 2
MOST_TILES = 12
"""So many tiles stand in a row or column at most; of more views some are left out."""
COUNTS_PER_BLOCK = 1.5
LIT_SHARE = 0.25
BLOCKS = (24, 128)
"""Blocks along the longer side of a photon tile, at least and at most."""


def chosen_cameras(grid: CameraGrid, most: int) -> list[list[int]]:
    """Rows and columns of cameras that are shown, at most so many of each."""
    return [evenly_chosen(number, most) for number in (grid.rows, grid.cols)]


def photon_block_px(counts: PhotonCounts, box: Box) -> int:
    """Side of the blocks in which photons in a part of the views are shown.

    A block is large enough to hold a photon or two where there is light: on a quarter of the pixels, one
    guesses.
    """
    events = counts.events
    inside = np.ones(events.n.size, dtype=bool)
    for at, part in zip((events.i, events.j), box, strict=True):
        inside &= (at >= part.start) & (at < part.stop)
    sizes = [part.stop - part.start for part in box]
    pixels_with_light = LIT_SHARE * sizes[0] * sizes[1] / max(sizes) ** 2
    photons = events.n[inside].sum() / counts.grid.view_count
    return block_px(sizes, int(np.clip(np.sqrt(photons / (COUNTS_PER_BLOCK * pixels_with_light)), *BLOCKS)))


def photon_tiles(counts: PhotonCounts, box: Box, block_side_px: int) -> np.ndarray:
    """Photons in the part `box` of at most `MOST_TILES` views to a side, as one 8-bit picture (h, w, 3)."""
    rows, cols = chosen_cameras(counts.grid, MOST_TILES)
    views = (counts.view(k, l)[..., None] for k in rows for l in cols)
    return joined(_pictures(views, counts.cfa, box, block_side_px), len(cols))


def radiance_tiles(views: Views, most: int, side_px: int, box: Box) -> np.ndarray:
    """The part `box` of at most `most` full-light views to a side, none longer than `side_px`, as one."""
    rows, cols = chosen_cameras(views.grid, most)
    step_px = block_px([part.stop - part.start for part in box], side_px)
    images = (views.view(k, l) for k in rows for l in cols)
    return joined(_pictures(images, views.cfa, box, step_px), len(cols))


def _pictures(light: Iterator[np.ndarray], cfa: str | None, box: Box, step_px: int) -> list[np.ndarray]:
    """Pictures of images (H, W, C), which may be mosaics, in blocks at the same exposure."""
    even = tuple(slice(part.start - part.start % 2, part.stop) for part in box)  # where the mosaic begins
    return exposed((colours_and_samples(image[even], cfa) for image in light), step_px)


def joined(tiles: Sequence[np.ndarray], columns: int) -> np.ndarray:
    """8-bit pictures (h, w, 3), row by row, as one with gaps of white."""
    framed = np.pad(np.stack(tiles), ((0, 0), (0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=255)
    _, h, w, _ = framed.shape
    sheet = framed.reshape(-1, columns, h, w, 3).transpose(0, 2, 1, 3, 4)
    return sheet.reshape(-1, columns * w, 3)[:-GAP_PX, :-GAP_PX]
