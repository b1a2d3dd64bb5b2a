"""Compiled loops that add up whole images, with their variances."""

import numpy as np

from pcii.base.compiled_loops import shared
from pcii.sections.image_moves import Groups, Moves
from pcii.sections.row_kernels import add_rows, bad_rows, merge_line, not_finite

BAND = 16
"""Rows of a section that are summed at a time when all views are in memory: their sums stay in the cache."""


def _bands(height: int) -> int:
    return -(-height // BAND)


@shared(lambda sums, variance, images, *_: _bands(images.shape[1]))
def sum_views(
    first_band: int,
    last_band: int,
    sums: np.ndarray,
    variance: np.ndarray | None,
    images: np.ndarray,
    moves: Moves,
    groups: Groups,
) -> bool:
    """A section of images (V, H, N) that are all in memory: `add_views` and `merge_groups` band by band.

    `variance` is None if it is not wanted. Returns whether the results and all images are finite.
    """
    height, width = images.shape[1:]
    bad = bad_rows(images, moves) if first_band == 0 else 0
    for band in range(first_band, last_band):
        top = band * BAND
        bottom = min(top + BAND, height)
        shape = (moves.ends.size, bottom - top, width)
        total = np.zeros(shape)
        squares = np.zeros(shape) if variance is not None else None
        first = np.full(shape, np.nan) if variance is not None else None
        band_variance = variance[top:bottom] if variance is not None else None
        bad += add_rows(total, squares, first, images, moves, top, 0, bottom - top)
        for line in range(bottom - top):
            merge_line(sums[top:bottom], band_variance, total, squares, first, groups, top, line)
            bad += not_finite(sums[top + line])
            if variance is not None and squares is not None:
                bad += not_finite(squares[:, line]) + not_finite(variance[top + line])
    return bad == 0


@shared(lambda total, squares, first, images, moves: _bands(images.shape[1]))
def add_views(
    first_band: int,
    last_band: int,
    total: np.ndarray,
    squares: np.ndarray | None,
    first: np.ndarray | None,
    images: np.ndarray,
    moves: Moves,
) -> bool:
    """Add shifted images (V, H, N) to running sums of their groups (see `row_kernels`).

    Returns whether all pixels that fall outside the section are finite.
    """
    bad = bad_rows(images, moves) if first_band == 0 else 0
    height = total.shape[1]
    for band in range(first_band, last_band):
        bad += add_rows(total, squares, first, images, moves, 0, band * BAND, min((band + 1) * BAND, height))
    return bad == 0


@shared(lambda sums, *_: len(sums))
def merge_groups(
    first_line: int,
    last_line: int,
    sums: np.ndarray,
    variance: np.ndarray | None,
    total: np.ndarray,
    squares: np.ndarray | None,
    first: np.ndarray | None,
    groups: Groups,
) -> bool:
    """Sums and, if they are wanted, variances (H, W, C) from the running sums of the groups.

    Returns whether the results are finite.
    """
    bad = 0
    for line in range(first_line, last_line):
        merge_line(sums, variance, total, squares, first, groups, 0, line)
        bad += not_finite(sums[line])
        if variance is not None and squares is not None:
            bad += not_finite(squares[:, line]) + not_finite(variance[line])
    return bad == 0


@shared(lambda total, squares, first, image, *_: len(image))
def add_fine(
    first_row: int,
    last_row: int,
    total: np.ndarray,
    squares: np.ndarray,
    first: np.ndarray,
    image: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    cells: np.ndarray,
) -> None:
    """Add one image (H, W, N) to running sums (H M, W M, C) on finer voxels, as `add_views` does.

    Pixel (i, j) belongs to voxel (`rows[i]`, `cols[j]`): no two of an image to the same. `cells` (2, 2) are
    the colours of a mosaic's Bayer cells, empty where every pixel holds all colours.
    """
    height, width, _ = total.shape
    for i in range(first_row, last_row):
        row = rows[i]
        if row < 0 or row >= height:
            continue
        for j in range(image.shape[1]):
            col = cols[j]
            if col < 0 or col >= width:
                continue
            for channel in range(image.shape[2]):
                colour = cells[i % 2, j % 2] if cells.size else channel
                value = image[i, j, channel]
                if squares.size:
                    if np.isnan(first[row, col, colour]):
                        first[row, col, colour] = value
                    value -= first[row, col, colour]
                    squares[row, col, colour] += value * value
                total[row, col, colour] += value
