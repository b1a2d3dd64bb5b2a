"""sRGB primaries (IEC 61966-2-1) from CIE XYZ."""

import numpy as np

from pcii.base.srgb import linear_to_srgb

FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""From CIE XYZ to linear sRGB."""


def srgb_of(linear: np.ndarray) -> list[float]:
    """Linear values (3,), cut to 0 to 1, as sRGB of six digits."""
    return [round(float(part), 6) for part in linear_to_srgb(linear)]
