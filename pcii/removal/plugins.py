"""Removal methods that other packages bring: entry points of the group `pcii.methods`.

In the pyproject.toml of such a package:

    [project.entry-points."pcii.methods"]
    my-method = "my_package:remove"

`remove` is called with the `PhotonCounts` and their `Sections` at the requested planes, and returns a
`Segmented` of these sections.
Nothing is looked up, and no such package imported, before a method is asked for that is not built in.
"""

import re
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from pcii.base.errors import InputError
from pcii.core.estimates import Segmented
from pcii.core.photon_counts import PhotonCounts
from pcii.core.section_stack import Sections

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "pcii.methods"
Method = Callable[[PhotonCounts, Sections], Segmented]


def registered(taken: Collection[str]) -> dict[str, "EntryPoint"]:
    """Methods of installed packages by name, sorted.

    Raises `InputError` for a name that is `taken`, that two packages want, or that makes no file name.
    """
    from importlib.metadata import entry_points

    found: dict[str, EntryPoint] = {}
    for point in sorted(entry_points(group=GROUP), key=lambda one: one.name):
        told = f"{GROUP}: {point.value} of {_package(point)}"
        if point.name in taken:
            raise InputError(f"{told} takes the name of the built-in {point.name!r}; it needs another name")
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", point.name):
            raise InputError(f"{told} is named {point.name!r}; use letters, digits, '-', '_' and '.'")
        if point.name in found and found[point.name].value != point.value:
            raise InputError(f"{told} and {found[point.name].value} are both named {point.name!r}")
        found[point.name] = point
    return found


def load(point: "EntryPoint") -> Method:
    """The method, its answers checked; `InputError` if it cannot be imported or called."""
    told = f"method: {point.name!r} of {_package(point)}"
    try:
        remove = point.load()
    except Exception as fault:  # whatever a stranger's module does when it is imported
        raise InputError(f"{told} cannot be loaded: {type(fault).__name__}: {fault}") from fault
    if not callable(remove):
        raise InputError(f"{told} is {type(remove).__name__}, which cannot be called")

    def checked(counts: PhotonCounts, sections: Sections) -> Segmented:
        answer = remove(counts, sections)
        if not isinstance(answer, Segmented):
            raise InputError(f"{told} must return a pcii.Segmented, not {type(answer).__name__}")
        expected = _expected(answer, point.name, counts, sections)
        if expected:
            raise InputError(f"{told} must return {expected}")
        return answer

    return checked


def _expected(answer: Segmented, name: str, counts: PhotonCounts, sections: Sections) -> str | None:
    """What the answer should have been, if it is not that."""
    if answer.sections is not sections:
        return "a Segmented of the sections that it was given"
    if answer.method != name:
        return f"its own name as `method`, not {answer.method!r}"
    kept, events = answer.photon_in_focus, counts.events.n.size
    if kept is not None and kept.shape[1] != events:
        return f"photon_in_focus for the {events} events of the counts, not for {kept.shape[1]}"
    return None


def _package(point: "EntryPoint") -> str:
    return f"the package {point.dist.name}" if point.dist else "a package"
