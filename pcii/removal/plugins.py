"""Removal methods registered by other packages: entry points of the group `pcii.methods`.

In the pyproject.toml of such a package:

    [project.entry-points."pcii.methods"]
    my-method = "my_package:remove"

`remove` is called with the `PhotonCounts` and their `Sections` at the requested planes, and returns a
`Segmented` of these sections.
Entry points are read, and the package imported, only when a method is requested that is not built in.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from pcii.base.errors import InputError
from pcii.base.extensions import load_function, package_of
from pcii.core.estimates import Segmented
from pcii.core.photon_counts import PhotonCounts
from pcii.core.section_stack import Sections

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "pcii.methods"
Method = Callable[[PhotonCounts, Sections], Segmented]


def load(point: "EntryPoint") -> Method:
    """The method of an entry point, with its result checked at every call.

    Raises `InputError` if it cannot be imported or called, and the method if its result is not a `Segmented`
    of the given sections.
    """
    label = f"method: {point.name!r} of {package_of(point)}"
    remove = load_function(point, label)

    def checked(counts: PhotonCounts, sections: Sections) -> Segmented:
        result = remove(counts, sections)
        if not isinstance(result, Segmented):
            raise InputError(f"{label} must return a pcii.Segmented, not {type(result).__name__}")
        requirement = _unmet_requirement(result, point.name, counts, sections)
        if requirement:
            raise InputError(f"{label} must return {requirement}")
        return result

    return checked


def _unmet_requirement(result: Segmented, name: str, counts: PhotonCounts, sections: Sections) -> str | None:
    """The first requirement that the result of a method does not meet, in words; None if it meets all."""
    if result.sections is not sections:
        return "a Segmented of the sections that it was given"
    if result.method != name:
        return f"its own name as `method`, not {result.method!r}"
    kept, events = result.photon_in_focus, counts.events.n.size
    if kept is not None and kept.shape[1] != events:
        return f"photon_in_focus for the {events} events of the counts, not for {kept.shape[1]}"
    return None
