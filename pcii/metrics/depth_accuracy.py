"""Errors of a depth map, in mm, px and by the 4D light field benchmark, and whether its confidence is right.

Notation: d disparity in px between neighbouring views at the virtual centre; e = d true - d estimated. A
pixel without an estimate counts as bad in every share and as off by any amount in a median. Means are of the
pixels with an estimate, whose share is given beside them.
"""

from typing import Any

import numpy as np

from pcii.base import InputError
from pcii.types import CameraGrid, DepthMap, Truth, parallax_px, total_disparity_px

MEASURES = ("mae_mm", "median_mm", "bad_1px", "bad_3px", "coverage", "median_px", "mae_px", "bias_mm")
MEASURES += ("bias_px", "within_1px", "within_3px", "brier", "quadratic_score")
ONE_DEPTH_MEASURES = ("within_1px", "within_3px", "quadratic_score")
HCI_BORDER_PX = 15
"""Border that the benchmark ignores."""
HCI_BAD_PX = 0.07
HCI_MEASURES = ("badpix_007", "mse_x100", "q25_x100")
CORRECT_PX = 1.0
"""Error in px of total disparity up to which a depth is what its confidence is the probability of."""
CONFIDENCE_BINS = 10
PROBABILITY_TOLERANCE = 1e-6
"""By which a sum of probabilities may exceed 1, by rounding."""


def depth_errors(grid: CameraGrid | None, depth: DepthMap | None, truth: Truth | None) -> dict[str, Any]:
    """Errors of a depth map over the objects' pixels, those of `hci_errors`, and its `calibration`.

    The objects' pixels are those with a `Truth.object_z_mm`: all with a true depth, if no object is known.
    `hci` is over all pixels with a true depth, as in the benchmark; `hci_objects` over the objects' pixels,
    since a dark backdrop has no photons to estimate depth from.
    `within_1px` and `within_3px` are the shares of the pixels whose depth is as near to the truth, in px of
    total disparity, and `bad_1px` and `bad_3px` the other pixels; `coverage` is the share with an estimate.
    `median_mm` and `median_px` are medians of the absolute errors of all pixels, None where most have no
    estimate; of the pixels with an estimate `mae_mm` and `mae_px` are the mean absolute errors, `bias_mm` and
    `bias_px` the medians of signed errors, above 0 where depths are too far.
    `brier` is the score of Brier (1950) of the confidence that a depth is within 1 px: the mean of (c - y)^2,
    c the confidence, 0 without an estimate, and y 1 where that is so, else 0. Less is better, but it is 0
    for who never answers. `quadratic_score`, within_1px - brier, is the mean of 2 c y - c^2 and as proper: 0
    without answers, 1 if all are right and sure, below 0 if they are less often right than half of what
    their confidence says.
    `one_depth` has what the best answer of one depth everywhere would have, with the best confidence. All are
    None without a depth map, and where no true depth is known.
    """
    errors: dict[str, Any] = dict.fromkeys(MEASURES)
    errors["one_depth"] = dict.fromkeys(ONE_DEPTH_MEASURES)
    errors["hci"], errors["hci_objects"] = dict.fromkeys(HCI_MEASURES), dict.fromkeys(HCI_MEASURES)
    errors["ece"] = errors["reliability"] = None
    if grid is None or depth is None or truth is None:
        return errors
    on_object = np.isfinite(truth.object_z_mm)
    errors["hci"] = hci_errors(grid, depth, truth, np.isfinite(truth.z_mm))
    errors["hci_objects"] = hci_errors(grid, depth, truth, on_object)
    errors |= calibration(grid, depth, truth)
    if not on_object.any():
        return errors
    estimate, true = depth.z_mm[on_object], truth.z_mm[on_object]
    answered = _answered(estimate)
    signed_mm = estimate[answered] - true[answered]
    estimated_px, true_px = (total_disparity_px(grid, z_mm[answered]) for z_mm in (estimate, true))
    signed_px = true_px - estimated_px  # what is farther has less disparity
    error_px = np.full(estimate.shape, np.inf)
    error_px[answered] = np.abs(signed_px)
    for limit in (1, 3):
        errors[f"within_{limit}px"] = float((error_px <= limit).mean())
        errors[f"bad_{limit}px"] = float((error_px > limit).mean())
    errors["coverage"] = float(answered.mean())
    confidence = np.where(answered, depth.confidence[on_object], 0.0)
    errors["brier"] = float(((confidence - (error_px <= CORRECT_PX)) ** 2).mean())
    errors["quadratic_score"] = errors["within_1px"] - errors["brier"]
    errors["one_depth"] = _of_one_depth(total_disparity_px(grid, true))
    is_mostly_answered = 2 * np.count_nonzero(answered) > answered.size
    for unit, signed in (("mm", signed_mm), ("px", signed_px)):
        if is_mostly_answered:
            missing = np.full(answered.size - signed.size, np.inf)
            errors[f"median_{unit}"] = float(np.median(np.concatenate([np.abs(signed), missing])))
        if answered.any():
            errors[f"mae_{unit}"] = float(np.abs(signed).mean())
            errors[f"bias_{unit}"] = float(np.median(signed))
    return errors


