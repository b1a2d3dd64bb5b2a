"""What is stated of images: where cameras stand, how views are stored, and how numbers stand for light."""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import numpy as np

from pcii.base import InputError, srgb_to_linear
from pcii.types import CameraGrid

Encoding = Literal["srgb", "linear"] | float
"""How numbers stand for light: "srgb", "linear", or the exponent of a gamma, such as 2.2."""
LARGEST_ENCODED = 2.0
"""Largest encoded float that is taken: white is 1, and sharpened pictures exceed it a little. Numbers of 8
bits or more, which are refused, reach far more: any limit from 1.5 to 100 decides alike."""
MANY_VIEWS = 100
"""An array of more views than this, and of more than each view has pixels, has its axes in another order:
what was taken for cameras are pixels."""
AXES = "KLNTHWC"
"""The order in which axes are understood: cameras or views, frames, pixels, colours."""
Note = Callable[[str], None]
"""Takes a sentence on what is left out or assumed."""


def warn(sentence: str) -> None:
    """Pass a sentence on as a Python warning: the default of readers."""
    warnings.warn(sentence, stacklevel=3)


@dataclass(frozen=True, kw_only=True)
class Optics:
    """Where cameras stand and how they see: all of a `CameraGrid` that pictures do not say.

    `pitch_mm` (x, y) is between neighbouring cameras, `focal_mm` from pinhole to film. The side of a pixel is
    `pixel_mm`, or follows from the width of the sensor, `sensor_mm`, and that of the pictures. `shear_px` is
    that of `CameraGrid`. Raises `InputError` unless exactly one of `pixel_mm` and `sensor_mm` is there.
    """

    pitch_mm: tuple[float, float]
    focal_mm: float
    pixel_mm: float | None = None
    sensor_mm: float | None = None
    shear_px: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.pixel_mm is None) == (self.sensor_mm is None):
            raise InputError(
                "pixel_mm, sensor_mm: give either the side of a pixel or the width of the sensor"
            )
        self.grid((1, 1, 1, 1))  # lengths are checked before pictures are read

    def pixel_of(self, width: int) -> float:
        """Side of a pixel in mm of pictures that are `width` px wide."""
        return cast(float, self.pixel_mm if self.sensor_mm is None else self.sensor_mm / width)

    def grid(self, shape: tuple[int, ...]) -> CameraGrid:
        """The camera grid of views of the shape (K, L, H, W, ...); raises `InputError` for a wrong length."""
        rows, cols, height, width = shape[:4]
        return CameraGrid(
            rows=rows,
            cols=cols,
            pitch_mm=self.pitch_mm,
            focal_mm=self.focal_mm,
            pixel_mm=self.pixel_of(width),
            height=height,
            width=width,
            shear_px=self.shear_px,
        )


@dataclass(frozen=True, kw_only=True)
class ViewOrder:
    """How the views were stored, if not rows from the top and in each row columns from the left.

    The changes are made in the order in which they stand here.
    """

    serpentine: bool = False
    """Every other row is stored backwards, as a stage takes them that moves to and fro."""
    swap_axes: bool = False
    """Rows and columns are exchanged; {index} and pages count down the columns."""
    flip_rows: bool = False
    """Rows are counted from the bottom."""
    flip_cols: bool = False
    """Columns are counted from the right."""

    def arrange(self, views: np.ndarray) -> np.ndarray:
        """An array (A, B, ...) of views as they were stored, by camera: (K, L, ...).

        >>> ViewOrder(swap_axes=True, flip_rows=True).arrange(np.array([[1, 2, 3], [4, 5, 6]])).tolist()
        [[3, 6], [2, 5], [1, 4]]
        >>> ViewOrder(serpentine=True).arrange(np.array([[1, 2, 3], [4, 5, 6]])).tolist()
        [[1, 2, 3], [6, 5, 4]]
        """
        if self.serpentine:
            views = np.copy(views)
            views[1::2] = views[1::2, ::-1]
        if self.swap_axes:
            views = views.swapaxes(0, 1)
        return views[:: -1 if self.flip_rows else 1, :: -1 if self.flip_cols else 1]

    def table_of(self, source: str | Path, count: int, grid: tuple[int, int] | None) -> tuple[int, int]:
        """The table (A, B) in which `count` views of a `grid` (K, L) are stored; square without a grid.

        Raises `InputError`, naming the source, if the count is another one.
        """
        rows, cols = grid or (math.isqrt(count), math.isqrt(count))
        if rows < 1 or rows * cols != count:
            right = "no square grid; say how many with --grid" if grid is None else f"not {rows} x {cols}"
            raise InputError(f"{source}: {count} views are {right}")
        return (cols, rows) if self.swap_axes else (rows, cols)


AS_STORED = ViewOrder()
"""Rows from the top, columns from the left."""


