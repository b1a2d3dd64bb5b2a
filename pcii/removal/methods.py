"""Removal methods by name: which points of each section are in focus.

Another package registers one as an entry point of the group `pcii.methods`:

    [project.entry-points."pcii.methods"]
    my-method = "my_package:remove"

`remove` is called with the `PhotonCounts` and their `Sections` at the requested planes, and returns a
`Segmented` of these sections. Entry points are read, and the package imported, only when a method is
requested that is not built in.

The method "posterior" is the network of depth (`pcii.depth.surface_network`), whose inputs include the
requested planes. It gives each block the probability that the surface seen there belongs to an object in
focus at each of them, or to none. A block belongs to the most probable one. Nothing is claimed where the
depth map has no answer.
"""

from collections.abc import Callable, Mapping

import numpy as np

from pcii.base import InputError, MethodRegistry, called, on_pixels
from pcii.depth import PosteriorDepth, check_range_mm, check_search
from pcii.removal.three_step_method import ThreeStep, brightness, without_specks
from pcii.sections import extend, reconstruct, section_window_px, warn_of_saturation, with_probes
from pcii.types import DepthMap, DepthPosterior, PhotonCounts, Sections, Segmented, check_depth_counts

GROUP = "pcii.methods"
Method = Callable[[PhotonCounts, Sections], Segmented]
NOISE = 0.5
"""Standard deviation of the square root of a Poisson count."""
LEAST_CONTRAST_SIGMAS = 4.0
"""Least contrast of the two classes: noise divided at its mean has classes 2 sqrt(2 / pi) = 1.6 sigma
apart."""
FOCUS_WINDOW = 6
"""Sharpness is summed over this many pooling windows along each axis."""


def segment(
    counts: PhotonCounts,
    z_mm: object,
    *,
    z_range_mm: tuple[float, float] | None = None,
    method: str | Method = "posterior",
) -> Segmented:
    """In-focus masks (Z, H, W), bool, of the sections at the depths `z_mm`.

    `method` is one of `pcii.removal_methods()`: "posterior", by the network of depth; "three-step" (Muniraj
    et al. 2017, Eqs. 7-9); a simple one to compare them with ("brightness", "shape-from-focus");
    or one that an installed package registers; or a function that returns a `Segmented`
    for counts and their sections, such as `ThreeStep(entropy=False)`. No method is given the number of
    objects, their colours or their depths. "posterior" alone uses `z_range_mm` (near, far): what is
    outside it is claimed at no plane, or else what lies far beyond the outermost planes.
    Without photons nothing is in focus. Warns of frames whose saturation removed more than 2 % of the
    photons. Raises `InputError` for a depth not above 0, an unknown method, a single view, or a method of
    others that fails, writes into what it is given, or whose result is not a `Segmented` of these sections.

    A bright square at 500 mm, where views shift by 4 px from camera to camera:

    >>> import numpy as np
    >>> import pcii
    >>> grid = pcii.CameraGrid(
    ...     rows=3, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.125, height=64, width=64
    ... )
    >>> photons = np.zeros(grid.shape_KLHW, dtype=int)
    >>> for k, l in np.ndindex(3, 3):
    ...     photons[k, l, 26 - 4 * k : 46 - 4 * k, 26 - 4 * l : 46 - 4 * l] = 5
    >>> counts = pcii.PhotonCounts.from_dense(photons, grid)
    >>> focus = segment(counts, z_mm=[500, 1000], method="three-step")
    >>> focus.in_focus.shape, focus.in_focus.any(axis=(1, 2)).tolist()
    ((2, 64, 64), [True, False])
    """
    check_depth_counts(counts)
    remove = find_method(method)
    warn_of_saturation(counts)
    sections = reconstruct(counts, z_mm)
    if remove is remove_by_network and z_range_mm is not None:
        return remove_by_network(counts, sections, check_range_mm(counts.grid, z_range_mm))
    return remove(counts, sections)


def removal_methods() -> tuple[str, ...]:
    """Names of the methods that `segment` accepts: the built-in ones, then those of installed packages.

    Raises `InputError` for a registered name that is already taken or no file name.

    >>> removal_methods()[:2]
    ('three-step', 'posterior')
    """
    return REGISTRY.names()


def find_method(method: str | Method) -> Method:
    """The removal of this name, or a function, checked; `InputError` listing the known names."""
    return REGISTRY.find(method, "removal")


def _checked(remove: Callable[..., object], label: str, name: str | None) -> Method:
    """The method of a function that may do anything: it raises `InputError`, which begins with `label`.

    It does so where `called` does, and if the result is not a `Segmented` of the given sections, whose method
    is `name` if that is given.
    """

    def method(counts: PhotonCounts, sections: Sections) -> Segmented:
        result = called(remove, label, counts, sections)
        if not isinstance(result, Segmented):
            advice = "; for a method of depth write depth: before it" if isinstance(result, DepthMap) else ""
            raise InputError(f"{label} must return a pcii.Segmented, not {type(result).__name__}{advice}")
        requirement = _unmet_requirement(result, name, counts, sections)
        if requirement:
            raise InputError(f"{label} must return {requirement}")
        return result

    return method


def _is_map(array: object, shape: tuple[int, ...]) -> bool:
    """Whether this is an array (Z, H M, W M) for the shape (Z, H, W) and a whole number M."""
    if not isinstance(array, np.ndarray) or array.ndim != 3:
        return False
    (Z, H, W), finer = shape, array.shape[1] // shape[1]
    return finer >= 1 and array.shape == (Z, H * finer, W * finer)


