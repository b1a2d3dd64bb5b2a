"""What is stated of the cameras of views: where they stand, how they see, and how views are stored."""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from pcii.base import InputError
from pcii.types import CameraGrid

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
        if rows * cols != count:
            right = "no square grid; say how many with --grid" if grid is None else f"not {rows} x {cols}"
            raise InputError(f"{source}: {count} views are {right}")
        return (cols, rows) if self.swap_axes else (rows, cols)


AS_STORED = ViewOrder()
"""Rows from the top, columns from the left."""
