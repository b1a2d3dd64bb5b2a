"""The grid of cameras: positions and intrinsic parameters."""

import math
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from pcii.base import InputError
from pcii.types.arrays import is_whole


def _is_finite(value: object) -> TypeGuard[float]:
    number = isinstance(value, int | float | np.integer | np.floating)
    return number and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, kw_only=True)
class CameraGrid:
    """A grid of `rows` x `cols` parallel pinhole cameras in the plane Z = 0, looking along +Z.

    Camera (k, l), k from the top, l from the left, stands at X = (l - (cols-1)/2) pitch_x,
    Y = (k - (rows-1)/2) pitch_y. `pitch_mm` is (pitch_x, pitch_y). Each image has `height` x `width`
    square pixels of `pixel_mm`, `focal_mm` behind the pinhole; the optical axis meets pixel
    ((height-1)/2, (width-1)/2). In a sheared grid `shear_px` (x, y) is not 0: each camera's axis meets it
    further right (down) by so many px per camera step, counted from the centre of the grid, so that a point
    whose parallax equals the shear appears at the same pixel of all views. Raises `InputError` for a size
    below 1, a length not above 0 or a shear that is not finite.

    >>> grid = CameraGrid(
    ...     rows=10, cols=10, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.0352, height=1024, width=1024
    ... )
    >>> grid.view_count, grid.shape_KLHW
    (100, (10, 10, 1024, 1024))
    """

    rows: int
    cols: int
    pitch_mm: tuple[float, float]
    focal_mm: float
    pixel_mm: float
    height: int
    width: int
    shear_px: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("rows", "cols", "height", "width"):
            size = getattr(self, name)
            if not is_whole(size) or size < 1:
                raise InputError(f"{name}: expected a whole number of at least 1, got {size!r}")
            object.__setattr__(self, name, int(size))
        for name in ("focal_mm", "pixel_mm"):
            length = getattr(self, name)
            if not (_is_finite(length) and length > 0):
                raise InputError(f"{name}: expected a finite length above 0 mm, got {length!r}")
            if isinstance(length, np.generic):  # small types of NumPy would overflow in products
                object.__setattr__(self, name, float(length))
        for name, least, words in (
            ("pitch_mm", 0.0, "lengths (x, y) above 0 mm"),
            ("shear_px", -math.inf, "numbers (x, y) of pixels"),
        ):
            pair = getattr(self, name)
            is_pair = isinstance(pair, tuple | list) and len(pair) == 2
            if not is_pair or not all(_is_finite(value) and value > least for value in pair):
                raise InputError(f"{name}: expected two finite {words}, got {pair!r}")
            object.__setattr__(self, name, (float(pair[0]), float(pair[1])))

    @property
    def view_count(self) -> int:
        """Number of cameras, rows x cols."""
        return self.rows * self.cols

    @property
    def shape_KLHW(self) -> tuple[int, int, int, int]:
        """Shape (K, L, H, W) of one monochrome stack of views."""
        return (self.rows, self.cols, self.height, self.width)

    @property
    def shape_HW(self) -> tuple[int, int]:
        """Shape (H, W) of one view, and of a section."""
        return (self.height, self.width)

    @property
    def middle_camera(self) -> tuple[int, int]:
        """The camera (k, l) in the middle, of an even number the one after it."""
        return self.rows // 2, self.cols // 2

    def check_camera(self, k: object, l: object) -> None:
        """Raise `InputError` for anything but a camera (k, l) of the grid."""
        if not (is_whole(k) and is_whole(l) and 0 <= k < self.rows and 0 <= l < self.cols):
            raise InputError(f"view: expected a camera (k, l) of {self.rows} x {self.cols}, got ({k}, {l})")
