"""Checks of arrays that all types share.

Axes, always in this order: (K, L, H, W, C) for views, (Z, H, W, C) for sections; C is R, G, B.
Lengths are millimetres and carry `_mm`; `z` is planar depth from the camera plane, never ray length.
"""

from typing import TypeGuard

import numpy as np

from pcii.base.errors import InputError

LARGEST_COUNT = 1 << 40
"""Most photons of a pixel; the sum over millions of such pixels fits in 64 bits."""
LARGEST_TOTAL = (1 << 63) - 1
"""Most photons of all pixels, which 64 bits hold."""
MOST_DEPTHS = 10_000
"""Longer lists, typed or stored, are rejected as errors: no stack has so many sections."""


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number, of Python or of NumPy."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def read_only(array: np.ndarray) -> np.ndarray:
    """A view of `array` that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def check_unmasked(name: str, values: object) -> None:
    """Raise `InputError` for a masked array of which anything is masked: it would be taken for a number."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise InputError(f"{name}: masked values have no number; give an array without a mask")


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


def check_total(name: str, counts: np.ndarray) -> None:
    """Raise `InputError` if whole numbers, each below 2^63, add up to more than int64 holds."""
    if counts.size == 0 or counts.size * int(counts.max()) <= LARGEST_TOTAL:
        return
    wide, half = counts.astype(np.uint64), np.uint64(32)
    total = (int((wide >> half).sum()) << 32) + int((wide & np.uint64((1 << 32) - 1)).sum())
    if total > LARGEST_TOTAL:
        raise InputError(f"{name}: {total} photons in all are more than 64-bit numbers hold, {LARGEST_TOTAL}")


def whole_counts(name: str, values: np.ndarray) -> np.ndarray:
    """Counts as integers: integers >= 0 as they are, floats if whole; else raises `InputError`."""
    check_unmasked(name, values)
    array = np.asarray(values)
    kind = array.dtype.kind
    if kind not in "iubf" or (kind == "f" and not (np.isfinite(array) & (array == np.floor(array))).all()):
        raise InputError(f"{name}: photon counts must be whole numbers, got {array.dtype}")
    if array.size and array.min() < 0:
        raise InputError(f"{name}: photon counts must not be negative")
    if array.size and float(array.max()) > LARGEST_COUNT:
        raise InputError(f"{name}: more than 2^40 photons in a pixel cannot be summed exactly")
    integers = {"f": np.dtype(np.int64), "b": np.dtype(np.uint8)}
    return array.astype(integers.get(kind, array.dtype.newbyteorder("=")), copy=False)
