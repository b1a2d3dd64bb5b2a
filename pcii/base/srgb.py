"""sRGB (IEC 61966-2-1): encoding for screens, decoding of pictures to linear values, luminance."""

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of the primaries."""


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """Encode linear values as sRGB in [0, 1], float64 of the same shape; values outside [0, 1] are clipped.

    >>> linear_to_srgb(np.array([-1.0, 0.0, 0.2140, 1.0, 2.0])).round(3).tolist()
    [0.0, 0.0, 0.5, 1.0, 1.0]
    """
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """Linear values, float, of sRGB: of numbers in [0, 1], or of 8-bit or 16-bit whole numbers.

    The curve is continued above 1, up to infinity where the type holds no more, and as a straight line below
    0. NaN stays NaN.

    >>> srgb_to_linear(np.array([0, 188, 255], dtype=np.uint8)).round(3).tolist()
    [0.0, 0.503, 1.0]
    """
    encoded = np.asarray(srgb)
    x = encoded / np.iinfo(encoded.dtype).max if encoded.dtype.kind == "u" else encoded
    with np.errstate(over="ignore"):
        return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0) + 0.055) / 1.055) ** 2.4)
