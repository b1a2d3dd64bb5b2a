"""Removal of defocused points by the posterior probability of depth (`pcii.depth.posterior_depth`).

A block is in focus at a plane if the surface is more probably near it than not: within half of the distance
to the next plane, in total disparity, so that a round object belongs to one plane as a whole, and at most
`within_px`. Nothing is claimed where the depth map has no answer.
"""

from dataclasses import dataclass, field

import numpy as np

from pcii.depth.posterior_depth import PosteriorDepth
from pcii.imaging.blocks import on_pixels
from pcii.removal.likelihood.likelihood_method import FOCUS_PX
from pcii.types.estimates import DepthPosterior, Segmented
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import depth_of_total_disparity_mm
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections


@dataclass(frozen=True)
class PosteriorMasks:
    """The method with its constants, beside those of depth."""

    depth: PosteriorDepth = field(default_factory=PosteriorDepth)
    within_px: float = FOCUS_PX
    """What is farther from a plane in total disparity has a blur half-extent above 5 px, and is defocused."""
    around_px: float = 20.0
    """Depths are compared so far beyond the planes, since what is defocused is to be found as well."""

    def __call__(self, counts: PhotonCounts, sections: Sections) -> Segmented:
        """In-focus masks (Z, H, W) of the sections.

        `steps` holds `probability` (Z, H, W) float32, that of a surface near the plane.
        """
        planes = sections.planes
        posterior, detected = self.depth.posterior_with_detection(counts, self.range_mm(planes), planes.z_mm)
        near = posterior.in_focus

        masks, probability = (
            on_pixels(blocks, posterior.block_px, counts.grid.shape_HW)
            for blocks in ((near > 0.5) & detected, near)
        )
        return Segmented(masks, "posterior", sections, {"probability": probability})

    def in_focus_probability(self, posterior: DepthPosterior, planes_px: np.ndarray) -> np.ndarray:
        """Probability (P, h, w) float32 of being in focus at planes of the total disparities (P,)."""
        near = in_focus_at(posterior.planes.total_disparity_px, planes_px, self.within_px)
        return np.tensordot(near.astype(np.float32), posterior.probability, axes=1)

    def range_mm(self, planes: FocalPlanes) -> tuple[float, float]:
        """Near and far ends of the depths around the planes; no less than half of the least disparity."""
        total_px = planes.total_disparity_px
        nearest_px = total_px.max() + self.around_px
        farthest_px = max(total_px.min() - self.around_px, total_px.min() / 2)
        near_mm, far_mm = depth_of_total_disparity_mm(planes.grid, np.array([nearest_px, farthest_px]))
        return float(near_mm), float(far_mm)


def in_focus_at(depths_px: np.ndarray, planes_px: np.ndarray, within_px: float) -> np.ndarray:
    """Whether surfaces at total disparities (Z,) are in focus at planes (P,): (P, Z) bool.

    They are at the nearest plane, if that is within `within_px`; planes may be alike.
    """
    own_px, which = np.unique(planes_px, return_inverse=True)
    half_px = np.diff(own_px, prepend=-np.inf, append=np.inf) / 2
    away_px = depths_px - own_px[:, None]
    farther_px, nearer_px = (np.minimum(half, within_px)[:, None] for half in (half_px[:-1], half_px[1:]))
    return ((-farther_px < away_px) & (away_px <= nearer_px))[which]
