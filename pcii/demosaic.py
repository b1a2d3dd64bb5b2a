"""Demosaicing of Bayer images: Laroche and Prescott's gradient based interpolation.

Muniraj et al. 2017, Eqs. 4-6, with their misprints put right: Eq. 4's second case is the vertical
pair (G33 + G53) / 2, Eq. 5's (G24 + G44) / 2, and Eq. 6 is three kinds of site, not three cases of
one. Written for the site, not for the pattern, so all four Bayer patterns are one code.
"""

from collections.abc import Callable

import numpy as np

from pcii.bayer import colour_cells, colour_index
from pcii.errors import InputError

RED, GREEN, BLUE = 0, 1, 2


def demosaic(
    mosaic_HW: np.ndarray, *, cfa: str | None = "GRBG", method: str = "laroche-prescott"
) -> np.ndarray:
    """Colour image (H, W, 3) float64 from a Bayer mosaic (H, W).

    Borders continue the image by reflection about the border pixels, which keeps the Bayer phase.
    Raises `InputError` for an unknown pattern or method, an image below 2 x 2, NaN or infinity.

    >>> demosaic(np.ones((4, 4)), cfa="GRBG").shape
    (4, 4, 3)
    """
    if not isinstance(method, str) or method not in METHODS:
        raise InputError(f"method: no demosaicing named {method!r}; use {', '.join(METHODS)}")
    if cfa is None:
        raise InputError("cfa: a monochrome image has nothing to demosaic")
    raw = np.asarray(mosaic_HW, dtype=np.float64)
    if raw.ndim != 2 or min(raw.shape) < 2:
        raise InputError(f"mosaic: expected an image (H, W) of at least 2 x 2, got {raw.shape}")
    if not np.all(np.isfinite(raw)):
        raise InputError("mosaic: holds NaN or infinity")
    return METHODS[method](raw, cfa)


def laroche_prescott(raw: np.ndarray, cfa: str) -> np.ndarray:
    """Green along the smaller chroma gradient (Eqs. 4, 5), then red and blue differences (Eq. 6)."""
    colour = colour_index(raw.shape[0], raw.shape[1], cfa)
    green = _green(raw, colour)
    image = np.empty((*raw.shape, 3))
    image[..., GREEN] = green
    cells = colour_cells(cfa)
    for chroma in (RED, BLUE):
        a = int(np.nonzero(cells == chroma)[0][0])  # row parity of this colour's sites
        image[..., chroma] = green + _difference(raw - green, colour, chroma, a)
    return image


def _green(raw: np.ndarray, colour: np.ndarray) -> np.ndarray:
    at = _neighbours(raw, 2)
    alpha = np.abs((at(0, -2) + at(0, 2)) / 2 - raw)
    beta = np.abs((at(-2, 0) + at(2, 0)) / 2 - raw)
    horizontal = (at(0, -1) + at(0, 1)) / 2
    vertical = (at(-1, 0) + at(1, 0)) / 2
    # The tie is a corner case for photographs and the usual case for photon counts: most are 0.
    either = (at(-1, 0) + at(0, -1) + at(0, 1) + at(1, 0)) / 4
    green = np.where(alpha < beta, horizontal, np.where(alpha > beta, vertical, either))
    return np.where(colour == GREEN, raw, green)


def _difference(minus_green: np.ndarray, colour: np.ndarray, chroma: int, row_parity: int) -> np.ndarray:
    """Chroma minus green at every pixel, from its values at the chroma's own sites."""
    at = _neighbours(minus_green, 1)
    horizontal = (at(0, -1) + at(0, 1)) / 2
    vertical = (at(-1, 0) + at(1, 0)) / 2
    diagonal = (at(-1, -1) + at(-1, 1) + at(1, -1) + at(1, 1)) / 4
    chroma_row = (np.arange(colour.shape[0]) % 2 == row_parity)[:, None]
    at_green = np.where(chroma_row, horizontal, vertical)
    elsewhere = np.where(colour == GREEN, at_green, diagonal)
    return np.where(colour == chroma, minus_green, elsewhere)


def _neighbours(image: np.ndarray, reach: int) -> Callable[[int, int], np.ndarray]:
    """`at(di, dj)`: the image seen from each pixel's neighbour (i + di, j + dj)."""
    H, W = image.shape
    padded = np.pad(image, reach, mode="reflect")

    def at(di: int, dj: int) -> np.ndarray:
        return padded[reach + di : reach + di + H, reach + dj : reach + dj + W]

    return at


METHODS: dict[str, Callable[[np.ndarray, str], np.ndarray]] = {"laroche-prescott": laroche_prescott}
