"""Demosaicing of Bayer images: the gradient-based interpolation of Laroche and Prescott.

Muniraj et al. 2017, Eqs. 4-6, with their misprints corrected: Eq. 4's second case is the vertical
pair (G33 + G53) / 2, Eq. 5's (G24 + G44) / 2, and Eq. 6 is three kinds of site, not three cases of
one. The code distinguishes sites, not patterns, so it serves all four Bayer patterns.
"""

import numpy as np

from pcii.base import InputError, helper, shared
from pcii.types import check_cfa, colour_cells

METHOD = "laroche-prescott"


def demosaic(mosaic_HW: np.ndarray, *, cfa: str | None = "GRBG", method: str = METHOD) -> np.ndarray:
    """Colour image (H, W, 3) float64 from a Bayer mosaic (H, W).

    `method` is "laroche-prescott": green along the smaller chroma gradient (Eqs. 4, 5), then red and blue
    differences (Eq. 6). Borders continue the image by reflection about the border pixels, which keeps the
    Bayer phase. Raises `InputError` for an unknown pattern or method, an image below 2 x 2, NaN or infinity,
    and values so large that those of neighbours cannot be added up.

    >>> from pcii.types import mosaic
    >>> image = demosaic(mosaic(np.full((4, 6, 3), [1.0, 2.0, 3.0]), "GRBG"), cfa="GRBG")
    >>> image.shape, image[1, 2].tolist()
    ((4, 6, 3), [1.0, 2.0, 3.0])
    """
    if method != METHOD:
        raise InputError(f"method: expected {METHOD!r}, got {method!r}")
    check_cfa(cfa)
    if cfa is None:
        raise InputError("cfa: a monochrome image has nothing to demosaic")
    raw = np.asarray(mosaic_HW, dtype=np.float64)
    if raw.ndim != 2 or min(raw.shape) < 2:
        raise InputError(f"mosaic: expected an image (H, W) of at least 2 x 2, got {raw.shape}")
    if not np.all(np.isfinite(raw)):
        raise InputError("mosaic: holds NaN or infinity")
    with np.errstate(over="ignore", invalid="ignore"):
        cells, green, image = colour_cells(cfa), np.empty(raw.shape), np.empty((*raw.shape, 3))
        _interpolate_green(green, raw, cells)
        _interpolate_chroma(image, green, raw, cells)
    if not np.all(np.isfinite(image)):
        raise InputError("mosaic: values are too large for those of neighbours to be added up")
    return image


@shared(lambda green, *_: len(green))
def _interpolate_green(first: int, last: int, green: np.ndarray, raw: np.ndarray, cells: np.ndarray) -> None:
    """Green at every pixel of a mosaic (H, W): Eqs. 4 and 5 of Muniraj et al. 2017.

    `cells` (2, 2) are the colours of the Bayer cells. The image is continued by reflection about its border
    pixels.
    """
    height, width = raw.shape
    for i in range(first, last):
        row, above, below = raw[i], raw[_reflected(i - 1, height)], raw[_reflected(i + 1, height)]
        far_above, far_below = raw[_reflected(i - 2, height)], raw[_reflected(i + 2, height)]
        for parity in range(2):
            if cells[i % 2, parity] == 1:
                for j in range(parity, width, 2):
                    green[i, j] = row[j]
                continue
            for j in range(parity, width, 2):
                if 2 <= j < width - 2:
                    left, right, far_left, far_right = row[j - 1], row[j + 1], row[j - 2], row[j + 2]
                else:
                    left, right = row[_reflected(j - 1, width)], row[_reflected(j + 1, width)]
                    far_left, far_right = row[_reflected(j - 2, width)], row[_reflected(j + 2, width)]
                alpha = abs((far_left + far_right) / 2 - row[j])
                beta = abs((far_above[j] + far_below[j]) / 2 - row[j])
                if alpha < beta:
                    green[i, j] = (left + right) / 2
                elif alpha > beta:
                    green[i, j] = (above[j] + below[j]) / 2
                else:  # rare in photographs, but usual for photon counts, most of which are 0
                    green[i, j] = (above[j] + left + right + below[j]) / 4


@shared(lambda image, *_: len(image))
def _interpolate_chroma(
    first: int, last: int, image: np.ndarray, green: np.ndarray, raw: np.ndarray, cells: np.ndarray
) -> None:
    """Colours (H, W, 3) from a mosaic and its green: Eq. 6, differences from green at their own sites."""
    height, width = raw.shape
    for i in range(first, last):
        up, down = _reflected(i - 1, height), _reflected(i + 1, height)
        for parity in range(2):
            colour, row_colour = cells[i % 2, parity], cells[i % 2, 1 - parity]
            column_colour = cells[1 - i % 2, parity]
            for j in range(parity, width, 2):
                left, right = j - 1, j + 1
                if j == 0 or j == width - 1:
                    left, right = _reflected(left, width), _reflected(right, width)
                green_here = green[i, j]
                image[i, j, 1] = green_here
                if colour == 1:
                    horizontal = (raw[i, left] - green[i, left]) + (raw[i, right] - green[i, right])
                    vertical = (raw[up, j] - green[up, j]) + (raw[down, j] - green[down, j])
                    image[i, j, row_colour] = horizontal / 2 + green_here
                    image[i, j, column_colour] = vertical / 2 + green_here
                else:
                    above = (raw[up, left] - green[up, left]) + (raw[up, right] - green[up, right])
                    diagonal = above + (raw[down, left] - green[down, left])
                    diagonal += raw[down, right] - green[down, right]
                    image[i, j, colour] = raw[i, j]
                    image[i, j, 2 - colour] = diagonal / 4 + green_here


@helper
def _reflected(index: int, size: int) -> int:
    """The index inside 0 .. size-1 that stands for this one under reflection about the border pixels."""
    while index < 0 or index >= size:
        index = -index if index < 0 else 2 * (size - 1) - index
    return index
