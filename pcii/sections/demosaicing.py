"""Demosaicing of Bayer images: the gradient-based interpolation of Laroche and Prescott.

Muniraj et al. 2017, Eqs. 4-6, with their misprints corrected: Eq. 4's second case is the vertical
pair (G33 + G53) / 2, Eq. 5's (G24 + G44) / 2, and Eq. 6 is three kinds of site, not three cases of
one. The code distinguishes sites, not patterns, so it serves all four Bayer patterns.
"""

import numpy as np

from pcii.base import InputError
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
    from pcii.sections import kernels

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
        kernels.interpolate_green(green, raw, cells)
        kernels.interpolate_chroma(image, green, raw, cells)
    if not np.all(np.isfinite(image)):
        raise InputError("mosaic: values are too large for those of neighbours to be added up")
    return image
