"""Depth maps: where does the light say that the surface is, and how sure is that?"""

from collections.abc import Sequence

import numpy as np

from pcii.base.errors import InputError
from pcii.core.arrays import check_z_mm
from pcii.core.estimates import DepthMap
from pcii.core.focal_planes import FocalPlanes
from pcii.core.geometry import depth_of_total_disparity_mm, total_disparity_px
from pcii.core.photon_counts import PhotonCounts, check_depth_counts
from pcii.evidence.cells import CELL_PX
from pcii.evidence.focus_likelihood import Focus, best_labels, focus_evidence, windowed
from pcii.evidence.half_agreement import halves_of, least_agreement
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.sections.photon_statistics import cells_to_pixels

PLANE_STEP_PX = 2.0
"""Planes differ by so much in total disparity: 1 px of blur."""
MOST_PLANES = 1000
STEP_NATS, JUMP_NATS = 0.002, 0.08
"""What a change of depth from cell to cell must earn, per plane and at most; less than between objects."""
SIGNIFICANT_NATS = 20.0
"""Evidence that noise makes of nothing exceeds this seldom; a window counts it several times."""
FEWEST_PHOTONS = 10.0
NEARBY_CELLS = 1.0
"""Fewer photons than this within about 10 px of a point: its neighbours' depth is not its own."""
NEIGHBOURS = 2
"""Planes on either side of the best whose likelihood counts for it: about the focus depth."""
LEAST_CONFIDENCE = 0.5


def estimate_depth(counts: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
    """Depth per pixel, (H, W) float64 in mm within `z_range_mm`, NaN where the method abstains.

    Planes of equal disparity steps are compared by how well each predicts where photons land, over windows
    that stop at edges (`pcii.evidence.focus_likelihood`); neighbours agree unless it costs too much; between
    planes a parabola is fitted. `confidence` (H, W) is the posterior probability, all planes being equally
    likely beforehand, that the depth lies within 2 planes of the best. Below one half, or where there are
    next to no photons or nothing to be seen, the method abstains. It also abstains where two halves of the
    cameras do not see the same (`pcii.evidence.half_agreement`): in images of uniform light, at any photon
    level, at most 1 pixel in 1000 gets a depth. Pixels that are hot in most views are ignored
    (`pcii.evidence.hot_pixels`).

    Raises `InputError` for a range that is not 0 < near < far, or a single view.
    """
    if not isinstance(z_range_mm, Sequence) or len(z_range_mm) != 2:
        raise InputError(f"z_range_mm: expected (near, far), got {z_range_mm!r}")
    near, far = check_z_mm(z_range_mm)
    check_depth_counts(counts)
    if near >= far:
        raise InputError(f"z_range_mm: near must be less than far, got {near:g} and {far:g}")
    grid = counts.grid
    span = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    if span > MOST_PLANES * PLANE_STEP_PX:
        raise InputError(
            f"z_range_mm: from {near:g} to {far:g} mm total disparity changes by {span:.3g} px, and at "
            f"most {MOST_PLANES * PLANE_STEP_PX:g} px can be searched; choose a farther near end"
        )
    planes = FocalPlanes.between(grid, near, far, PLANE_STEP_PX)
    counts = without_hot_pixels(counts)
    focus = focus_evidence(counts, planes)
    evidence = windowed(focus.gain, focus.photons)
    best = best_labels(evidence, np.full(len(planes) - 1, STEP_NATS), JUMP_NATS)
    refined_px = _refined(planes.total_disparity_px, evidence, best)
    depth = np.clip(depth_of_total_disparity_mm(grid, refined_px), near, far)
    confidence = _posterior_near(evidence, best)
    at_best = np.take_along_axis(evidence, best[None], axis=0)[0]
    photons = _photons_nearby(focus, best)
    abstains = (at_best < SIGNIFICANT_NATS) | (photons < FEWEST_PHOTONS)
    abstains |= confidence < LEAST_CONFIDENCE
    halves = halves_of(counts, planes)
    abstains |= halves.agreement(best, ~abstains) < least_agreement(halves.planes)
    depth = np.where(abstains, np.nan, depth)
    confidence = np.where(abstains, 0.0, confidence)
    return DepthMap(cells_to_pixels(depth, CELL_PX, grid), cells_to_pixels(confidence, CELL_PX, grid))


def _photons_nearby(focus: Focus, best: np.ndarray) -> np.ndarray:
    """Photons of all colours in a Gaussian window (weight 1 at its centre) in the plane that is best."""
    from scipy.ndimage import gaussian_filter

    here = np.take_along_axis(focus.photons.sum(axis=1), best[None], axis=0)[0]
    return 2 * np.pi * NEARBY_CELLS**2 * gaussian_filter(here, NEARBY_CELLS, mode="constant")


def _refined(total_px: np.ndarray, evidence: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Total disparity at the top of a parabola through the best plane and its neighbours."""
    if total_px.size < 3:
        return total_px[best]
    inner = np.clip(best, 1, total_px.size - 2)
    before, at, after = (np.take_along_axis(evidence, (inner + s)[None], axis=0)[0] for s in (-1, 0, 1))
    curvature = before - 2 * at + after
    offset = np.where(curvature < 0, (before - after) / (2 * np.where(curvature < 0, curvature, 1)), 0)
    offset = np.where(best == inner, np.clip(offset, -0.5, 0.5), 0.0)
    return total_px[best] + offset * (total_px[1] - total_px[0])


def _posterior_near(evidence: np.ndarray, best: np.ndarray) -> np.ndarray:
    weight = np.exp(evidence - evidence.max(axis=0))
    plane = np.arange(evidence.shape[0])[:, None, None]
    return (weight * (np.abs(plane - best) <= NEIGHBOURS)).sum(axis=0) / weight.sum(axis=0)
