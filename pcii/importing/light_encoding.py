"""Linear radiance from the numbers of picture files: sRGB, a gamma, or linear already."""

from typing import Any, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import srgb_to_linear

Encoding = Literal["srgb", "linear"] | float
"""How numbers tell light: "srgb", "linear", or the exponent of a gamma, such as 2.2."""
GAMMAS = (0.1, 10.0)


def check_encoding(encoding: Any) -> None:
    """Raise `InputError` unless this is an `Encoding`, or None for the usual one."""
    if encoding is None or encoding in ("srgb", "linear"):
        return
    number = isinstance(encoding, int | float) and not isinstance(encoding, bool)
    if not (number and GAMMAS[0] <= float(encoding) <= GAMMAS[1]):
        ends = f"{GAMMAS[0]:g} to {GAMMAS[1]:g}"
        raise InputError(f"encoding: expected srgb, linear, or a gamma from {ends}, got {encoding!r}")


def to_radiance(numbers: np.ndarray, encoding: Encoding | None, most: int | None = None) -> np.ndarray:
    """Linear radiance, float32, of whole numbers (of 1 at `most`) or of floats.

    `most` is by default the largest number of the type. Without an encoding whole numbers are sRGB, as in
    nearly all picture files, and floats are linear. Raises `InputError` for numbers that are NaN or infinite,
    for encoded ones below 0, and for light that is too bright for float32.

    >>> to_radiance(np.array([0, 128, 255], np.uint8), None).astype(float).round(3).tolist()
    [0.0, 0.216, 1.0]
    >>> to_radiance(np.array([0, 128, 255], np.uint8), "linear").astype(float).round(3).tolist()
    [0.0, 0.502, 1.0]
    """
    whole = numbers.dtype.kind == "u"
    if not whole and not np.isfinite(numbers).all():
        raise InputError("holds NaN or infinity; radiance is finite")
    if encoding is None:
        encoding = "srgb" if whole else "linear"
    full = most or (np.iinfo(numbers.dtype).max if whole else 1)
    if encoding == "srgb" and whole:  # few values are many pixels
        return srgb_to_linear(np.arange(full + 1) / full).astype(np.float32)[numbers]
    share = numbers / np.float32(full) if whole else numbers
    if encoding != "linear" and not whole and share.size and share.min() < 0:
        raise InputError("holds numbers below 0, which no encoded light has")
    with np.errstate(over="ignore"):
        if encoding == "srgb":
            share = srgb_to_linear(share)
        elif encoding != "linear":
            share = (share if whole else share.astype(np.float64)) ** encoding
        linear = share.astype(np.float32)
    if not np.isfinite(linear).all():
        raise InputError("holds light that is too bright for float32")
    return linear
