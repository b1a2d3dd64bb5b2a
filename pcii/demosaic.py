"""Demosaicing of Bayer images: Laroche and Prescott's gradient based interpolation.

Muniraj et al. 2017, Eqs. 4-6, with their misprints put right: Eq. 4's second case is the vertical
pair (G33 + G53) / 2, Eq. 5's (G24 + G44) / 2, and Eq. 6 is three kinds of site, not three cases of
one. Written for the site, not for the pattern, so all four Bayer patterns are one code.
"""

from collections.abc import Callable

import numpy as np

from pcii.bayer import colour_cells
from pcii.errors import InputError


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
    from pcii import kernels

    cells = colour_cells(cfa).astype(np.int64)
    green, image = np.empty(raw.shape), np.empty((*raw.shape, 3))
    kernels.interpolate_green(green, raw, cells)
    kernels.interpolate_chroma(image, green, raw, cells)
    return image


METHODS: dict[str, Callable[[np.ndarray, str], np.ndarray]] = {"laroche-prescott": laroche_prescott}
