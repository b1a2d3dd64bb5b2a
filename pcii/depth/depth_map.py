"""Depth maps from the focus evidence of planes: a depth and its posterior probability for each pixel."""

from collections.abc import Sequence

import numpy as np

from pcii.base.errors import InputError
from pcii.core.arrays import check_z_mm
from pcii.core.estimates import DepthMap
from pcii.core.focal_planes import FocalPlanes
from pcii.core.geometry import depth_of_total_disparity_mm, total_disparity_px
from pcii.core.photon_counts import PhotonCounts, check_depth_counts
from pcii.evidence.cells import CELL_PX
from pcii.evidence.focus_likelihood import FocusEvidence, best_labels, focus_evidence, windowed
from pcii.evidence.half_agreement import halves_of, least_agreement
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.sections.photon_statistics import cells_to_pixels

PLANE_STEP_PX = 2.0
"""Total disparity between neighbouring planes: a blur half-extent of 1 px."""
MOST_PLANES = 1000
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


def estimate_depth(counts: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
    """Depth per pixel, (H, W) float64 in mm within `z_range_mm`, NaN where the method abstains.

    Planes 2 px of total disparity apart are compared by how well each predicts the photons, over windows that
    stop at edges (`pcii.evidence.focus_likelihood`); changes between neighbouring cells have a cost; a
    parabola is fitted between planes. `confidence` (H, W) float64 is the posterior probability, under a
    uniform prior over the planes, that the depth lies within 2 planes of the best. The method abstains where
    it is below one half, where there are too few photons or too little evidence, and where two halves of the
    cameras do not agree (`pcii.evidence.half_agreement`): in images of uniform light, at any photon level, at
    most 1 pixel in 1000 gets a depth. Pixels that are hot in most views are ignored
    (`pcii.evidence.hot_pixels`).

    Raises `InputError` for a range that is not 0 < near < far, or a single view.

    >>> import numpy as np
    >>> import pcii
    >>> grid = pcii.CameraGrid(
    ...     rows=2, cols=2, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25, height=16, width=16
    ... )
    >>> no_photons = pcii.PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, dtype=int), grid)
    >>> depth = estimate_depth(no_photons, z_range_mm=(450, 750))
    >>> depth.z_mm.shape, bool(np.isnan(depth.z_mm).all()), float(depth.confidence.max())
    ((16, 16), True, 0.0)
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
    evidence = focus_evidence(counts, planes)
    gain = windowed(evidence.gain, evidence.photons)
    best = best_labels(gain, np.full(len(planes) - 1, STEP_NATS), JUMP_NATS)
    refined_px = _refined(planes.total_disparity_px, gain, best)
    depth = np.clip(depth_of_total_disparity_mm(grid, refined_px), near, far)
    confidence = _posterior_near(gain, best)
    best_gain = np.take_along_axis(gain, best[None], axis=0)[0]
    photons = _photons_nearby(evidence, best)
    abstains = (best_gain < SIGNIFICANT_NATS) | (photons < FEWEST_PHOTONS)
    abstains |= confidence < LEAST_CONFIDENCE
    halves = halves_of(counts, planes)
    abstains |= halves.agreement(best, ~abstains) < least_agreement(halves.planes)
    depth = np.where(abstains, np.nan, depth)
    confidence = np.where(abstains, 0.0, confidence)
    return DepthMap(cells_to_pixels(depth, CELL_PX, grid), cells_to_pixels(confidence, CELL_PX, grid))


def _photons_nearby(evidence: FocusEvidence, best: np.ndarray) -> np.ndarray:
    """Photons (h, w) of all colours in a Gaussian window, of weight 1 at its centre, at the best plane."""
    from scipy.ndimage import gaussian_filter

    photons = np.take_along_axis(evidence.photons.sum(axis=1), best[None], axis=0)[0]
    return 2 * np.pi * NEARBY_CELLS**2 * gaussian_filter(photons, NEARBY_CELLS, mode="constant")


def _refined(total_px: np.ndarray, gain: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Total disparity at the top of a parabola through the best plane and its neighbours."""
    if total_px.size < 3:
        return total_px[best]
    inner = np.clip(best, 1, total_px.size - 2)
    before, at, after = (np.take_along_axis(gain, (inner + s)[None], axis=0)[0] for s in (-1, 0, 1))
    curvature = before - 2 * at + after
    offset = np.where(curvature < 0, (before - after) / (2 * np.where(curvature < 0, curvature, 1)), 0)
    offset = np.where(best == inner, np.clip(offset, -0.5, 0.5), 0.0)
    return total_px[best] + offset * (total_px[1] - total_px[0])


def _posterior_near(gain: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Posterior probability (h, w) that the depth is within `NEIGHBOURS` planes of the best."""
    weight = np.exp(gain - gain.max(axis=0))
    plane = np.arange(gain.shape[0])[:, None, None]
    return (weight * (np.abs(plane - best) <= NEIGHBOURS)).sum(axis=0) / weight.sum(axis=0)
