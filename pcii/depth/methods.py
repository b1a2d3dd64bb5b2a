"""Estimators of depth by name: a depth for each pixel of the virtual centre.

Another package registers one as an entry point of the group `pcii.depth_methods`:

    [project.entry-points."pcii.depth_methods"]
    my-method = "my_package:depth"

`depth` is called with the `PhotonCounts` or `Views` and the range (near, far) in mm, and returns a `DepthMap`
of their height and width, with depths above 0 or NaN, and confidence from 0 to 1.
"""

from collections.abc import Callable

import numpy as np

from pcii.base import InputError, MethodRegistry, called
from pcii.depth.posterior_depth import NO_DEPTHS, PosteriorDepth, depth_map_of
from pcii.evidence import MAX_DEPTHS, MIN_DEPTH_SHARE
from pcii.sections import warn_of_saturation
from pcii.types import (
    CameraGrid,
    DepthMap,
    DepthPosterior,
    FocalPlanes,
    PhotonCounts,
    Views,
    check_data,
    check_depth_range,
    depth_of_total_disparity_mm,
    disparity_px,
    total_disparity_px,
)

GROUP = "pcii.depth_methods"
Method = Callable[..., DepthMap]

FOR_COUNTS: dict[str, Method | str] = {
    "posterior": PosteriorDepth(),
    "sweep-17": "pcii.depth.textbook_depth:likelihood_sweep",
    "variance-sweep": "pcii.depth.textbook_depth:variance_sweep",
}
FOR_VIEWS: dict[str, Method | str] = {
    "posterior": FOR_COUNTS["posterior"],
    "variance-sweep": FOR_COUNTS["variance-sweep"],
    "structure-tensor": "pcii.depth.textbook_depth:structure_tensor",
}
"""The built-in methods by what they take; those to compare with are loaded when they are asked for."""
DEFAULT_METHOD = "posterior"
"""Of photon counts and of radiance."""
BUILT_IN = FOR_COUNTS | FOR_VIEWS
MOST_SPAN_PX = 2000.0
"""Largest change of total disparity between the ends of a range that is searched."""
SMALL_FILM_PX = 256
"""Parallax in px from camera to camera up to which depths are searched on films of any size."""
MODE_PX = 2.0
"""What is nearer in total disparity is in focus together: a blur half-extent of a pixel."""


