"""What a posterior becomes after sheets have explained the photons of all cameras."""

from dataclasses import replace

import numpy as np

from pcii.depth.explained_views import Explanation
from pcii.depth.sheet_kernels import grow_planes
from pcii.depth.sheets import Sheets
from pcii.types.estimates import DepthPosterior


def posterior_after(
    posterior: DepthPosterior, sheets: Sheets, explained: Explanation, least: float
) -> DepthPosterior:
    """The posterior whose planes near a sheet grow by the root of how much more it is seen.

    So do no surface and planes far from all sheets with the light without depth. Where the photons
    around do not tell the depth the network's stays. The probability of being in focus at a requested plane
    grows by as much as the sheets at the plane do, that of no plane by as much as the others and the light
    without depth. Where nothing changes the posterior does not either.
    """
    before, after = (_with_nothing(visible) for visible in (explained.before, explained.after))
    growth = _of_depths(sheets, after, least) / _of_depths(sheets, before, least)
    in_focus = _in_focus_after(posterior.in_focus, sheets, before, growth)
    probability, no_surface = posterior.probability.copy(), posterior.no_surface.copy()
    planes_px = posterior.planes.total_disparity_px
    # The network's planes know the same photons already, so that what sheets say of them counts half.
    grow_planes(probability, no_surface, planes_px, sheets.total_px, sheets.same_px, np.sqrt(growth))
    is_supported = posterior.is_supported
    probability = np.where(is_supported, probability, posterior.probability)
    no_surface = np.where(is_supported, no_surface, posterior.no_surface)
    return replace(posterior, probability=probability, no_surface=no_surface, in_focus=in_focus)


def _with_nothing(visible: np.ndarray) -> np.ndarray:
    """The probabilities (L + 1, h, w) of sheets (L, h, w), and of the light without depth."""
    return np.concatenate([visible, 1 - visible.sum(axis=0, keepdims=True)])


def _of_depths(sheets: Sheets, visible: np.ndarray, least: float) -> np.ndarray:
    """The probability (L + 1, h, w) that a sheet, or another at its depth, is what is seen, more by `least`;
    and of the light without depth."""
    depths, same_px = sheets.total_px, sheets.same_px
    near = [(visible[:-1] * (np.abs(depths - own) < same_px)).sum(axis=0) for own in depths]
    return np.stack([*near, visible[-1]]) + np.float32(least)


def _in_focus_after(
    in_focus: np.ndarray, sheets: Sheets, before: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """Probabilities (R, h, w) of being in focus, each times the mean `growth` of its sheets, normalised."""
    weight = before + np.finfo(np.float32).eps
    of_none = np.append(~sheets.is_at.any(axis=0), True)
    rows = [np.append(own, False) for own in sheets.is_at] + [of_none]
    claimed = np.concatenate([in_focus, (1 - in_focus.sum(axis=0, keepdims=True)).clip(0)])
    for probability, own in zip(claimed, rows, strict=True):
        probability *= (weight[own] * growth[own]).sum(axis=0) / weight[own].sum(axis=0)
    return claimed[:-1] / claimed.sum(axis=0)
