"""Small pictures of results beside the truth, by which one sees what the scores mean."""

import numpy as np

from pcii.figures.exposure import block_px
from pcii.figures.pictures import depth_image
from pcii.figures.plots import depth_limits_mm
from pcii.metrics.true_masks import TrueFocus
from pcii.types.camera_grid import CameraGrid
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.truth import Truth

TYPICAL_PHOTONS = 1000.0
"""Photons per view at which scenes and times are compared, and pictures made: those of the paper."""
PICTURES = "pictures"
"""Folder of the pictures in that of a submission."""
LONGEST_PX = 176
"""Of one map: six pairs stand side by side on the page, and two on a phone."""
GAP_PX = 4
"""Between the truth and the result."""


def picture_name(part: str, scene: str) -> str:
    """Path of a scene's picture in the folder of a submission; `part` is that of results: object or depth."""
    return f"{PICTURES}/{part}_{scene}.webp"


def picture_of(result: Segmented | DepthMap, truth: Truth, grid: CameraGrid) -> np.ndarray:
    """The truth and beside it the result, near is bright: 8-bit RGB (H, W, 3).

    Masks have the colour of their plane's depth; where they overlap that of the nearest.
    """
    if isinstance(result, DepthMap):
        true, found, confidence = truth.z_mm, result.z_mm, result.confidence
        of_interest = truth.object_z_mm  # a backdrop far behind would leave the objects one colour
    else:
        of_objects = TrueFocus(result.sections.planes, truth).by_object
        true, found = (_plane_depth(masks, result.z_mm) for masks in (of_objects, result.in_focus))
        confidence, of_interest = None, true
    limits = depth_limits_mm(of_interest) or depth_limits_mm(found) or (0.0, 1.0)
    step = block_px(true.shape, LONGEST_PX)
    few = np.s_[::step, ::step]  # single pixels: depths have no mean
    left = depth_image(true[few], *limits)
    right = depth_image(found[few], *limits, None if confidence is None else confidence[few])
    return np.hstack([left, np.full((left.shape[0], GAP_PX, 3), 255, np.uint8), right])


def _plane_depth(masks: np.ndarray, z_mm: np.ndarray) -> np.ndarray:
    """Depth (H, W) of the nearest plane whose mask (Z, H, W) has a pixel; NaN where none has."""
    depth = np.where(masks, z_mm[:, None, None], np.inf).min(axis=0)
    return np.where(np.isfinite(depth), depth, np.nan)
