"""Textbook estimators of depth to compare others with: plane sweeps, and the structure tensor.

A sweep measures at every plane how well the samples of a voxel agree, sums that over a window, and answers
with the best plane. It answers wherever there are samples, and states no uncertainty: `confidence` is 1.

The structure tensor (Wanner and Goldluecke 2012) is taken of epipolar images: in the images of one row of
cameras, stacked, a point is a line whose slope is its disparity. It measures slopes below one pixel per
camera, so the views are first refocused at planes half a pixel apart (Diebold and Goldluecke 2013), and the
plane with the clearest slope decides.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from pcii.base import block_sums, on_pixels
from pcii.sections import demosaic, in_memory, reconstruct
from pcii.types import (
    DepthMap,
    FocalPlanes,
    PhotonCounts,
    Sections,
    Views,
    binary_scale,
    depth_of_total_disparity_mm,
    parallax_px,
)

STEP_PX = 1.0
"""Total disparity between neighbouring planes."""
BATCH = 8
"""Planes made at a time: views that stay on disk are read once for all of them."""
VARIANCE_WINDOW_PX = 7
LIKELIHOOD_WINDOW_PX = 17
"""Smaller windows show finer things in much light, larger ones large things in little."""
SIGMAS_PER_WINDOW = 4
"""The middle 95 % of a Gaussian window of the likelihood are as wide as the window."""
WIDER = 2.0
"""The wider window by the window; with 1 and 4 errors are nearly the same."""
LEAST_SAMPLES, LEAST_RATE = 1e-3, 1e-9
"""What is divided by, where a window has no samples or no photons."""
PRIOR_PHOTONS = 0.5
"""Weight of the mean rate beside the other samples of a voxel, in photons (Jeffreys' prior of a rate)."""
INNER_SIGMA_PX, OUTER_SIGMA_PX = 0.8, 2.5
"""Standard deviations of the Gaussians before derivatives, and of the window of the tensor."""
PLANE_STEP_PX, LARGEST_SLOPE_PX = 0.5, 0.7
"""Disparity between planes of refocusing, and the largest that the tensor is trusted to measure beside one;
px per camera."""


def variance_sweep(data: PhotonCounts | Views, z_range_mm: tuple[float, float]) -> DepthMap:
    """The depth at which the samples of the views differ least, in a square window.

    Of photon counts the variance beyond that of Poisson noise, the mean, is compared.
    """
    from scipy.ndimage import uniform_filter

    is_counted = isinstance(data, PhotonCounts)

    def evenness(sections: Sections, plane: int) -> np.ndarray:
        assert sections.variance is not None
        freedom = np.maximum(sections.coverage[plane].astype(np.float64) - 1, 0)
        # Where all frames of all samples are full, no noise is left, and their estimate is infinite.
        noise = np.nan_to_num(sections.estimate[plane], posinf=0.0) if is_counted else 0.0
        excess = (freedom * (sections.variance[plane] - noise)).sum(axis=-1)
        window = {"size": VARIANCE_WINDOW_PX, "mode": "constant"}
        freedom = uniform_filter(freedom.sum(axis=-1), **window)
        return np.where(freedom > 0.5, -uniform_filter(excess, **window) / np.maximum(freedom, 0.5), -np.inf)

    return _swept(data, z_range_mm, evenness, variance=True)


def likelihood_sweep(data: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
    """The depth at which the photons of each view are predicted best by those of the other views.

    The rate of a sample of m photons, of a voxel of K photons in n samples, is
    (K - m + a) / (n - 1 + a / r), a = `PRIOR_PHOTONS` and r the mean rate of its colour in a wider Gaussian
    window of the same section; the log-likelihood of all samples of a voxel relative to r is summed over a
    Gaussian window. Relative to the mean of the film instead, what is bright would win at any plane.
    """
    from scipy.ndimage import gaussian_filter

    sigma_px = LIKELIHOOD_WINDOW_PX / SIGMAS_PER_WINDOW
    events = data.events
    squared = None  # where no pixel has two photons they are their own squares; beyond 2^40 they are refused
    if events.n.max(initial=0) > 1:
        squared = PhotonCounts.from_events(
            events.k, events.l, events.i, events.j, events.n.astype(np.float64) ** 2, data.grid, cfa=data.cfa
        )

    # Where all shifts are even a colour falls on every fourth voxel only, which then has four times as many
    # samples: of a mosaic 2 x 2 voxels are taken together.
    side = 1 if data.cfa is None else 2

    def in_cells(sums: np.ndarray) -> np.ndarray:
        """Sums (h, w, C) over cells of voxels (H, W, C)."""
        return block_sums(sums, side, np.float64, (0, 1))

    def gain(sections: Sections, plane: int) -> np.ndarray:
        photons, samples = (in_cells(sums[plane]) for sums in (sections.counts, sections.coverage))
        around, reached = (
            gaussian_filter(sums, WIDER * sigma_px / side, mode="constant", axes=(0, 1))
            for sums in (photons, samples)
        )
        mean = np.maximum(around / np.maximum(reached, LEAST_SAMPLES), LEAST_RATE)
        # Of the photons of a voxel each is in a sample of sum m^2 / sum m photons on average.
        squares = photons
        if squared is not None:
            squares = in_cells(reconstruct(squared, sections.planes.take([plane])).counts[0])
        others = photons - squares / np.maximum(photons, 1)
        weight = np.maximum(samples - 1, 0) + PRIOR_PHOTONS / mean
        rate = (others + PRIOR_PHOTONS) / weight
        # All samples of the voxel expect K (n - 1) + n a photons over n - 1 + a / r.
        expected = (photons * np.maximum(samples - 1, 0) + samples * PRIOR_PHOTONS) / weight
        nats = photons * np.log(rate / mean) - (expected - samples * mean)
        nats = np.where(around > 0, nats, 0.0)
        return gaussian_filter(nats.sum(axis=-1), sigma_px / side, mode="constant")

    return _swept(data, z_range_mm, gain, side)


def _swept(
    data: PhotonCounts | Views,
    z_range_mm: tuple[float, float],
    measure: Callable[[Sections, int], np.ndarray],
    side: int = 1,
    **options: Any,
) -> DepthMap:
    """The depth of the plane of largest measure, (h, w) for sections and the number of one of their planes.

    A measure is of cells of `side` x `side` pixels. Sections, which have these `options`, are made of a few
    planes at a time.
    """
    data = in_memory(data) if isinstance(data, Views) else data
    planes = FocalPlanes.between(data.grid, *z_range_mm, STEP_PX)
    nothing = np.full([-(-size // side) for size in data.grid.shape_HW], -np.inf)
    best, nearby = np.zeros(nothing.shape, np.int64), np.stack([nothing] * 3)
    last, least = nothing, -nothing
    for first in range(0, len(planes), BATCH):
        sections = reconstruct(data, planes.take(slice(first, first + BATCH)), **options)
        for within in range(len(sections.planes)):
            plane, current = first + within, measure(sections, within)
            nearby[2] = np.where(best == plane - 1, current, nearby[2])
            better = current > nearby[1]
            nearby[:, better] = np.stack([last, current, nothing])[:, better]
            best[better] = plane
            last, least = current, np.minimum(least, current)
    total_px = planes.total_disparity_px
    best_px = total_px[best] + _steps_to_peak(nearby) * (total_px[1] - total_px[0])
    # Where all planes are alike there is nothing to choose from.
    depth = np.where(nearby[1] > least, depth_of_total_disparity_mm(planes.grid, best_px), np.nan)
    depth = on_pixels(depth, side, data.grid.shape_HW)
    return DepthMap(depth, np.isfinite(depth).astype(np.float64))


def _steps_to_peak(nearby: np.ndarray) -> np.ndarray:
    """Steps (h, w), at most half of one, from the best plane to the top of a parabola through its measure.

    `nearby` (3, h, w) is the measure at the plane before, at it and after it; beyond the ends it is not
    finite, and there is no step.
    """
    before, at, after = nearby
    inner = np.isfinite(nearby).all(axis=0)
    with np.errstate(invalid="ignore"):
        curvature = np.where(inner, before - 2 * at + after, 0.0)
        slope = np.where(inner, before - after, 0.0)
    steps = np.where(curvature < 0, slope / (2 * np.where(curvature < 0, curvature, 1)), 0.0)
    return np.clip(steps, -0.5, 0.5)


def structure_tensor(data: Views, z_range_mm: tuple[float, float]) -> DepthMap:
    """The depth of the clearest slope in the epipolar images of the central cross of cameras.

    `confidence` is the coherence of the tensor: the share of the variation that lines of this slope explain.
    """
    grid = data.grid
    per_camera = max(grid.rows, grid.cols) - 1
    planes = FocalPlanes.between(grid, *z_range_mm, PLANE_STEP_PX * per_camera)
    best_px, best_coherence = np.full(grid.shape_HW, np.nan), np.zeros(grid.shape_HW)
    lines = _cross(data)
    for plane, total_px in enumerate(planes.total_disparity_px):
        slope, coherence = _slope(lines, planes.take([plane]))
        better = (coherence > best_coherence) & (np.abs(slope) <= LARGEST_SLOPE_PX)
        best_px[better] = (total_px + slope * per_camera)[better]
        best_coherence[better] = coherence[better]
    ends_px = planes.total_disparity_px.min(), planes.total_disparity_px.max()
    return DepthMap(depth_of_total_disparity_mm(grid, np.clip(best_px, *ends_px)), best_coherence)


def _cross(data: Views) -> list[tuple[int, list[tuple[int, int, np.ndarray]]]]:
    """The middle rows and columns of cameras, each with the axis of its disparity: (k, l) and view (H, W).

    Views have no colours and are smoothed, in units of `binary_scale`.
    """
    from scipy.ndimage import gaussian_filter

    K, L = data.grid.rows, data.grid.cols
    scale = binary_scale(data)

    def grey(k: int, l: int) -> np.ndarray:
        image = data.view(k, l).astype(np.float64) / scale
        if data.cfa is not None:
            image = demosaic(image[..., 0], cfa=data.cfa)
        return gaussian_filter(image.mean(axis=-1), INNER_SIGMA_PX)

    # The middle one, or both middle ones.
    rows, cols = (range((number - 1) // 2, number // 2 + 1) for number in (K, L))
    places = [(1, [(k, l) for l in range(L)]) for k in rows if L > 1]
    places += [(0, [(k, l) for k in range(K)]) for l in cols if K > 1]
    return [(axis, [(k, l, grey(k, l)) for k, l in line]) for axis, line in places]


def _gradient(stack: np.ndarray, axis: int) -> np.ndarray:
    """Differences along an axis; 0 along a single pixel."""
    return np.gradient(stack, axis=axis) if stack.shape[axis] > 1 else np.zeros_like(stack)


def _slope(lines: list[tuple[int, list]], plane: FocalPlanes) -> tuple[np.ndarray, np.ndarray]:
    """Slope (H, W) in px per camera of the longer axis, of views refocused at a plane; and its coherence."""
    from scipy.ndimage import gaussian_filter, shift

    rows, cols = plane.exact_shifts_px
    longest = float(np.maximum(*parallax_px(plane.grid, plane.z_mm))[0])
    xx, xs, ss = np.zeros((3, plane.grid.height, plane.grid.width))
    for axis, line in lines:
        ratio = float(parallax_px(plane.grid, plane.z_mm)[1 - axis][0]) / longest
        images = [shift(image, (rows[0, k], cols[0, l]), order=1, mode="nearest") for k, l, image in line]
        stack = np.stack(images)
        across, along = ratio * _gradient(stack, 1 + axis), _gradient(stack, 0)
        for total, product in ((xx, across * across), (xs, across * along), (ss, along * along)):
            total += gaussian_filter(product.sum(axis=0), OUTER_SIGMA_PX)
    # I(x, s) = f(x + slope s): the slope of least squares, and the share of the gradient that it explains.
    slope = np.divide(xs, xx, out=np.zeros_like(xs), where=xx > 0)
    residual = np.maximum(ss - slope * xs, 0)
    return slope, np.divide(xx - residual, xx + residual, out=np.zeros_like(xx), where=xx + residual > 0)
