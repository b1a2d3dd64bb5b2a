"""Depth of every pixel of the virtual centre, from where the photons agree best."""

from collections.abc import Sequence

import numpy as np

from pcii.errors import InputError
from pcii.geometry import depths_of_equal_spread_mm, disparity_spread_px
from pcii.likelihood import cells_to_pixels, flat_deviation, focus_scores, photons_nearby
from pcii.photon_counts import PhotonCounts, check_depth_counts
from pcii.types import DepthMap, check_z_mm

PLANE_STEP_PX = 1.0
"""Planes differ by this much in total disparity spread: finer than a pixel nothing can be told."""
MOST_PLANES = 2000
SIGMA_PX = 14.0
LEAST_CONFIDENCE = 0.5
SIGNIFICANT_SIGMAS = 4.0
"""The best of many planes exceeds 3 standard deviations now and then without any texture."""
NEARBY_SIGMA_PX = 4.0
FEWEST_PHOTONS = 10.0
"""Fewer photons than this within about 10 px of a point: its neighbours' depth is not its own."""
NEIGHBOURS = 2
"""Planes on either side of the best whose likelihood counts for it: about the focus depth."""


def estimate_depth(counts: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
    """Depth per pixel, (H, W) float64 in mm within `z_range_mm`, NaN where the method abstains.

    Planes of equal disparity steps are compared by their Poisson likelihood over a window; between
    planes a parabola is fitted. `confidence` (H, W) is the posterior probability, all planes being
    equally likely beforehand, that the depth lies within 2 planes of the best; below one half,
    or where there are next to no photons or no texture, the method abstains.

    Raises `InputError` for a range that is not 0 < near < far, or a single view.
    """
    if not isinstance(z_range_mm, Sequence) or len(z_range_mm) != 2:
        raise InputError(f"z_range_mm: expected (near, far), got {z_range_mm!r}")
    near, far = check_z_mm(z_range_mm)
    check_depth_counts(counts)
    if near >= far:
        raise InputError(f"z_range_mm: near must be less than far, got {near:g} and {far:g}")
    grid = counts.grid
    span = float(disparity_spread_px(grid, near) - disparity_spread_px(grid, far))
    if span > MOST_PLANES * PLANE_STEP_PX:
        raise InputError(
            f"z_range_mm: from {near:g} to {far:g} mm total disparity changes by {span:.3g} px, and at "
            f"most {MOST_PLANES * PLANE_STEP_PX:g} px can be searched; choose a farther near end"
        )
    z = depths_of_equal_spread_mm(grid, near, far, PLANE_STEP_PX)
    scores = focus_scores(counts, z, sigma_px=SIGMA_PX)
    best = np.argmax(scores, axis=0)
    spread = _refined(disparity_spread_px(grid, z), scores, best)
    confidence = _posterior_near_best(scores, best)
    depth = np.clip(float(disparity_spread_px(grid, 1.0)) / spread, near, far)
    photons = photons_nearby(counts, z, sigma_px=NEARBY_SIGMA_PX)
    here = np.take_along_axis(photons, best[None], axis=0)[0]
    # What a flat patch would score at its best plane by chance is no evidence of depth.
    chance = flat_deviation(counts, float(np.median(z)), sigma_px=SIGMA_PX)
    is_flat = scores.max(axis=0) < SIGNIFICANT_SIGMAS * chance
    abstains = is_flat | (here < FEWEST_PHOTONS) | (confidence < LEAST_CONFIDENCE)
    depth = np.where(abstains, np.nan, depth)
    confidence = np.where(abstains, 0.0, confidence)
    return DepthMap(cells_to_pixels(depth, counts), cells_to_pixels(confidence, counts))


def _refined(spread: np.ndarray, scores: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Disparity spread at the top of a parabola through the best plane and its neighbours."""
    inner = np.clip(best, 1, max(scores.shape[0] - 2, 1))
    if scores.shape[0] < 3:
        return spread[best]
    before, at, after = (np.take_along_axis(scores, (inner + step)[None], axis=0)[0] for step in (-1, 0, 1))
    curvature = before - 2 * at + after
    offset = np.where(curvature < 0, (before - after) / (2 * np.where(curvature < 0, curvature, 1)), 0)
    offset = np.where(best == inner, np.clip(offset, -0.5, 0.5), 0.0)
    step_px = spread[1] - spread[0]
    return spread[best] + offset * step_px


def _posterior_near_best(scores: np.ndarray, best: np.ndarray) -> np.ndarray:
    weight = np.exp(scores - scores.max(axis=0))
    plane = np.arange(scores.shape[0])[:, None, None]
    near = np.abs(plane - best) <= NEIGHBOURS
    return (weight * near).sum(axis=0) / weight.sum(axis=0)
