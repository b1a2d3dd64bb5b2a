"""Ground truth of a dataset: depth, objects and surfaces, and the origin of each photon."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pcii.base import InputError, listed, span, times
from pcii.types.arrays import Plottable, freeze_array

OPTIONAL_MAPS = ("normal", "coverage", "visible_views")
"""Maps that a dataset may lack."""


@dataclass(frozen=True, repr=False)
class PhotonTruth:
    """Origin of each detected photon: six arrays (N,).

    Camera (k, l), pixel (i, j), and the `object_id` and planar `z_mm` of the first surface on its path.
    """

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    object_id: np.ndarray
    z_mm: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Truth(Plottable):
    """Surfaces in the image of the virtual centre camera, from first hits of rays through pixel centres.

    `z_mm` (H, W) is planar depth, +inf where nothing was hit; `object_id` (H, W) is 0 for the
    backdrop and for nothing, else a key of `names`. `photons` is known for simulated photons only.
    `unscored` are the numbers of objects that count in no score. If `are_objects_known` is False, depth is
    known and objects are not, so that masks are compared by pixel alone.

    The other maps are None where the dataset lacks them. `normal` (H, W, 3) float32: unit normal of the
    surface in world axes, towards the camera; 0 where nothing is hit. `coverage` (H, W) float32: the share
    of the pixel's square that belongs to the object (or to none) that its centre hits. `visible_views`
    (H, W) uint16: how many cameras of the grid see the point; 0 where nothing is hit.
    """

    z_mm: np.ndarray
    object_id: np.ndarray
    names: Mapping[int, str]
    photons: PhotonTruth | None = None
    normal: np.ndarray | None = None
    coverage: np.ndarray | None = None
    visible_views: np.ndarray | None = None
    unscored: frozenset[int] = frozenset()
    are_objects_known: bool = True

    def __post_init__(self) -> None:
        freeze_array(self, "z_mm", "real numbers", ("H", "W"))
        shape = self.z_mm.shape
        freeze_array(self, "object_id", "real numbers", shape)
        if not (self.z_mm > 0).all():
            raise InputError("z_mm: true depths are above 0 mm and never NaN; a miss is +inf")
        unknown = set(np.unique(self.object_id).tolist()) - {0, *self.names}
        if unknown:
            raise InputError(f"object_id: id {min(unknown)} has no name")
        if nameless := set(self.unscored) - set(self.names):
            raise InputError(f"unscored: there is no object with the number {min(nameless)}")
        if self.visible_views is not None:
            freeze_array(self, "visible_views", "uint16", shape)
        for name, lowest, last_axes in (("normal", -1, (3,)), ("coverage", 0, ())):
            values = getattr(self, name)
            if values is not None:
                freeze_array(self, name, "float32", (*shape, *last_axes))
                if not ((values >= lowest - 1e-6) & (values <= 1 + 1e-6)).all():  # they may be rounded
                    raise InputError(f"{name}: expected values from {lowest} to 1")

    def _facts(self) -> dict[str, object]:
        hit = self.z_mm[np.isfinite(self.z_mm)]
        photons = None if self.photons is None else self.photons.z_mm.size
        objects = listed(list(self.names.values()))
        return {"shape": times(self.z_mm.shape), "z_mm": span(hit), "photons": photons, "objects": objects}

    @property
    def mask_kind(self) -> Literal["object", "pixel"]:
        """Which true masks others are compared with first: those of objects, if these are known."""
        return "object" if self.are_objects_known else "pixel"

    @property
    def has_objects(self) -> bool:
        """Whether a pixel shows an object that is scored."""
        return bool(((self.object_id > 0) & ~self.is_unscored).any())

    @property
    def is_unscored(self) -> np.ndarray:
        """Pixels (H, W) bool of the objects that count in no score."""
        return np.isin(self.object_id, [*self.unscored])

    @property
    def object_z_mm(self) -> np.ndarray:
        """Depth of the objects that are scored (H, W) in mm, +inf elsewhere; of all but those that are not
        scored, if no other is known."""
        is_meant = ~self.is_unscored
        if self.has_objects:
            is_meant &= self.object_id > 0
        return np.where(is_meant, self.z_mm, np.inf)