def _unmet_requirement(
    result: Segmented, name: str | None, counts: PhotonCounts, sections: Sections
) -> str | None:
    """The first requirement that the result of a method does not meet, in words; None if it meets all."""
    if result.sections is not sections:
        return "a Segmented of the sections that it was given"
    if name is not None and result.method != name:
        return f"its own name as `method`, not {result.method!r}"
    if not isinstance(result.method, str):
        return f"a name as `method`, not {result.method!r}"
    if not isinstance(result.steps, Mapping):
        return "maps by their names in `steps`"
    for step, array in result.steps.items():
        if not _is_map(array, result.in_focus.shape):
            return f"maps {result.in_focus.shape} in `steps`, and {step!r} is none"
    kept, events = result.photon_in_focus, counts.events.n.size
    if kept is not None and kept.shape[1] != events:
        return f"photon_in_focus for the {events} events of the counts, not for {kept.shape[1]}"
    return None


def remove_by_network(
    counts: PhotonCounts, sections: Sections, z_range_mm: tuple[float, float] | None = None
) -> Segmented:
    """In-focus masks (Z, H, W) of the sections; there may be surfaces in the range, or else around them.

    `steps` holds `probability` (Z, H, W) float32, that of belonging to the plane.
    """
    z_mm = sections.planes.z_mm
    check_search(counts.grid, "z_mm", np.append(z_mm, z_range_mm or ()))
    return masks_of(PosteriorDepth().posterior(counts, z_range_mm, z_mm), sections)


def masks_of(posterior: DepthPosterior, sections: Sections) -> Segmented:
    """In-focus masks of the sections, at whose planes the posterior was requested."""
    # A plane that is requested twice counts once.
    _, first_requests = np.unique(sections.planes.z_mm, return_index=True)
    out_of_focus = 1 - posterior.in_focus[first_requests].sum(axis=0)
    is_most_probable = posterior.in_focus >= np.maximum(posterior.in_focus.max(axis=0), out_of_focus)
    masks, probability = (
        on_pixels(blocks, posterior.block_px, posterior.planes.grid.shape_HW)
        for blocks in (is_most_probable & posterior.is_detected, posterior.in_focus)
    )
    steps, hot_pixels = {"probability": probability}, posterior.hot_pixels
    return Segmented(masks, "posterior", sections, steps, hot_pixels=hot_pixels)


def remove_dark(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Points brighter than Otsu's threshold on the pooled section are in focus.

    Otsu 1979. Where the two classes differ by no more than noise explains, nothing is in focus.
    """
    bright = _bright(_root_photons(sections, section_window_px(sections)))
    return Segmented(bright, "brightness", sections)


def remove_blurred(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Bright points that are sharper at z than at any other requested or probe plane are in focus.

    Nayar and Nakagawa 1994: sharpness is the modified Laplacian |2 I - I(left) - I(right)| + |2 I - I(above)
    - I(below)|, one pooling window apart, summed over a window where it exceeds its noise. `steps` holds
    `bright` and `sharpness`.
    """
    compared = extend(sections, counts, with_probes(sections.planes))
    window_px = section_window_px(compared)
    image = _root_photons(compared, window_px)
    sharpness = np.stack([sum_modified_laplacian(plane, window_px) for plane in image])
    count = len(sections.planes)
    bright = _bright(image[:count])
    sharpest = np.argmax(sharpness, axis=0) == np.arange(count)[:, None, None]
    steps = {"bright": bright, "sharpness": sharpness[:count]}
    return Segmented(bright & sharpest, "shape-from-focus", sections, steps)


def sum_modified_laplacian(image: np.ndarray, step_px: int) -> np.ndarray:
    """Sharpness (H, W) of an image (H, W) whose noise is `NOISE`, its samples `step_px` apart.

    Nayar and Nakagawa 1994, Eqs. 5 and 6. Values below the noise of a modified Laplacian, sqrt(6) times that
    of a sample, are not added; beyond its borders the image is continued by its outermost pixels.
    """
    from scipy.ndimage import correlate1d, uniform_filter

    kernel = np.zeros(2 * step_px + 1)
    kernel[[0, step_px, -1]] = -1, 2, -1
    sharp = sum(np.abs(correlate1d(image, kernel, axis, mode="nearest")) for axis in (0, 1))
    return uniform_filter(np.where(sharp > np.sqrt(6) * NOISE, sharp, 0.0), FOCUS_WINDOW * step_px + 1)


def _root_photons(sections: Sections, window_px: int) -> np.ndarray:
    """Square root of the photons of a pooling window, (Z, H, W): its noise is `NOISE`, bright or dark."""
    return np.stack([brightness(sections, plane, window_px) for plane in range(len(sections.planes))])


def _bright(image: np.ndarray) -> np.ndarray:
    """Pixels above Otsu's threshold of each plane, (Z, H, W) bool, without small regions."""
    from skimage.filters import threshold_otsu

    masks: list[np.ndarray] = []
    for plane in image:
        # The range bounds the contrast of any two classes; Otsu's histogram needs two different values.
        if np.ptp(plane) <= LEAST_CONTRAST_SIGMAS * NOISE:
            masks.append(np.zeros(plane.shape, dtype=bool))
            continue
        mask = plane > threshold_otsu(plane)
        contrast = plane[mask].mean() - plane[~mask].mean() if mask.any() else 0.0
        is_significant = contrast > LEAST_CONTRAST_SIGMAS * NOISE
        masks.append(without_specks(mask & is_significant))
    return np.stack(masks)


METHODS: dict[str, Method] = {
    "three-step": ThreeStep(),
    "posterior": remove_by_network,
    "brightness": remove_dark,
    "shape-from-focus": remove_blurred,
}
REGISTRY = MethodRegistry(GROUP, METHODS, _checked)
DEFAULT_METHODS = ("three-step", "posterior")
"""The methods of `pcii run` without `--method`."""
