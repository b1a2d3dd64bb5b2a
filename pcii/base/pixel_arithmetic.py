"""Arithmetic of pixels: sRGB (IEC 61966-2-1), sums over blocks and windows, and boxes around masks."""

from collections.abc import Sequence

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of the primaries."""
MARGIN_PX = 40
"""Margin around an object that is shown, so that its outline may move."""


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


def block_sums(pixels: np.ndarray, side: int, dtype: type, axes: tuple[int, int] = (-2, -1)) -> np.ndarray:
    """Sums over blocks of `side` x `side` along two axes, as `dtype`; blocks at the ends may be smaller.

    >>> block_sums(np.ones((3, 4), int), 2, int).tolist()
    [[4, 4], [2, 2]]
    """
    missing = [(0, 0)] * pixels.ndim
    for axis in axes:
        missing[axis] = (0, -pixels.shape[axis] % side)
    sums = np.pad(pixels, missing) if any(end for _, end in missing) else pixels
    for axis in axes:
        # Strided sums: NumPy's over short runs take five times as long.
        along = np.moveaxis(sums, axis, 0)
        sums = np.moveaxis(sum_of([along[place::side] for place in range(side)], dtype), 0, axis)
    return sums


def sum_of(parts: Sequence[np.ndarray], dtype: type) -> np.ndarray:
    """Sum of arrays of one shape, added one by one."""
    total = parts[0].astype(dtype)
    for part in parts[1:]:
        total += part
    return total


def window_sums(values: np.ndarray, sigma: float) -> np.ndarray:
    """Sums (..., h, w) in a Gaussian window around each place, of weight 1 at its centre."""
    from scipy.ndimage import gaussian_filter

    axes = values.ndim - 2, values.ndim - 1
    return gaussian_filter(values, sigma, mode="constant", axes=axes) * (2 * np.pi * sigma**2)


def on_pixels(blocks: np.ndarray, side: int, shape: tuple[int, ...]) -> np.ndarray:
    """Values of blocks (..., h, w) at each of their pixels, of which there are `shape` (H, W)."""
    full = blocks.repeat(side, axis=-2).repeat(side, axis=-1)
    return full[..., : shape[0], : shape[1]]


def evenly_chosen(count: int, most: int) -> list[int]:
    """Indices of all of `count` things, or of `most` of them evenly apart, the first and the last included.

    >>> evenly_chosen(3, 4), evenly_chosen(9, 3)
    ([0, 1, 2], [0, 4, 8])
    """
    return np.linspace(0, count - 1, min(count, most)).round().astype(int).tolist()


def box_around(mask: np.ndarray, margin_px: tuple[int, int] = (MARGIN_PX, MARGIN_PX)) -> tuple[slice, slice]:
    """Rows and columns of a mask with margins (vertical, horizontal), inside the frame; all if it is empty.

    >>> box_around(np.eye(9, dtype=bool)[:5], (1, 2))
    (slice(0, 5, None), slice(0, 7, None))
    """
    if not mask.any():
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    box = []
    for axis, size in enumerate(mask.shape):
        inside, margin = np.flatnonzero(mask.any(axis=1 - axis)), margin_px[axis]
        box.append(slice(max(int(inside[0]) - margin, 0), min(int(inside[-1]) + 1 + margin, size)))
    return box[0], box[1]
