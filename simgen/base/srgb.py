"""sRGB (IEC 61966-2-1): what its numbers mean."""

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of its primaries."""
FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""From CIE XYZ to linear sRGB."""


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """Values in [0, 1] to linear ones."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
