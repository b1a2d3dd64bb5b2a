"""Removal of defocused points: which points of each section are in focus there."""

import numpy as np

from pcii import plugins
from pcii.baselines import brightness, shape_from_focus, variance
from pcii.errors import InputError
from pcii.foreground import SMALLEST_REGION_PX, outlined
from pcii.likelihood import cells_to_pixels, focus_scores
from pcii.photon_counts import PhotonCounts, check_depth_counts
from pcii.planes import with_probes
from pcii.reconstruct import reconstruct
from pcii.statistics import pooled_estimate, section_window_px
from pcii.three_step import ThreeStep
from pcii.types import Segmented, check_z_mm

FOCUS_SIGMA_PX = 20.0


def segment(counts: PhotonCounts, z_mm: object, *, method: str | plugins.Method = "likelihood") -> Segmented:
    """In-focus masks (Z, H, W), bool, of the sections at the depths `z_mm`.

    `method` is one of `methods()`: "three-step" (Muniraj et al. 2017, Eqs. 7-9), "likelihood", a simple
    one to compare them with ("brightness", "variance", "shape-from-focus"), or that of an installed
    package; or anything that makes a `Segmented` of counts and depths, such as `ThreeStep(entropy=False)`.
    None is told how many objects there are, their colours or their depths. Without photons nothing is in
    focus. Raises `InputError` for a depth not above 0, an unknown method, a single view, or a package's
    method that returns something else than it should.

    >>> focus = segment(counts, z_mm=[540, 620])              # doctest: +SKIP
    >>> focus.in_focus.shape                                  # doctest: +SKIP
    (2, 1024, 1024)
    """
    z = check_z_mm(z_mm)
    check_depth_counts(counts)
    if callable(method):
        return method(counts, z)
    return find_method(method)(counts, z)


def methods() -> tuple[str, ...]:
    """Names that `segment` knows: the built-in ones, then those of installed packages.

    Raises `InputError` for a package whose method has a name that it may not have.
    """
    return (*METHODS, *plugins.registered(METHODS))


def find_method(name: str) -> plugins.Method:
    """The removal of this name; `InputError` that lists the known names if there is none."""
    if not isinstance(name, str) or name not in METHODS:
        brought = plugins.registered(METHODS)
        if name not in brought:
            raise InputError(f"method: no removal named {name!r}; use {', '.join((*METHODS, *brought))}")
        return plugins.load(brought[name])
    return METHODS[name]


def likelihood(counts: PhotonCounts, z_mm: np.ndarray) -> Segmented:
    """A point is in focus at z if it is bright there and no other depth explains its photons better.

    `steps` holds `score` (the log-likelihood ratio in nats) and `bright`.
    """
    sections = reconstruct(counts, z_mm)
    compared = with_probes(counts.grid, z_mm)
    scores = focus_scores(counts, compared, sigma_px=FOCUS_SIGMA_PX)
    best = cells_to_pixels(np.argmax(scores, axis=0), counts)
    window_px = section_window_px(sections)
    pooled = pooled_estimate(sections, window_px)
    masks = []
    for plane, coverage in zip(pooled, sections.coverage, strict=True):
        samples = window_px**2 * float(coverage.mean()) * plane.shape[-1]
        masks.append(outlined(plane, samples, SMALLEST_REGION_PX)[1])
    in_focus = np.stack([mask & (best == plane) for plane, mask in enumerate(masks)])
    steps = {
        "score": np.stack([cells_to_pixels(score, counts) for score in scores[: z_mm.size]]),
        "bright": np.stack(masks),
    }
    return Segmented(z_mm, in_focus, "likelihood", sections, steps)


METHODS: dict[str, plugins.Method] = {
    "three-step": ThreeStep(),
    "likelihood": likelihood,
    "brightness": brightness,
    "variance": variance,
    "shape-from-focus": shape_from_focus,
}
"""What is built in; the first two are what `pcii run` does unless told otherwise."""
DEFAULT_METHODS = ("three-step", "likelihood")
