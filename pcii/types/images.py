"""Elemental images: the radiance of every view."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pcii.base import InputError, times
from pcii.types.arrays import Plottable, read_only
from pcii.types.bayer import check_cfa, colours_and_samples
from pcii.types.camera_grid import CameraGrid


class ArrayLike5D(Protocol):
    """What `Views` reads of an array: its shape and one view at a time, so that views may stay on disk."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, index: Any, /) -> Any: ...


@dataclass(frozen=True, eq=False, repr=False)
class Views(Plottable):
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
            if dtype.newbyteorder("=") in (np.uint8, np.uint16):
                raise InputError(f"radiance: {dtype} is sRGB of pictures; decode it by pcii.srgb_to_linear")
            object.__setattr__(self, "radiance", read_only(self.radiance))

    def _facts(self) -> dict[str, object]:
        return {"shape": times(self.radiance.shape), "cfa": self.cfa}

    @property
    def channel_count(self) -> int:
        """Number of colours of sections of these views."""
        return 3 if self.cfa is not None else self.radiance.shape[4]

    def in_colours(self, k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        """Light and numbers of samples of camera (k, l), (H, W, C) each, in the colours of the pixels."""
        return colours_and_samples(self.view(k, l), self.cfa)

    def view(self, k: int, l: int) -> np.ndarray:
        """Image (H, W, C) of camera (k, l); `InputError` for no camera of the grid, NaN or infinity."""
        self.grid.check_camera(k, l)
        image = np.asarray(self.radiance[k, l])
        if not np.all(np.isfinite(image)):
            raise InputError(f"radiance: view ({k}, {l}) holds NaN or infinity")
        return image


def binary_scale(views: Views) -> float:
    """The power of two nearest above the light of the middle view, or 1 if that is within 2^-20 .. 2^20.

    Methods whose result does not depend on the unit of radiance divide by it, which is exact, so that squares
    neither overflow nor vanish.
    """
    middle = views.view(*views.grid.middle_camera)
    exponent = int(np.frexp(max(abs(float(middle.max())), abs(float(middle.min()))))[1])
    return 1.0 if abs(exponent) <= 20 else 2.0 ** min(exponent, 1023)
