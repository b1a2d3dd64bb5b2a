"""Checks of arrays that all types share.

Axes, always in this order: (K, L, H, W, C) for views, (Z, H, W, C) for sections; C is R, G, B.
Lengths are millimetres and carry `_mm`; `z` is planar depth from the camera plane, never ray length.
"""

import numpy as np

from pcii.base.errors import InputError


def read_only(array: np.ndarray) -> np.ndarray:
    """A view of `array` that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def check_z_mm(z_mm: object) -> np.ndarray:
    """Depths in mm as a float64 array (Z,), from one number or a list.

    Raises `InputError` for no depth, or one that is not a finite number above 0.

    >>> check_z_mm(540).tolist()
    [540.0]
    """
    try:
        z = np.atleast_1d(np.asarray(z_mm, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"z_mm: expected depths in millimetres, got {z_mm!r}") from None
    if z.ndim != 1 or z.size == 0:
        raise InputError("z_mm: expected one depth or a list of depths in millimetres")
    if not np.all(np.isfinite(z) & (z > 0)):
        bad = z[~(np.isfinite(z) & (z > 0))][0]
        raise InputError(f"z_mm: a depth must be a finite number above 0 mm, got {bad:g}")
    return z