@dataclass(frozen=True, kw_only=True)
class ViewTable:
    """How an array holds views: of a `grid` (K, L), in an `order`, with named `axes` such as "HWKL".

    Without `axes` they are in the order of `AXES`, and of a `grid` the first axis counts the views.
    """

    grid: tuple[int, int] | None = None
    order: ViewOrder = AS_STORED
    axes: str | None = None

    def by_camera(self, numbers: np.ndarray, name: str, ordinary: str = "") -> np.ndarray:
        """An array as (K, L, ...), in the order of `AXES`; `ordinary` are its other axes in words.

        Raises `InputError` for other axes, and for more views than pixels in an order that nobody has named.
        """
        axes, shape = self.axes, numbers.shape
        if axes is not None:
            numbers = _in_order(numbers, name, axes)
        else:
            axes = "KL" if self.grid is None else "N"
            count, others = len(axes), shape[len(axes) :]
            if len(others) < 2:
                raise InputError(
                    f"{name}: expected (K, L, {ordinary}), or with --grid (N, {ordinary}), got {shape}"
                )
            # Colours of single pictures have a sentence of their own.
            are_colours = len(shape) == 4 and shape[-1] in (3, 4)
            if not are_colours and math.prod(shape[:count]) > max(MANY_VIEWS, math.prod(others)):
                raise InputError(
                    f"{name}: {shape} would be more views than each has numbers; name the order of its axes "
                    "with --axes, such as HWKL"
                )
        if "N" in axes:
            table = self.order.table_of(name, numbers.shape[0], self.grid)
            numbers = numbers.reshape(*table, *numbers.shape[1:])
        return self.order.arrange(numbers)


def _in_order(numbers: np.ndarray, name: str, axes: str) -> np.ndarray:
    """An array whose axes are named, in the order of `AXES`; `InputError` for names that do not fit."""
    names = {*axes}
    is_known = len(names) == len(axes) and names <= {*AXES} and {*"HW"} <= names
    if not is_known or (names & {*"KLN"}) not in ({*"KL"}, {"N"}):
        raise InputError(
            "--axes: expected each axis once, K and L (rows and columns of cameras) or N (views), "
            f"T (frames), H and W (rows and columns of pixels), C (colours), such as HWKL; got {axes!r}"
        )
    if len(axes) != numbers.ndim:
        raise InputError(f"{name}: has the shape {numbers.shape}, and --axes {axes} are {len(axes)} axes")
    return numbers.transpose([axes.index(axis) for axis in AXES if axis in names])


def to_radiance(numbers: np.ndarray, encoding: Encoding | None, most: int | None = None) -> np.ndarray:
    """Linear radiance, float32, of whole numbers (of 1 at `most`) or of floats.

    `most` is by default the largest number of the type. Without an encoding whole numbers are sRGB, as in
    nearly all picture files, and floats are linear. Raises `InputError` for an encoding that is none, for
    numbers that are NaN or infinite, for encoded ones below 0 or far above 1, and for light that is too
    bright for float32.

    >>> to_radiance(np.array([0, 128, 255], np.uint8), None).astype(float).round(3).tolist()
    [0.0, 0.216, 1.0]
    >>> to_radiance(np.array([0, 128, 255], np.uint8), "linear").astype(float).round(3).tolist()
    [0.0, 0.502, 1.0]
    """
    is_whole = numbers.dtype.kind == "u"
    if encoding is None:
        encoding = "srgb" if is_whole else "linear"
    elif encoding not in ("srgb", "linear") and not (
        isinstance(encoding, int | float) and 0.1 <= encoding <= 10
    ):
        raise InputError(f"encoding: expected srgb, linear, or a gamma from 0.1 to 10, got {encoding!r}")
    full = most or (np.iinfo(numbers.dtype).max if is_whole else 1)
    if encoding == "srgb" and is_whole:  # few values are many pixels
        return srgb_to_linear(np.arange(full + 1) / full).astype(np.float32)[numbers]
    share = numbers / np.float32(full) if is_whole else numbers
    least, top = share.min(), share.max()
    if not np.isfinite([least, top]).all():
        raise InputError("holds NaN or infinity; radiance is finite")
    if encoding != "linear" and not 0 <= least <= top <= LARGEST_ENCODED:
        raise InputError(
            f"holds numbers from {least:g} to {top:g}; encoded light is from 0 to 1, which is white: divide "
            "by the number of white"
        )
    with np.errstate(over="ignore"):
        if encoding == "srgb":
            share = srgb_to_linear(share)
        elif encoding != "linear":
            share = (share if is_whole else share.astype(np.float64)) ** encoding
        linear = share.astype(np.float32)
    if not np.isfinite(linear).all():
        raise InputError("holds light that is too bright for float32")
    return linear
