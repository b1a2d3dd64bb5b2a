"""Removal methods of others: functions, and entry points of the group `pcii.methods` of their packages.

In the pyproject.toml of such a package:

    [project.entry-points."pcii.methods"]
    my-method = "my_package:remove"

`remove` is called with the `PhotonCounts` and their `Sections` at the requested planes, and returns a
`Segmented` of these sections.
Entry points are read, and the package imported, only when a method is requested that is not built in.
"""

from collections.abc import Callable, Mapping

import numpy as np

from pcii.base.errors import InputError
from pcii.base.extensions import called
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

GROUP = "pcii.methods"
Method = Callable[[PhotonCounts, Sections], Segmented]


def checked(remove: Callable[..., object], label: str, name: str | None = None) -> Method:
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
