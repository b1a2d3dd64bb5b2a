"""Square blocks of pixels, windows and boxes: sums over them, and their values on pixels again."""

from collections.abc import Sequence

import numpy as np

MARGIN_PX = 40
"""Margin around an object that is shown, so that its outline may move."""


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
