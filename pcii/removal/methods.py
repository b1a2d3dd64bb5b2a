"""Removal of defocused points: which points of each section are in focus there."""

from pcii.base.errors import InputError
from pcii.core.estimates import Segmented
from pcii.core.photon_counts import PhotonCounts, check_depth_counts
from pcii.removal import plugins
from pcii.removal.likelihood.likelihood_method import remove_by_likelihood
from pcii.removal.simple_methods import brightness, shape_from_focus, variance
from pcii.removal.three_step.three_step_method import ThreeStep
from pcii.sections.reconstruction import reconstruct


def segment(counts: PhotonCounts, z_mm: object, *, method: str | plugins.Method = "likelihood") -> Segmented:
    """In-focus masks (Z, H, W), bool, of the sections at the depths `z_mm`.

    `method` is one of `pcii.removal_methods()`: "three-step" (Muniraj et al. 2017, Eqs. 7-9), "likelihood",
    a simple one to compare them with ("brightness", "variance", "shape-from-focus"), or that of an
    installed package; or anything that makes a `Segmented` of counts and their sections, such as
    `ThreeStep(entropy=False)`. None is told how many objects there are, their colours or their depths.
    Without photons nothing is in focus. Raises `InputError` for a depth not above 0, an unknown
    method, a single view, or a package's method that returns something else than it should.

    >>> focus = segment(counts, z_mm=[540, 620])              # doctest: +SKIP
    >>> focus.in_focus.shape                                  # doctest: +SKIP
    (2, 1024, 1024)
    """
    check_depth_counts(counts)
    remove = method if callable(method) else find_method(method)
    return remove(counts, reconstruct(counts, z_mm))


def removal_methods() -> tuple[str, ...]:
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


METHODS: dict[str, plugins.Method] = {
    "three-step": ThreeStep(),
    "likelihood": remove_by_likelihood,
    "brightness": brightness,
    "variance": variance,
    "shape-from-focus": shape_from_focus,
}
"""What is built in; the first two are what `pcii run` does unless told otherwise."""
DEFAULT_METHODS = ("three-step", "likelihood")
