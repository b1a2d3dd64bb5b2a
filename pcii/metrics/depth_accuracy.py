"""Errors of a depth map, whether its confidence is right, and the Cramér-Rao bound on depth from photons.

Of errors: d disparity in px between neighbouring views at the virtual centre; e = d true - d estimated. A
pixel without an estimate counts as bad in every share and as off by any amount in a median. Means are of the
pixels with an estimate, whose share is given beside them.

Of the bound: u total disparity in px; g gradient of the logarithm of the rate, per px; N photons; the
rate that camera (k, l) sees is that of the virtual centre moved by u (a_l, b_k), where a_l = (l - (L-1)/2)
d_x / u and b_k likewise. The Fisher information of u is then N (<a^2> <g_x^2> + <b^2> <g_y^2>).
"""

from typing import Any

import numpy as np

from pcii.base import InputError
from pcii.metrics.true_masks import FOCUS_TOLERANCE_PX, TrueFocus
from pcii.types import (
    CameraGrid,
    DepthMap,
    Sections,
    Truth,
    blur_half_extent_px,
    parallax_per_total,
    parallax_px,
    total_disparity_px,
)

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
TEXTURE_SIGMA_PX = 0.5
"""Standard deviation by which rates are smoothed before their gradient is taken: enough to fill voxels
without samples of a colour. Natural texture has larger gradients at finer scales: with 1 px bounds are 1.5
times as large."""
AWAY_FROM_EDGES_PX = 4
"""Three standard deviations of the smoothing, one pixel of blur and one of the difference: no edge is
included."""


def depth_errors(grid: CameraGrid | None, depth: DepthMap | None, truth: Truth | None) -> dict[str, Any]:
    """Errors of a depth map over the objects' pixels, those of `hci_errors`, and its `calibration`.

    The objects' pixels are those with a `Truth.object_z_mm`: all with a true depth, if no object is known.
    `hci` is over all pixels with a true depth, as in the benchmark; `hci_objects` over the objects' pixels,
    since a dark backdrop has no photons to estimate depth from. Errors in px are of total disparity; signed
    ones are above 0 where depths are too far. `brier` is the score of Brier (1950) of the confidence c that a
    depth is within 1 px, the mean of (c - y)^2, y 1 where that is so, else 0; `quadratic_score`, within_1px -
    brier, is the mean of 2 c y - c^2 and as proper. `one_depth` has what the best answer of one depth
    everywhere would have, with the best confidence. docs/scores.md has every key. All are None without a
    depth map, and where no true depth is known.
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
        name = f"{number / CONFIDENCE_BINS:.1f}-{(number + 1) / CONFIDENCE_BINS:.1f}"
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


def depth_bound_px(grid: CameraGrid, photons: float, gradient_squared: tuple[float, float]) -> float | None:
    """Least standard deviation of total disparity that any unbiased method can have, in px.

    The Cramer-Rao bound 1 / sqrt(N (c_x <g_x^2> + c_y <g_y^2>)) for a surface at one depth with a known
    texture of which all views together have N = `photons`; `gradient_squared` is (<g_x^2>, <g_y^2>), means
    over the photons. None without information on depth: no photons, no texture or a single camera.
    """
    if total_disparity_px(grid, 1.0) == 0:
        return None
    d_x, d_y = parallax_per_total(grid)
    # Mean squares of the cameras' shifts per px of total disparity: 0.102 for 10 cameras along an axis.
    c_x, c_y = (grid.cols**2 - 1) / 12 * d_x**2, (grid.rows**2 - 1) / 12 * d_y**2
    information = photons * (c_x * gradient_squared[0] + c_y * gradient_squared[1])
    return float(1 / np.sqrt(information)) if information > 0 else None


def object_bounds(
    truth: Truth, full_light: Sections | None, sections: Sections | None
) -> list[dict[str, Any]]:
    """For each object that is scored its photons, its texture, and the bound on its depth by both.

    The texture is that of the full-light section at the object's plane, where the object is in focus there
    and away from its edges. Photons are counted by origin if the truth has it, else in the object's pixels of
    the photon section. `depth_sigma_px` is None without full light, texture or photons.
    """
    rows: list[dict[str, Any]] = []
    planes, lit_planes = (
        {} if each is None else TrueFocus(each.planes, truth).plane_of for each in (sections, full_light)
    )
    for number in sorted(set(truth.names) - truth.unscored):
        photons = _photons(number, truth, sections, planes.get(number))
        gradient = None if full_light is None else _texture(number, truth, full_light, lit_planes.get(number))
        sigma = None
        if full_light is not None and gradient is not None and photons is not None:
            sigma = depth_bound_px(full_light.grid, photons, gradient)
        rows.append(
            {
                "name": truth.names[number],
                "photons": photons,
                "log_gradient_per_px": None if gradient is None else float(np.sqrt(sum(gradient))),
                "depth_sigma_px": sigma,
            }
        )
    return rows


def _photons(number: int, truth: Truth, sections: Sections | None, plane: int | None) -> int | None:
    if truth.photons is not None:
        return int(np.count_nonzero(truth.photons.object_id == number))
    if sections is None:
        return None
    return 0 if plane is None else int(sections.counts[plane][truth.object_id == number].sum())


def _texture(
    number: int, truth: Truth, full_light: Sections, plane: int | None
) -> tuple[float, float] | None:
    """(<g_x^2>, <g_y^2>) per px^2 of an object in focus, over its photons away from edges; None without any.

    Each colour is weighted by the photons at its pixels; a mean over photons of (grad rate / rate)^2 is
    the sum of (grad rate)^2 / rate over that of rate.
    """
    from scipy.ndimage import binary_erosion, gaussian_filter

    if plane is None:
        return None
    rows, cols = (np.flatnonzero((truth.object_id == number).any(axis=axis)) for axis in (1, 0))
    # Its box is enough: what is away from edges is farther from them than the smoothing reaches.
    box = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    blur = blur_half_extent_px(full_light.grid, truth.z_mm[box], full_light.z_mm[plane])
    sharp = (truth.object_id[box] == number) & (blur <= FOCUS_TOLERANCE_PX)
    inside = np.asarray(binary_erosion(sharp, iterations=AWAY_FROM_EDGES_PX), dtype=bool)
    if not inside.any():
        return None
    counts, coverage = full_light.counts[plane][box], full_light.coverage[plane][box]
    smooth = {"sigma": (TEXTURE_SIGMA_PX, TEXTURE_SIGMA_PX, 0), "mode": "constant"}
    samples = gaussian_filter(coverage.astype(np.float64), **smooth)
    rate = gaussian_filter(counts.astype(np.float64), **smooth) / np.maximum(samples, 1e-9)
    weight = coverage[inside].mean(axis=0, dtype=np.float64)
    light = float((weight * rate[inside]).sum())
    if light <= 0:
        return None
    down, across = (np.gradient(rate, axis=axis)[inside] for axis in (0, 1))
    # A rate of 0 has no photons, so its gradient counts for nothing.
    per_rate = weight / np.maximum(rate[inside], 1e-6 * rate.max())
    return float((per_rate * across**2).sum() / light), float((per_rate * down**2).sum() / light)
