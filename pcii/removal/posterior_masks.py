"""Removal of defocused points by the network of depth, whose inputs include the requested planes.

The network (`pcii.depth.surface_network`) gives each block the probability that the surface seen there
belongs to an object in focus at each requested plane, or to none of them. A block belongs to the most
probable one. Nothing is claimed where the depth map has no answer.
"""

import numpy as np

from pcii.depth.posterior_depth import PosteriorDepth
from pcii.imaging.blocks import on_pixels
from pcii.types.estimates import DepthPosterior, Segmented
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import depth_of_total_disparity_mm
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

AROUND_PX = 20.0
"""Depths are compared so far beyond the requested planes in total disparity: what is defocused is to be found
as well."""


def remove_by_network(counts: PhotonCounts, sections: Sections) -> Segmented:
    """In-focus masks (Z, H, W) of the sections.

    `steps` holds `probability` (Z, H, W) float32, that of belonging to the plane.
    """
    planes = sections.planes
    return masks_of(PosteriorDepth().posterior(counts, range_around_mm(planes), planes.z_mm), sections)


def masks_of(posterior: DepthPosterior, sections: Sections) -> Segmented:
    """In-focus masks of the sections, at whose planes the posterior was requested."""
    none = 1 - posterior.in_focus.sum(axis=0)
    label = np.concatenate([posterior.in_focus, none[None]]).argmax(axis=0)
    is_own = label == np.arange(len(posterior.in_focus))[:, None, None]
    masks, probability = (
        on_pixels(blocks, posterior.block_px, posterior.planes.grid.shape_HW)
        for blocks in (is_own & posterior.is_detected, posterior.in_focus)
    )
    return Segmented(masks, "posterior", sections, {"probability": probability})


def range_around_mm(planes: FocalPlanes) -> tuple[float, float]:
    """Near and far ends of the depths around the planes; no less than half of the least disparity."""
    total_px = planes.total_disparity_px
    nearest_px = total_px.max() + AROUND_PX
    farthest_px = max(total_px.min() - AROUND_PX, total_px.min() / 2)
    near_mm, far_mm = depth_of_total_disparity_mm(planes.grid, np.array([nearest_px, farthest_px]))
    return float(near_mm), float(far_mm)
