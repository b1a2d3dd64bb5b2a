"""Bayer colour filter arrays: which colour each pixel records.

A pattern is named by its first two rows, read left to right, top to bottom: in ``GRBG`` the pixel
(0, 0) is green, (0, 1) red, (1, 0) blue and (1, 1) green (Muniraj et al. 2017, Fig. 3).
"""

import numpy as np

from pcii.base import InputError

COLOURS = "RGB"
PATTERNS = ("GRBG", "RGGB", "BGGR", "GBRG")


def check_cfa(cfa: str | None) -> str | None:
    """Return `cfa` if it names a Bayer pattern or is None (monochrome), else raise `InputError`."""
    if cfa is None or cfa in PATTERNS:
        return cfa
    raise InputError(
        f"cfa: there is no Bayer pattern {cfa!r}; use one of {', '.join(PATTERNS)}, "
        "or none (None in Python) for a monochrome sensor"
    )


def channel_count(cfa: str | None) -> int:
    """Number of colours of a pattern: 3, or 1 for a monochrome sensor (None)."""
    return 1 if cfa is None else 3


def colour_cells(cfa: str | None) -> np.ndarray:
    """Colour of each cell of the 2 x 2 pattern, shape (2, 2), int; 0, 1, 2 = R, G, B.

    A monochrome sensor has the single colour 0 everywhere. Raises `InputError` for an unknown pattern.

    >>> colour_cells("GRBG").tolist()
    [[1, 0], [2, 1]]
    """
    check_cfa(cfa)
    if cfa is None:
        return np.zeros((2, 2), dtype=np.int64)
    return np.array([COLOURS.index(letter) for letter in cfa], dtype=np.int64).reshape(2, 2)


def colour_index(height: int, width: int, cfa: str | None) -> np.ndarray:
    """Colour that each pixel records, shape (height, width), uint8; 0, 1, 2 = R, G, B."""
    cells = colour_cells(cfa).astype(np.uint8)
    return np.tile(cells, ((height + 1) // 2, (width + 1) // 2))[:height, :width]


def by_colour(pixels: np.ndarray, cfa: str | None) -> np.ndarray:
    """Pixels (H, W) of a mosaic in the channels (H, W, C) of their colours, 0 in the others; same dtype.

    >>> by_colour(np.array([[2, 4]]), "GRBG").tolist()
    [[[0, 2, 0], [4, 0, 0]]]
    """
    colours = colour_index(pixels.shape[0], pixels.shape[1], cfa)[..., None]
    return pixels[..., None] * (colours == np.arange(channel_count(cfa)))


def colours_and_samples(light: np.ndarray, cfa: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Light and number of samples, (H, W, C) each, of an image (H, W, C) that may be a mosaic."""
    samples = np.ones(light.shape, dtype=np.int64)
    if cfa is None:
        return light, samples
    return by_colour(light[..., 0], cfa), by_colour(samples[..., 0], cfa)


def mosaic(rgb: np.ndarray, cfa: str) -> np.ndarray:
    """Bayer mosaic (..., H, W) of a colour image (..., H, W, 3), same dtype: one colour of each pixel.

    Raises `InputError` for another shape or an unknown pattern.

    >>> mosaic(np.array([[[1, 2, 3], [4, 5, 6]]]), "GRBG")
    array([[2, 4]])
    """
    if rgb.ndim < 3 or rgb.shape[-1] != 3:
        raise InputError(f"rgb: expected an array (..., H, W, 3), got shape {rgb.shape}")
    raw = np.empty(rgb.shape[:-1], dtype=rgb.dtype)
    for (a, b), colour in np.ndenumerate(colour_cells(cfa)):
        raw[..., a::2, b::2] = rgb[..., a::2, b::2, colour]
    return raw
