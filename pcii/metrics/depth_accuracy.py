"""Errors of a depth map: in mm, in px of total disparity, and by the 4D light field benchmark.

Notation: d disparity in px between neighbouring views at the virtual centre; e = d true - d estimated. A
pixel without an estimate counts as bad in every share. Means and quantiles are of the pixels with an
estimate, whose share is given beside them.
"""

from typing import Any

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.estimates import DepthMap
from pcii.core.geometry import parallax_px, total_disparity_px
from pcii.core.truth import Truth

HCI_BORDER_PX = 15
"""Border that the benchmark ignores."""
BADPIX = {"badpix_001": 0.01, "badpix_003": 0.03, "badpix_007": 0.07}
DISCONTINUITY_BADPIX = 0.07
FINE_STEP_PX = 0.15
"""Disparity by which fine structures differ from their surroundings; a larger jump is an edge."""
FINE_WIDTH_PX = 11
"""Structures into which no square of this side fits are fine."""
NEAR_EDGE_PX = 5


def depth_errors(grid: CameraGrid | None, depth: DepthMap | None, truth: Truth | None) -> dict[str, Any]:
    """Errors of a depth map over the objects' pixels, and those of `hci_errors`.

    `hci` is over all pixels with a true depth, as in the benchmark; `hci_objects` over the objects' pixels,
    since a dark backdrop has no photons to estimate depth from.
    `mae_mm`, `median_mm`, `mae_px` and `median_px` are mean and median absolute errors of the pixels with an
    estimate, in mm and in px of total disparity; `bad_1px` and `bad_3px` the shares with larger errors;
    `coverage` the share with an estimate. All are None without a depth map, without truth or without objects.
    """
    keys = ("mae_mm", "median_mm", "bad_1px", "bad_3px", "coverage", "median_px", "mae_px")
    errors: dict[str, Any] = dict.fromkeys(keys)
    errors["hci"] = hci_errors(grid, depth, truth, None if truth is None else np.isfinite(truth.z_mm))
    errors["hci_objects"] = hci_errors(grid, depth, truth, None if truth is None else truth.object_id > 0)
    if grid is None or depth is None or truth is None or not (truth.object_id > 0).any():
        return errors
    on_object = truth.object_id > 0
    estimate, true = depth.z_mm[on_object], truth.z_mm[on_object]
    answered = _answered(estimate)
    error_mm = np.abs(estimate[answered] - true[answered])
    error_px = np.full(estimate.shape, np.inf)
    estimated_px, true_px = (total_disparity_px(grid, z_mm[answered]) for z_mm in (estimate, true))
    error_px[answered] = np.abs(estimated_px - true_px)
    has_answers = answered.any()
    return errors | {
        "mae_mm": float(error_mm.mean()) if has_answers else None,
        "median_mm": float(np.median(error_mm)) if has_answers else None,
        "bad_1px": float((error_px > 1).mean()),
        "bad_3px": float((error_px > 3).mean()),
        "coverage": float(answered.mean()),
        "median_px": float(np.median(error_px[answered])) if has_answers else None,
        "mae_px": float(error_px[answered].mean()) if has_answers else None,
    }


def hci_errors(
    grid: CameraGrid | None, depth: DepthMap | None, truth: Truth | None, where: np.ndarray | None
) -> dict[str, float | None]:
    """Metrics of the HCI 4D light field benchmark over the pixels `where`, bool (H, W).

    Honauer et al. 2016, 2017. `badpix_*`: share with |e| > t; `mse_x100`: 100 mean e^2; `q25_x100`: 100
    times the lower quartile of |e|; `discontinuities`: badpix at 0.07 px near edges of the true depth;
    `fine_fattening`: share around fine structures with e < -0.15; `fine_thinning`: share of them with
    e > 0.15; `answered`: share with an estimate. The benchmark's regions are drawn by hand; here they are
    `near_edges` and `fine_structures`. A border of 15 px is ignored. None where no pixel is left.
    """
    keys = (*BADPIX, "mse_x100", "q25_x100", "discontinuities", "fine_fattening", "fine_thinning", "answered")
    errors: dict[str, float | None] = dict.fromkeys(keys)
    if grid is None or depth is None or truth is None or where is None:
        return errors
    judged = np.zeros(where.shape, dtype=bool)
    inner = np.s_[HCI_BORDER_PX:-HCI_BORDER_PX, HCI_BORDER_PX:-HCI_BORDER_PX]
    judged[inner] = where[inner]
    if not judged.any():
        return errors
    missing = ~_answered(depth.z_mm)
    true = _disparity_px(grid, truth.z_mm)
    error = true - _disparity_px(grid, np.where(missing, np.inf, depth.z_mm))
    known = np.abs(error[judged & ~missing])
    fine = fine_structures(true)
    for key, threshold in BADPIX.items():
        errors[key] = _share((np.abs(error) > threshold) | missing, judged)
    wrong = (np.abs(error) > DISCONTINUITY_BADPIX) | missing
    errors["discontinuities"] = _share(wrong, judged & near_edges(true))
    errors["fine_fattening"] = _share((error < -FINE_STEP_PX) | missing, judged & _near(fine) & ~fine)
    errors["fine_thinning"] = _share((error > FINE_STEP_PX) | missing, judged & fine)
    errors["answered"] = _share(~missing, judged)
    if known.size:
        errors["mse_x100"] = float(100 * np.mean(known**2))
        errors["q25_x100"] = float(100 * np.quantile(known, 0.25))
    return errors


def near_edges(disparity: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool within 5 px of a jump of the disparity by more than 0.15 px between neighbours."""
    jump = np.zeros(disparity.shape, dtype=bool)
    down = np.abs(np.diff(disparity, axis=0)) > FINE_STEP_PX
    across = np.abs(np.diff(disparity, axis=1)) > FINE_STEP_PX
    jump[1:] |= down
    jump[:-1] |= down
    jump[:, 1:] |= across
    jump[:, :-1] |= across
    return _near(jump)


def fine_structures(disparity: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool whose disparity exceeds its opening by a square of 11 px by more than 0.15 px.

    The difference is the white top-hat: narrow structures in front of their surroundings.
    """
    from scipy.ndimage import grey_opening

    return disparity - grey_opening(disparity, size=(FINE_WIDTH_PX, FINE_WIDTH_PX)) > FINE_STEP_PX


def _near(mask: np.ndarray) -> np.ndarray:
    from scipy.ndimage import maximum_filter

    return maximum_filter(mask, 2 * NEAR_EDGE_PX + 1)


def _answered(z_mm: np.ndarray) -> np.ndarray:
    return np.isfinite(z_mm) & (z_mm > 0)


def _disparity_px(grid: CameraGrid, z_mm: np.ndarray) -> np.ndarray:
    """Disparity between horizontal neighbours, or vertical ones in a grid of one column."""
    across, down = parallax_px(grid, z_mm)
    return across if grid.cols > 1 else down


def _share(bad: np.ndarray, where: np.ndarray) -> float | None:
    return float(bad[where].mean()) if where.any() else None
