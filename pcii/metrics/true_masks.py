"""True in-focus masks of sections, by object and by pixel."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.geometry import blur_half_extent_px
from pcii.core.truth import Truth

FOCUS_TOLERANCE_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""

Kind = Literal["object", "pixel"]
KINDS: tuple[Kind, ...] = ("object", "pixel")


@dataclass(frozen=True, eq=False)
class TrueFocus:
    """What is in focus in sections at the depths `z_mm` (Z,); each map is made once, when it is asked for."""

    grid: CameraGrid
    truth: Truth
    z_mm: np.ndarray

    @cached_property
    def plane_of(self) -> dict[int, int]:
        """Plane (index into `z_mm`) to which each visible object belongs, by object id.

        The closest plane is the one at which the object's visible surface has the least mean blur.
        """
        plane_of: dict[int, int] = {}
        for number in self.truth.names:
            surface = self.truth.z_mm[self.truth.object_id == number]
            if surface.size:
                blur = [blur_half_extent_px(self.grid, surface, z).mean() for z in self.z_mm]
                plane_of[number] = int(np.argmin(blur))
        return plane_of

    @cached_property
    def by_object(self) -> np.ndarray:
        """Truth by object: (Z, H, W) bool, the pixels of the objects that belong to each plane."""
        masks = np.zeros((len(self.z_mm), *self.truth.z_mm.shape), dtype=bool)
        for number, plane in self.plane_of.items():
            masks[plane] |= self.truth.object_id == number
        return masks

    @cached_property
    def by_pixel(self) -> np.ndarray:
        """Truth by pixel: (Z, H, W) bool, points whose blur half-extent is at most the tolerance."""
        return self._blur_px <= FOCUS_TOLERANCE_PX

    def masks(self, kind: Kind) -> np.ndarray:
        """The truth by this kind."""
        return self.by_object if kind == "object" else self.by_pixel

    def oracle(self, kind: Kind) -> np.ndarray:
        """What who knows each pixel's depth and nothing else claims, (Z, H, W) bool: see `bounds.oracle`."""
        nearest = self._blur_px.argmin(axis=0) == np.arange(len(self.z_mm))[:, None, None]
        return nearest & (self.truth.object_id > 0 if kind == "object" else self.by_pixel)

    @cached_property
    def _blur_px(self) -> np.ndarray:
        """Blur half-extent (Z, H, W) of every point at every plane."""
        return np.stack([blur_half_extent_px(self.grid, self.truth.z_mm, z) for z in self.z_mm])
