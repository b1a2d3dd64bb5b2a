"""Elemental images: the radiance of every view."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pcii.base.errors import InputError
from pcii.base.short_form import ShortForm, times
from pcii.types.arrays import check_unmasked, read_only
from pcii.types.bayer import check_cfa, colours_and_samples
from pcii.types.camera_grid import CameraGrid, check_camera, middle_camera

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class ArrayLike5D(Protocol):
    """What `Views` reads of an array: its shape and one view at a time, so that views may stay on disk."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, index: Any, /) -> Any: ...


@dataclass(frozen=True, eq=False, repr=False)
class Views(ShortForm):
    """Linear radiance of every elemental image, (K, L, H, W, C), C = 1 or 3.

    `cfa` names the Bayer pattern when C = 1 and the images are mosaics; None means that every pixel
    holds all C channels. Numbers are proportional to light: 8-bit and 16-bit whole numbers are refused, since
    those of pictures are nearly always sRGB (`pcii.srgb_to_linear`, `pcii.import_images`). `radiance` may be
    any object with `shape` and `[k, l]` (an array, or a reader that loads one view at a time).
    Raises `InputError` for another shape or an unknown pattern.

    >>> grid = CameraGrid(
    ...     rows=1, cols=2, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=4, width=6
    ... )
    >>> Views(np.ones((1, 2, 4, 6, 3)), grid)
    Views(shape=1 x 2 x 4 x 6 x 3)
    """

    radiance: ArrayLike5D
    grid: CameraGrid
    cfa: str | None = None

    def __post_init__(self) -> None:
        check_cfa(self.cfa)
        shape = tuple(self.radiance.shape)
        if len(shape) != 5 or shape[:4] != self.grid.shape_KLHW or shape[4] not in (1, 3):
            raise InputError(f"radiance: expected shape {(*self.grid.shape_KLHW, '1 or 3')}, got {shape}")
        if self.cfa is not None and shape[4] != 1:
            raise InputError("radiance: a Bayer mosaic has one channel per pixel, C = 1")
        if isinstance(self.radiance, np.ndarray):
            dtype = self.radiance.dtype
            if dtype.kind not in "fiu":
                raise InputError(f"radiance: expected real numbers, got {dtype}")
            check_unmasked("radiance", self.radiance)
            if dtype.newbyteorder("=") in (np.uint8, np.uint16):
                remedy = "decode it by pcii.srgb_to_linear, or give linear values as float32"
                raise InputError(f"radiance: {dtype} of pictures is sRGB, not light; {remedy}")
            object.__setattr__(self, "radiance", read_only(self.radiance))

    def _facts(self) -> dict[str, object]:
        return {"shape": times(self.radiance.shape), "cfa": self.cfa}

    @property
    def channel_count(self) -> int:
        """Number of colours of sections of these views."""
        return 3 if self.cfa is not None else self.radiance.shape[4]

    def plot(self, axes: "Axes | None" = None, *, view: tuple[int, int] | None = None) -> np.ndarray:
        """Draw the elemental image of the camera `view`, (k, l), in colours; return the Matplotlib axes (1,).

        The default is the camera in the middle. The 98th percentile of what is lit is white. A mosaic's
        pixels take the colours that they lack from those around. `axes` are by default those of a new figure.
        Raises `InputError` for a camera outside the grid, or NaN or infinity.
        """
        from pcii.figures.plots import plot_view

        k, l = check_camera(self.grid, middle_camera(self.grid) if view is None else view)
        return plot_view(axes, colours_and_samples(self.view(k, l), self.cfa), f"view ({k}, {l})")

    def view(self, k: int, l: int) -> np.ndarray:
        """Image (H, W, C) of camera (k, l); raises `InputError` if it contains NaN or infinity."""
        image = np.asarray(self.radiance[k, l])
        if not np.all(np.isfinite(image)):
            raise InputError(f"radiance: view ({k}, {l}) holds NaN or infinity")
        return image


@dataclass(frozen=True)
class _Scaled:
    """Radiance divided by `scale`, one view at a time."""

    radiance: ArrayLike5D
    scale: float

    @property
    def shape(self) -> tuple[int, ...]:
        return self.radiance.shape

    def __getitem__(self, index: Any, /) -> np.ndarray:
        return np.asarray(self.radiance[index], dtype=np.float64) / self.scale


def in_binary_unit(views: Views) -> Views:
    """The same views in the unit `binary_scale`, in double precision where that is not 1."""
    scale = binary_scale(views)
    return views if scale == 1 else replace(views, radiance=_Scaled(views.radiance, scale))


def binary_scale(views: Views) -> float:
    """The power of two nearest above the light of the middle view, or 1 if that is within 2^-20 .. 2^20.

    Methods whose result does not depend on the unit of radiance divide by it, which is exact, so that squares
    neither overflow nor vanish.
    """
    middle = views.view(views.grid.rows // 2, views.grid.cols // 2)
    exponent = int(np.frexp(max(abs(float(middle.max())), abs(float(middle.min()))))[1])
    return 1.0 if abs(exponent) <= 20 else 2.0 ** min(exponent, 1023)
