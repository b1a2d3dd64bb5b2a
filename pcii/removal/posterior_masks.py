"""Removal of defocused points by the network of depth, whose inputs include the requested planes.

The network (`pcii.depth.surface_network`) gives each block the probability that the surface seen there
belongs to an object in focus at each requested plane, or to none of them. A block belongs to the most
probable one. Nothing is claimed where the depth map has no answer.
"""

import numpy as np

from pcii.base.blocks import on_pixels
from pcii.depth.methods import check_search
from pcii.depth.posterior_depth import PosteriorDepth
from pcii.types.estimates import DepthPosterior, Segmented
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections


def remove_by_network(
    counts: PhotonCounts, sections: Sections, z_range_mm: tuple[float, float] | None = None
) -> Segmented:
    """In-focus masks (Z, H, W) of the sections; there may be surfaces in the range, or else around them.

    `steps` holds `probability` (Z, H, W) float32, that of belonging to the plane.
    """
    z_mm = sections.planes.z_mm
    check_search(counts.grid, "z_mm", np.append(z_mm, z_range_mm or ()))
    return masks_of(PosteriorDepth().posterior(counts, z_range_mm, z_mm), sections)


def masks_of(posterior: DepthPosterior, sections: Sections) -> Segmented:
    """In-focus masks of the sections, at whose planes the posterior was requested."""
    # A plane that is requested twice counts once.
    _, first_requests = np.unique(sections.planes.z_mm, return_index=True)
    out_of_focus = 1 - posterior.in_focus[first_requests].sum(axis=0)
    is_most_probable = posterior.in_focus >= np.maximum(posterior.in_focus.max(axis=0), out_of_focus)
    masks, probability = (
        on_pixels(blocks, posterior.block_px, posterior.planes.grid.shape_HW)
        for blocks in (is_most_probable & posterior.is_detected, posterior.in_focus)
    )
    steps, hot_pixels = {"probability": probability}, posterior.hot_pixels
    return Segmented(masks, "posterior", sections, steps, hot_pixels=hot_pixels)
