"""Demosaicing of Bayer images: the gradient-based interpolation of Laroche and Prescott, and three others.

Muniraj et al. 2017, Eqs. 4-6, with their misprints corrected: Eq. 4's second case is the vertical
pair (G33 + G53) / 2, Eq. 5's (G24 + G44) / 2, and Eq. 6 is three kinds of site, not three cases of
one. The code distinguishes sites, not patterns, so it serves all four Bayer patterns. Bilinear
interpolation, Malvar et al. 2004 and Menon et al. 2007 come from the package colour-demosaicing.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module

import numpy as np

from pcii.base.errors import InputError
from pcii.types.bayer import check_cfa, colour_cells


def demosaic(
    mosaic_HW: np.ndarray, *, cfa: str | None = "GRBG", method: str = "laroche-prescott"
) -> np.ndarray:
    """Colour image (H, W, 3) float64 from a Bayer mosaic (H, W).

    `method` is "laroche-prescott", "bilinear", "malvar" or "menon". Borders continue the image by
    reflection about the border pixels, which keeps the Bayer phase.
    Raises `InputError` for an unknown pattern or method, an image below 2 x 2, NaN or infinity, and values
    so large that those of neighbours cannot be added up.

    >>> from pcii.types.bayer import mosaic
    >>> image = demosaic(mosaic(np.full((4, 6, 3), [1.0, 2.0, 3.0]), "GRBG"), cfa="GRBG")
    >>> image.shape, image[1, 2].tolist()
    ((4, 6, 3), [1.0, 2.0, 3.0])
    """
    if not isinstance(method, str) or method not in METHODS:
        raise InputError(f"method: no demosaicing named {method!r}; use {', '.join(METHODS)}")
    check_cfa(cfa)
    if cfa is None:
        raise InputError("cfa: a monochrome image has nothing to demosaic")
    raw = np.asarray(mosaic_HW, dtype=np.float64)
    if raw.ndim != 2 or min(raw.shape) < 2:
        raise InputError(f"mosaic: expected an image (H, W) of at least 2 x 2, got {raw.shape}")
    if not np.all(np.isfinite(raw)):
        raise InputError("mosaic: holds NaN or infinity")
    with np.errstate(over="ignore", invalid="ignore"):
        image = METHODS[method](raw, cfa)
    if not np.all(np.isfinite(image)):
        raise InputError("mosaic: values are too large for those of neighbours to be added up")
    return image


def laroche_prescott(raw: np.ndarray, cfa: str) -> np.ndarray:
    """Green along the smaller chroma gradient (Eqs. 4, 5), then red and blue differences (Eq. 6)."""
    from pcii.sections import kernels

    cells = colour_cells(cfa).astype(np.int64)
    green, image = np.empty(raw.shape), np.empty((*raw.shape, 3))
    kernels.interpolate_green(green, raw, cells)
    kernels.interpolate_chroma(image, green, raw, cells)
    return image


BORDER_PX = 8
"""Larger than the reach of any of these methods; even, so that the Bayer phase stays."""


def _by_package(name: str, raw: np.ndarray, cfa: str) -> np.ndarray:
    """A function of colour-demosaicing, on the image continued by reflection: its borders mix colours."""
    printing = np.get_printoptions()
    package = import_module("colour_demosaicing")
    np.set_printoptions(**printing)  # which importing the package changes
    image = getattr(package, name)(np.pad(raw, BORDER_PX, mode="reflect"), cfa)
    return np.ascontiguousarray(image[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX])


METHODS: dict[str, Callable[[np.ndarray, str], np.ndarray]] = {
    "laroche-prescott": laroche_prescott,
    "bilinear": partial(_by_package, "demosaicing_CFA_Bayer_bilinear"),
    "malvar": partial(_by_package, "demosaicing_CFA_Bayer_Malvar2004"),
    "menon": partial(_by_package, "demosaicing_CFA_Bayer_Menon2007"),
}
