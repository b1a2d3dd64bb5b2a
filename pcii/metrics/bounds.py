"""The Cramér-Rao bound on depth from photons.

Notation: u total disparity in px; g gradient of the logarithm of the rate, per px; N photons; the
rate that camera (k, l) sees is that of the virtual centre moved by u (a_l, b_k), where a_l = (l - (L-1)/2)
d_x / u and b_k likewise. The Fisher information of u is then N (<a^2> <g_x^2> + <b^2> <g_y^2>).
"""

from typing import Any

import numpy as np

from pcii.metrics.true_masks import FOCUS_TOLERANCE_PX, TrueFocus
from pcii.types import (
    CameraGrid,
    Sections,
    Truth,
    blur_half_extent_px,
    parallax_per_total,
    total_disparity_px,
)

TEXTURE_SIGMA_PX = 0.5
"""Standard deviation by which rates are smoothed before their gradient is taken: enough to fill voxels
without samples of a colour. Natural texture has larger gradients at finer scales: with 1 px bounds are 1.5
times as large."""
AWAY_FROM_EDGES_PX = 4
"""Three standard deviations of the smoothing, one pixel of blur and one of the difference: no edge is
included."""


def depth_bound_px(grid: CameraGrid, photons: float, gradient_squared: tuple[float, float]) -> float | None:
    """Least standard deviation of total disparity that any unbiased method can have, in px.

    The Cramer-Rao bound 1 / sqrt(N (c_x <g_x^2> + c_y <g_y^2>)) for a surface at one depth with a known
    texture of which all views together have N = `photons`; `gradient_squared` is (<g_x^2>, <g_y^2>), means
    over the photons. None without information on depth: no photons, no texture or a single camera.

    >>> from pcii.types import CameraGrid
    >>> grid = CameraGrid(
    ...     rows=10, cols=10, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=9, width=9
    ... )
    >>> depth_bound_px(grid, photons=5000, gradient_squared=(0.01, 0.01)).__round__(3)
    0.313
    """
    if total_disparity_px(grid, 1.0) == 0:
        return None
    d_x, d_y = parallax_per_total(grid)
    # Mean squares of the cameras' shifts per px of total disparity: 0.102 for 10 cameras along an axis.
    c_x, c_y = (grid.cols**2 - 1) / 12 * d_x**2, (grid.rows**2 - 1) / 12 * d_y**2
    information = photons * (c_x * gradient_squared[0] + c_y * gradient_squared[1])
    return float(1 / np.sqrt(information)) if information > 0 else None


def log_gradient_squared(
    counts: np.ndarray, coverage: np.ndarray, inside: np.ndarray
) -> tuple[float, float] | None:
    """(<g_x^2>, <g_y^2>) per px^2 of the rate counts / coverage (H, W, C), over the photons `inside` (H, W).

    Each colour is weighted by the photons at its pixels; a mean over photons of (grad rate / rate)^2 is
    the sum of (grad rate)^2 / rate over that of rate. None if there is no light inside.
    """
    from scipy.ndimage import gaussian_filter

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
    from scipy.ndimage import binary_erosion

    if plane is None:
        return None
    rows, cols = (np.flatnonzero((truth.object_id == number).any(axis=axis)) for axis in (1, 0))
    # Its box is enough: what is away from edges is farther from them than the smoothing reaches.
    box = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    blur = blur_half_extent_px(full_light.grid, truth.z_mm[box], full_light.z_mm[plane])
    sharp = (truth.object_id[box] == number) & (blur <= FOCUS_TOLERANCE_PX)
    inside = binary_erosion(sharp, iterations=AWAY_FROM_EDGES_PX)
    if not inside.any():
        return None
    return log_gradient_squared(full_light.counts[plane][box], full_light.coverage[plane][box], inside)
