"""Encoding of linear values as sRGB (IEC 61966-2-1), for pictures on screens."""

import numpy as np


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """Encode linear values as sRGB in [0, 1], float64 of the same shape; values outside [0, 1] are clipped.

    >>> linear_to_srgb(np.array([-1.0, 0.0, 0.2140, 1.0, 2.0])).round(3)
    array([0. , 0. , 0.5, 1. , 1. ])
    """
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
