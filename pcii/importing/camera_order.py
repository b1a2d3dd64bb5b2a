"""Cameras of imported images: their optics, and the order in which the views were stored."""

from dataclasses import dataclass

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid


@dataclass(frozen=True, kw_only=True)
class Optics:
    """Where cameras stand and how they see: all of a `CameraGrid` that pictures do not tell.

    `pitch_mm` (x, y) is between neighbouring cameras, `focal_mm` from pinhole to film. The side of a pixel is
    `pixel_mm`, or follows from the width of the sensor, `sensor_mm`, and that of the pictures: one of the two
    is given. `shear_px` is that of `CameraGrid`. Raises `InputError` for both or neither.
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
        if self.pixel_mm is not None:
            return self.pixel_mm
        side = self.sensor_mm
        if isinstance(side, bool) or not isinstance(side, int | float) or not 0 < side < np.inf:
            raise InputError(f"sensor_mm: expected a finite length above 0 mm, got {side!r}")
        return side / width

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
    """Every other row was stored backwards, as a stage takes them that does not go back between rows."""
    swap_axes: bool = False
    """Rows and columns are exchanged: what is counted first are columns."""
    flip_rows: bool = False
    """Rows are counted from the bottom."""
    flip_cols: bool = False
    """Columns are counted from the right."""

    def arranged(self, views: np.ndarray) -> np.ndarray:
        """An array (A, B, ...) of views as they were stored, by camera: (K, L, ...).

        >>> ViewOrder(swap_axes=True, flip_rows=True).arranged(np.array([[1, 2, 3], [4, 5, 6]])).tolist()
        [[3, 6], [2, 5], [1, 4]]
        >>> ViewOrder(serpentine=True).arranged(np.array([[1, 2, 3], [4, 5, 6]])).tolist()
        [[1, 2, 3], [6, 5, 4]]
        """
        if self.serpentine:
            views = np.copy(views)
            views[1::2] = views[1::2, ::-1]
        if self.swap_axes:
            views = views.swapaxes(0, 1)
        return views[:: -1 if self.flip_rows else 1, :: -1 if self.flip_cols else 1]

    def numbers(self, rows: int, cols: int) -> np.ndarray:
        """Which stored view, counted along its table, each camera of a grid has: (K, L) int.

        >>> ViewOrder(swap_axes=True).numbers(2, 3).tolist()
        [[0, 2, 4], [1, 3, 5]]
        """
        stored = (cols, rows) if self.swap_axes else (rows, cols)
        return self.arranged(np.arange(rows * cols).reshape(stored))


AS_STORED = ViewOrder()
"""Rows from the top, columns from the left."""
