"""Depth from the slope of lines in epipolar images, by the structure tensor: a textbook estimator.

Wanner and Goldluecke 2012. In the images of one row of cameras, stacked, a point is a line whose slope is its
disparity. The tensor measures slopes below one pixel per camera, so the views are first refocused at planes
half a pixel apart (Diebold and Goldluecke 2013), and the plane with the clearest slope decides.
"""

import numpy as np

from pcii.sections.demosaicing import demosaic
from pcii.types.estimates import DepthMap
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import depth_of_total_disparity_mm, parallax_px
from pcii.types.images import Views, binary_scale

INNER_SIGMA_PX, OUTER_SIGMA_PX = 0.8, 2.5
"""Standard deviations of the Gaussians before derivatives, and of the window of the tensor."""
PLANE_STEP_PX, LARGEST_SLOPE_PX = 0.5, 0.7
"""Disparity between planes of refocusing, and the largest that the tensor is trusted to measure beside one;
px per camera."""


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


Line = list[tuple[int, int, np.ndarray]]
"""Images (H, W) of a row or column of cameras, each with its (k, l)."""


def _cross(data: Views) -> list[tuple[int, Line]]:
    """The middle rows and columns of cameras, smoothed, each with the axis of its disparity."""
    K, L = data.grid.rows, data.grid.cols
    scale = binary_scale(data)
    places = [(1, [(k, l) for l in range(L)]) for k in _middle(K) if L > 1]
    places += [(0, [(k, l) for k in range(K)]) for l in _middle(L) if K > 1]
    return [(axis, [(k, l, _grey(data, k, l, scale)) for k, l in line]) for axis, line in places]


def _middle(number: int) -> range:
    """The middle row (or column) of cameras, or both middle ones."""
    return range((number - 1) // 2, number // 2 + 1)


def _grey(data: Views, k: int, l: int, scale: float) -> np.ndarray:
    """One view (H, W) without colours, smoothed, in units of `scale`."""
    from scipy.ndimage import gaussian_filter

    image = data.view(k, l).astype(np.float64) / scale
    if data.cfa is not None:
        image = demosaic(image[..., 0], cfa=data.cfa)
    return gaussian_filter(image.mean(axis=-1), INNER_SIGMA_PX)


def _gradient(stack: np.ndarray, axis: int) -> np.ndarray:
    """Differences along an axis; 0 along a single pixel."""
    return np.gradient(stack, axis=axis) if stack.shape[axis] > 1 else np.zeros_like(stack)


def _slope(lines: list[tuple[int, Line]], plane: FocalPlanes) -> tuple[np.ndarray, np.ndarray]:
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
