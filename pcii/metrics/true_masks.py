"""What the truth says of sections: what is in focus, by object and by pixel, and regions of objects."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.types import CameraGrid, FocalPlanes, Truth, blur_half_extent_px

FOCUS_TOLERANCE_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""
OBJECT_REACH_PX, OBJECT_SHARE = 4.0, 0.9
"""Share of an object's visible surface that is within a blur half-extent of the plane that it belongs to.

With a shorter reach bulky things are not scored, with a longer one floors are. Of the 114 objects in the
scenes of the benchmark 96 belong to a plane; reaches of 3 and 6 px change none and 3 of them, shares of 0.95
and 0.8 none and 1."""

Kind = Literal["object", "pixel"]
KINDS: tuple[Kind, ...] = ("object", "pixel")


@dataclass(frozen=True, eq=False)
class TrueFocus:
    """What is in focus in sections at `planes`; each map is made once, when it is first read."""

    planes: FocalPlanes
    truth: Truth

    @cached_property
    def plane_of(self) -> dict[int, int]:
        """Index of the plane to which each visible object belongs, by object id.

        Of the planes it is that at which the object's visible surface has the least mean blur, if
        `OBJECT_SHARE` of the surface has a blur half-extent of at most `OBJECT_REACH_PX` there. Objects that
        lean through the depths, or are far from all planes, belong to none, and neither do those that count
        in no score.
        """
        plane_of: dict[int, int] = {}
        for number in sorted(set(self.truth.names) - self.truth.unscored):
            blur = self.blur_px[:, self.truth.object_id == number]
            if blur.size:
                nearest = int(blur.mean(axis=1).argmin())
                if (blur[nearest] <= OBJECT_REACH_PX).mean() >= OBJECT_SHARE:
                    plane_of[number] = nearest
        return plane_of

    @cached_property
    def by_object(self) -> np.ndarray:
        """Truth by object: (Z, H, W) bool, the pixels of the objects that belong to each plane."""
        masks = np.zeros(self.blur_px.shape, dtype=bool)
        for number, plane in self.plane_of.items():
            masks[plane] |= self.truth.object_id == number
        return masks

    @cached_property
    def by_pixel(self) -> np.ndarray:
        """Truth by pixel: (Z, H, W) bool, points whose blur half-extent is at most the tolerance."""
        return (self.blur_px <= FOCUS_TOLERANCE_PX) & ~self.truth.is_unscored

    def masks(self, kind: Kind) -> np.ndarray:
        """The truth of this kind, (Z, H, W) bool."""
        return self.by_object if kind == "object" else self.by_pixel

    def is_free(self, kind: Kind, object_id: np.ndarray, blur_px: np.ndarray) -> np.ndarray:
        """Which points may be claimed and need not be, bool; of their objects and their blur at a plane.

        Those of objects that count in no score; by object also points of objects that belong to no plane,
        where their blur half-extent is at most `OBJECT_REACH_PX`.
        """
        is_unscored = np.isin(object_id, [*self.truth.unscored])
        if kind == "pixel":
            return is_unscored
        is_planeless = ~np.isin(object_id, [0, *self.plane_of])
        return is_unscored | (is_planeless & (blur_px <= OBJECT_REACH_PX))

    @cached_property
    def blur_px(self) -> np.ndarray:
        """Blur half-extent (Z, H, W) of every point at every plane."""
        grid = self.planes.grid
        return np.stack([blur_half_extent_px(grid, self.truth.z_mm, z) for z in self.planes.z_mm])


def entropy_region(grid: CameraGrid, truth: Truth, number: int, z_mm: np.ndarray) -> np.ndarray:
    """Region (H, W) bool of an object for Table 1: where it is seen, and its blur at any of the planes."""
    from scipy.ndimage import distance_transform_cdt

    mask = truth.object_id == number
    if not mask.any():
        return mask
    blur = max(float(blur_half_extent_px(grid, truth.z_mm[mask], z).mean()) for z in z_mm)
    # What as many dilations by the four neighbours would reach, in one pass.
    distance_px = np.asarray(distance_transform_cdt(~mask, metric="taxicab"))
    return distance_px <= max(1, round(2 * blur))