def _of_one_depth(true_px: np.ndarray) -> dict[str, float]:
    """The scores of the best answer of one depth for all pixels, of true total disparities (N,)."""
    ordered = np.sort(true_px)
    within = {}
    for limit in (1, 3):
        # The best window of twice the limit begins at a pixel.
        ends = np.searchsorted(ordered, ordered + 2 * limit, side="right")
        within[limit] = float((ends - np.arange(ordered.size)).max() / ordered.size)
    # Of a constant confidence c the score is 2 c s - c^2, largest for c = s.
    return {"within_1px": within[1], "within_3px": within[3], "quadratic_score": within[1] ** 2}


def hci_errors(grid: CameraGrid, depth: DepthMap, truth: Truth, where: np.ndarray) -> dict[str, float | None]:
    """Metrics of the HCI 4D light field benchmark over the pixels `where`, bool (H, W).

    Honauer et al. 2016, 2017. `badpix_007`: share with |e| > 0.07; `mse_x100`: 100 mean e^2; `q25_x100`: 100
    times the lower quartile of |e|. A border of 15 px is ignored. None where no pixel is left.
    """
    errors: dict[str, float | None] = dict.fromkeys(HCI_MEASURES)
    judged = np.zeros(where.shape, dtype=bool)
    inner = np.s_[HCI_BORDER_PX:-HCI_BORDER_PX, HCI_BORDER_PX:-HCI_BORDER_PX]
    judged[inner] = where[inner]
    if not judged.any():
        return errors
    missing = ~_answered(depth.z_mm)
    true = _disparity_px(grid, truth.z_mm)
    error = np.abs(true - _disparity_px(grid, np.where(missing, np.inf, depth.z_mm)))
    errors["badpix_007"] = _mean((error > HCI_BAD_PX) | missing, judged)
    if (known := error[judged & ~missing]).size:
        errors["mse_x100"] = float(100 * np.mean(known**2))
        errors["q25_x100"] = float(100 * np.quantile(known, 0.25))
    return errors


def calibration(grid: CameraGrid, depth: DepthMap, truth: Truth) -> dict[str, Any]:
    """Whether the confidence of a depth map is the share of its depths that are right.

    Of all pixels of the film with an estimate, but for objects that count in no score; it is right if it is
    within 1 px of total disparity of the truth, and wrong where nothing is hit. `reliability` has ten bins of
    confidence of equal width by name, "0.0-0.1" to "0.9-1.0" (an end between two belongs to the upper one):
    the `share` of the pixels, their mean `confidence` and the share that is `correct`, None in an empty bin.
    `ece`, the expected calibration error (Naeini, Cooper and Hauskrecht 2015), is the mean of
    |correct - confidence| over the bins, weighted by their shares. Both are None without any estimate. Raises
    `InputError` for a confidence that is no probability.

    >>> grid = CameraGrid(
    ...     rows=1, cols=2, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=1, width=4
    ... )
    >>> true = Truth(np.full((1, 4), 500.0), np.ones((1, 4), dtype=int), {1: "wall"})
    >>> depth = DepthMap(np.array([[500.0, 500.0, 500.0, 900.0]]), np.full((1, 4), 0.75))
    >>> calibration(grid, depth, true)["ece"]
    0.0
    """
    answered = _answered(depth.z_mm) & ~truth.is_unscored
    if not answered.any():
        return {"ece": None, "reliability": None}
    stated = depth.confidence[answered]
    if not ((stated >= 0) & (stated <= 1 + PROBABILITY_TOLERANCE)).all():
        raise InputError("confidence: expected probabilities from 0 to 1 where a depth is given")
    hit = np.isfinite(truth.z_mm[answered])
    error_px = total_disparity_px(grid, depth.z_mm[answered]) - total_disparity_px(grid, truth.z_mm[answered])
    correct = hit & (np.abs(error_px) <= CORRECT_PX)
    place = np.minimum((stated * CONFIDENCE_BINS).astype(int), CONFIDENCE_BINS - 1)
    reliability: dict[str, dict[str, float | None]] = {}
    ece = 0.0
    for number in range(CONFIDENCE_BINS):
        inside = place == number
        share = float(inside.mean())
        confidence, right = _mean(stated, inside), _mean(correct, inside)
        if confidence is not None and right is not None:
            ece += share * abs(right - confidence)
        ends = (number / CONFIDENCE_BINS, (number + 1) / CONFIDENCE_BINS)
        name = f"{ends[0]:.1f}-{ends[1]:.1f}"
        reliability[name] = {"share": share, "confidence": confidence, "correct": right}
    return {"ece": ece, "reliability": reliability}


def _answered(z_mm: np.ndarray) -> np.ndarray:
    return np.isfinite(z_mm) & (z_mm > 0)


def _disparity_px(grid: CameraGrid, z_mm: np.ndarray) -> np.ndarray:
    """Disparity between horizontal neighbours, or vertical ones in a grid of one column."""
    across, down = parallax_px(grid, z_mm)
    return across if grid.cols > 1 else down


def _mean(values: np.ndarray, where: np.ndarray) -> float | None:
    return float(values[where].mean()) if where.any() else None
