"""The grid of cameras: positions and intrinsic parameters."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from pcii.base.errors import InputError
from pcii.base.short_form import ShortForm
from pcii.types.arrays import is_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _is_finite(value: object) -> TypeGuard[float]:
    number = isinstance(value, int | float | np.integer | np.floating)
    return number and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, kw_only=True)
class CameraGrid(ShortForm):
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
        values: dict[str, object] = {}
        for name in ("rows", "cols", "height", "width"):
            size = values[name] = getattr(self, name)
            if not is_whole(size) or size < 1:
                raise InputError(f"{name}: expected a whole number of at least 1, got {size!r}")
            values[name] = int(size)
        for name in ("focal_mm", "pixel_mm"):
            length = getattr(self, name)
            if not (_is_finite(length) and length > 0):
                raise InputError(f"{name}: expected a finite length above 0 mm, got {length!r}")
            # Small types of NumPy would overflow in products.
            values[name] = float(length) if isinstance(length, np.generic) else length
        for name, least, words in (
            ("pitch_mm", 0.0, "lengths (x, y) above 0 mm"),
            ("shear_px", -math.inf, "numbers (x, y) of pixels"),
        ):
            pair = getattr(self, name)
            is_pair = isinstance(pair, tuple | list) and len(pair) == 2
            if not is_pair or not all(_is_finite(value) and value > least for value in pair):
                raise InputError(f"{name}: expected two finite {words}, got {pair!r}")
            values[name] = (float(pair[0]), float(pair[1]))
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def baseline_mm(self) -> tuple[float, float]:
        """Distance of the first and the last camera in mm, (x, y); 0 where there is one."""
        return (self.cols - 1) * self.pitch_mm[0], (self.rows - 1) * self.pitch_mm[1]

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

    def plot(self, axes: "Axes | None" = None) -> np.ndarray:
        """Draw where the cameras stand, in mm, with both baselines; return the Matplotlib axes (1,).

        `axes` are by default those of a new figure. Raises `InputError` if they are no Matplotlib axes.
        """
        from pcii.figures.plots import plot_cameras

        return plot_cameras(axes, self.rows, self.cols, self.pitch_mm)


def middle_camera(grid: CameraGrid) -> tuple[int, int]:
    """The camera (k, l) in the middle, of an even number the one after it."""
    return grid.rows // 2, grid.cols // 2


def check_camera(grid: CameraGrid, view: object) -> tuple[int, int]:
    """The camera (k, l) of `view`; raises `InputError` for anything but a camera of the grid."""
    if not (isinstance(view, tuple | list) and len(view) == 2 and all(map(is_whole, view))):
        raise InputError(f"view: expected a camera (k, l), got {view!r}")
    k, l = map(int, view)
    if not (0 <= k < grid.rows and 0 <= l < grid.cols):
        raise InputError(f"view: there is no camera ({k}, {l}) in a grid of {grid.rows} x {grid.cols}")
    return k, l


def chosen_cameras(grid: CameraGrid, cameras: object) -> tuple[range, range]:
    """Rows and columns of the cameras that an index [k, l] chooses, each by a number or a slice.

    Raises `InputError` for another index, a camera outside the grid, none, or a step that is not above 0.
    """
    if not (isinstance(cameras, tuple) and len(cameras) == 2):
        raise InputError(f"cameras: expected two numbers or slices [k, l], got {cameras!r}")
    return _range_of("k", cameras[0], grid.rows), _range_of("l", cameras[1], grid.cols)


def _range_of(name: str, index: object, count: int) -> range:
    if isinstance(index, slice):
        cameras = range(count)[index]
        if cameras.step < 1 or not cameras:
            raise InputError(f"{name}: a slice must choose cameras of 0 .. {count - 1} in their order")
        return cameras
    if not is_whole(index) or not -count <= index < count:
        raise InputError(f"{name}: expected a camera of 0 .. {count - 1}, or a slice, got {index!r}")
    return range(count)[index : index + 1 or None]


def grid_of(grid: CameraGrid, rows: range, cols: range) -> CameraGrid:
    """The grid of some rows and columns of cameras, whose own centre is its virtual centre.

    Raises `InputError` if the grid is sheared and they do not lie symmetrically in it: their images would
    have to move.
    """
    for name, cameras, count, shear_px in (
        ("k", rows, grid.rows, grid.shear_px[1]),
        ("l", cols, grid.cols, grid.shear_px[0]),
    ):
        if shear_px and cameras[0] + cameras[-1] != count - 1:
            raise InputError(f"{name}: cameras of a sheared grid must lie symmetrically around its middle")
    (pitch_x, pitch_y), (shear_x, shear_y) = grid.pitch_mm, grid.shear_px
    return replace(
        grid,
        rows=len(rows),
        cols=len(cols),
        pitch_mm=(pitch_x * cols.step, pitch_y * rows.step),
        shear_px=(shear_x * cols.step, shear_y * rows.step),
    )
