"""Depth by focus evidence: a plane for each cell, with a cost of changes, and its posterior probability."""

import numpy as np

from pcii.depth.depth_planes import neighbours_of, peak_depth_mm
from pcii.evidence.cells import CELL_PX
from pcii.evidence.focus_likelihood import FocusEvidence, best_labels, focus_evidence, windowed
from pcii.evidence.half_agreement import halves_of
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.imaging.blocks import on_pixels
from pcii.types.estimates import DepthMap
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

PLANE_STEP_PX = 2.0
"""Total disparity between neighbouring planes: a blur half-extent of 1 px."""
STEP_NATS, JUMP_NATS = 0.002, 0.08
"""Cost of a change of depth between cells in nats per px of outline, per plane and at most."""
SIGNIFICANT_NATS = 20.0
"""Least windowed evidence of an answer; noise alone rarely has so much, though windows count it several
times."""
FEWEST_PHOTONS = 10.0
NEARBY_CELLS = 1.0
"""With fewer photons in a window of this standard deviation, about 10 px wide, there is no answer: the depth
would be that of neighbouring cells."""
NEIGHBOURS = 2
"""Planes on either side of the best that confidence includes: about the depth of focus."""
LEAST_CONFIDENCE = 0.5


def focus_depth(counts: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
    """Depth by the focus evidence of planes, over windows that stop at edges.

    Planes 2 px of total disparity apart are compared by how well each predicts the photons
    (`pcii.evidence.focus_likelihood`); changes between neighbouring cells have a cost; a parabola is fitted
    between planes. `confidence` is the posterior probability, under a uniform prior over the planes, that
    the depth lies within 2 planes of the best. The method abstains where it is below one half, where there
    are too few photons or too little evidence, and where two halves of the cameras do not agree
    (`pcii.evidence.half_agreement`): in images of uniform light, at any photon level, at most 1 pixel in 1000
    gets a depth. Pixels that are hot in most views are ignored (`pcii.evidence.hot_pixels`).
    """
    grid = counts.grid
    planes = FocalPlanes.between(grid, *z_range_mm, PLANE_STEP_PX)
    counts = without_hot_pixels(counts)
    evidence = focus_evidence(counts, planes)
    gain = windowed(evidence.gain, evidence.photons)
    best = best_labels(gain, np.full(len(planes) - 1, STEP_NATS), JUMP_NATS)
    nearby = neighbours_of(gain, best)
    depth, best_gain = peak_depth_mm(planes, best, nearby), nearby[1]
    confidence = _posterior_near(gain, best)
    photons = _photons_nearby(evidence, best)
    abstains = (best_gain < SIGNIFICANT_NATS) | (photons < FEWEST_PHOTONS)
    abstains |= confidence < LEAST_CONFIDENCE
    abstains |= ~halves_of(counts, planes, out_of_focus=True).agree(best, ~abstains)
    depth = np.where(abstains, np.nan, depth)
    confidence = np.where(abstains, 0.0, confidence)
    return DepthMap(*(on_pixels(part, CELL_PX, grid.shape_HW) for part in (depth, confidence)))


def _photons_nearby(evidence: FocusEvidence, best: np.ndarray) -> np.ndarray:
    """Photons (h, w) of all colours in a Gaussian window, of weight 1 at its centre, at the best plane."""
    from scipy.ndimage import gaussian_filter

    photons = np.take_along_axis(evidence.photons.sum(axis=1), best[None], axis=0)[0]
    return 2 * np.pi * NEARBY_CELLS**2 * gaussian_filter(photons, NEARBY_CELLS, mode="constant")


def _posterior_near(gain: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Posterior probability (h, w) that the depth is within `NEIGHBOURS` planes of the best."""
    weight = np.exp(gain - gain.max(axis=0))
    plane = np.arange(gain.shape[0])[:, None, None]
    return (weight * (np.abs(plane - best) <= NEIGHBOURS)).sum(axis=0) / weight.sum(axis=0)