def estimate_depth(
    data: PhotonCounts | Views,
    z_range_mm: tuple[float, float],
    *,
    z_mm: object = None,
    method: str | Method | None = None,
) -> DepthMap:
    """Depth per pixel, (H, W) float64 in mm within `z_range_mm`, NaN where the method abstains.

    `method` is one of `pcii.depth_methods()`, or a function that returns a `DepthMap` for the data and the
    range. "posterior", the default, is the posterior probability of depth by the texture that sections show,
    by the smoothness of surfaces and by a network that has seen many; of photon counts surfaces then have to
    explain what all cameras see (docs/theory.md). `depth_posterior` has all of it. It alone uses `z_mm` (Z,),
    the depths of planes in which objects are expected, if any are given. "sweep-17", of photon
    counts and with windows of 17 px, "variance-sweep" and, of radiance, "structure-tensor" are textbook
    methods to compare with, which answer wherever there are samples.

    Warns of frames whose saturation removed more than 2 % of the photons. Raises `InputError` for a range
    that is not 0 < near < far, a single view, a method that is not known or cannot take the data, or one of
    others that fails, writes into the data, or returns no such `DepthMap`.

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
    z_range_mm = _checked_range_mm(data, z_range_mm)
    estimate = find_depth_method(DEFAULT_METHOD if method is None else method, data)
    if isinstance(estimate, PosteriorDepth):
        return depth_map_of(depth_posterior(data, z_range_mm, z_mm=z_mm), z_range_mm)
    warn_of_saturation(data)
    return estimate(data, z_range_mm)


def find_surfaces(
    data: PhotonCounts | Views, z_range_mm: tuple[float, float], method: str | Method | None = None
) -> tuple[tuple[float, ...], float]:
    """Depths in mm where the depth map has most surfaces, from near to far, and how sure its depths are.

    Around each is the largest share of the confidence that lies within `MODE_PX` of total disparity and
    farther than twice that from the others, down to `MIN_DEPTH_SHARE`. There are at most `MAX_DEPTHS`, and
    none without an answer. The second is the mean confidence, the probability that a depth is right to 1 px
    of total disparity; 0 without any. For the rest see `estimate_depth`.
    """
    depth, grid = estimate_depth(data, z_range_mm, method=method), data.grid
    answered = np.isfinite(depth.z_mm)
    total_px, weight = total_disparity_px(grid, depth.z_mm[answered]), depth.confidence[answered]
    sure = float(weight.mean()) if answered.any() else 0.0
    order = np.argsort(total_px)
    total_px, weight = total_px[order], weight[order].astype(np.float64)
    least, modes = MIN_DEPTH_SHARE * weight.sum(), list[float]()
    while len(modes) < MAX_DEPTHS and weight.any():
        mass = np.concatenate([[0.0], np.cumsum(weight)])
        ends = np.searchsorted(total_px, total_px + 2 * MODE_PX, side="right")
        first = int(np.argmax(mass[ends] - mass[:-1]))
        window = slice(first, int(ends[first]))
        if (share := weight[window].sum()) < least:
            break
        modes.append(float(weight[window] @ total_px[window] / share))
        weight[np.abs(total_px - modes[-1]) <= 2 * MODE_PX] = 0
    return tuple(depth_of_total_disparity_mm(grid, np.array(sorted(modes, reverse=True))).tolist()), sure


def depth_posterior(
    data: PhotonCounts | Views, z_range_mm: tuple[float, float], *, z_mm: object = None
) -> DepthPosterior:
    """Probability of each depth in `z_range_mm` and around, and of no surface, for square blocks of pixels.

    It is what the method "posterior" of `estimate_depth` reads its depths and confidences from, and has a
    value everywhere: where no photon is, that of scenes on average. Of the depths `z_mm` (Z,), if any are
    given, it says what is in focus there, as the method "posterior" of `segment` does. Depths within 20 px of
    total disparity around these and 7 px beyond the range are part of it, so that what is outside is not
    taken for something at the ends; depth maps and masks have no answer there. Raises `InputError` as
    `estimate_depth`.
    """
    z_range_mm = _checked_range_mm(data, z_range_mm)
    warn_of_saturation(data)
    requested = NO_DEPTHS if z_mm is None else FocalPlanes.at_depths(data.grid, z_mm).z_mm
    check_search(data.grid, "z_mm", np.append(requested, z_range_mm))
    return PosteriorDepth().posterior(data, z_range_mm, requested)


def check_range_mm(grid: CameraGrid, z_range_mm: object) -> tuple[float, float]:
    """Near and far end of a range of depths; raises `InputError` if it cannot be searched."""
    near, far = check_depth_range(z_range_mm)
    check_search(grid, "z_range_mm", np.array([near, far]))
    return near, far


def check_search(grid: CameraGrid, name: str, z_mm: np.ndarray) -> None:
    """Raise `InputError`, which begins with `name`, unless all depths between the depths `z_mm` (Z,) can be
    searched: they are not too many, and two cameras see the same at the farthest."""
    near, far = z_mm.min(), z_mm.max()
    span = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    if span > MOST_SPAN_PX:
        raise InputError(
            f"{name}: from {near:g} to {far:g} mm total disparity changes by {span:.3g} px, and at "
            f"most {MOST_SPAN_PX:g} px can be searched; choose a farther near end"
        )
    # From camera to camera a point moves by its disparity: by a film or more, it is on one film alone. Small
    # films are searched all the same, which takes no time.
    sizes = np.maximum([grid.width, grid.height], SMALL_FILM_PX).tolist()
    axes = zip(disparity_px(grid, far), sizes, (grid.cols, grid.rows), strict=True)
    if grid.view_count > 1 and not any(n > 1 and disparity < size for disparity, size, n in axes):
        raise InputError(f"{name}: up to {far:g} mm no two cameras see the same; choose a farther end")


def _checked_range_mm(data: PhotonCounts | Views, z_range_mm: tuple[float, float]) -> tuple[float, float]:
    check_data(data)
    if data.grid.view_count < 2:
        raise InputError("data: one view has no depth; at least 2 cameras are needed")
    return check_range_mm(data.grid, z_range_mm)


def depth_methods(data: PhotonCounts | Views | None = None) -> tuple[str, ...]:
    """Names of the methods that `estimate_depth` accepts for the data, or for any: built-in ones come first.

    Raises `InputError` for a registered name that is already taken or no file name.

    >>> depth_methods()
    ('posterior', 'sweep-17', 'variance-sweep', 'structure-tensor')
    """
    return REGISTRY.names(_built_in(data))


def find_depth_method(method: str | Method, data: PhotonCounts | Views) -> Method:
    """The method of this name, or a function, checked; `InputError` listing the names for such data."""
    kind = "photon counts" if isinstance(data, PhotonCounts) else "radiance"
    return REGISTRY.find(method, f"estimator of depth from {kind}", _built_in(data))


def _checked(estimate: Callable[..., object], label: str, name: str | None) -> Method:
    """The method of a function that may do anything: it raises `InputError`, which begins with `label`."""

    def method(data: PhotonCounts | Views, z_range_mm: tuple[float, float]) -> DepthMap:
        depth = called(estimate, label, data, z_range_mm)
        shape_HW = data.grid.shape_HW
        if not isinstance(depth, DepthMap) or depth.z_mm.shape != shape_HW:
            raise InputError(f"{label} must return a pcii.DepthMap of {shape_HW[0]} x {shape_HW[1]} pixels")
        z_mm, confidence = depth.z_mm, depth.confidence
        if not np.all(np.isnan(z_mm) | ((z_mm > 0) & (z_mm < np.inf))):
            raise InputError(f"{label} must return depths above 0 mm, or NaN where it has no answer")
        if not np.all((confidence >= 0) & (confidence <= 1)):
            raise InputError(f"{label} must return a confidence from 0 to 1, also where it has no answer")
        return depth

    return method


def _built_in(data: PhotonCounts | Views | None) -> dict[str, Method | str]:
    if data is None:
        return BUILT_IN
    return FOR_COUNTS if isinstance(data, PhotonCounts) else FOR_VIEWS


REGISTRY = MethodRegistry(GROUP, BUILT_IN, _checked)
