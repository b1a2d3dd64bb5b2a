"""True in-focus masks of sections, by object and by pixel."""

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.geometry import blur_half_extent_px
from pcii.core.truth import Truth

FOCUS_TOLERANCE_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""


def objects_by_plane(grid: CameraGrid, truth: Truth, z_mm: np.ndarray) -> dict[int, int]:
    """Plane index (into `z_mm`) to which each visible object belongs, by object id.

    The closest plane is the one at which the object's visible surface has the least mean blur.
    """
    plane_of: dict[int, int] = {}
    for number in truth.names:
        surface = truth.z_mm[truth.object_id == number]
        if surface.size:
            blur = [blur_half_extent_px(grid, surface, z).mean() for z in z_mm]
            plane_of[number] = int(np.argmin(blur))
    return plane_of


def object_masks(grid: CameraGrid, truth: Truth, z_mm: np.ndarray) -> np.ndarray:
    """Truth by object: (Z, H, W) bool, the pixels of the objects that belong to each plane."""
    plane_of = objects_by_plane(grid, truth, z_mm)
    masks = np.zeros((len(z_mm), *truth.z_mm.shape), dtype=bool)
    for number, plane in plane_of.items():
        masks[plane] |= truth.object_id == number
    return masks


def pixel_masks(grid: CameraGrid, truth: Truth, z_mm: np.ndarray) -> np.ndarray:
    """Truth by pixel: (Z, H, W) bool, points whose blur half-extent is at most the tolerance."""
    return np.stack([blur_half_extent_px(grid, truth.z_mm, z) <= FOCUS_TOLERANCE_PX for z in z_mm])
