"""What other installed packages add: entry points of a group, by name."""

import re
from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pcii.base.errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

NONE: Mapping[str, str] = MappingProxyType({})


def registered(group: str, taken: Collection[str], own: Mapping[str, str] = NONE) -> dict[str, "EntryPoint"]:
    """Entry points of a group by name, sorted, without `own`: values (`module:function`) by name.

    Raises `InputError` for a name that is `taken`, that two packages use, or that cannot be a file name.
    """
    from importlib.metadata import entry_points

    found: dict[str, EntryPoint] = {}
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        if own.get(point.name) == point.value:
            continue
        label = f"{group}: {point.value} of {package_of(point)}"
        if point.name in taken:
            raise InputError(f"{label} takes the name of the built-in {point.name!r}; it needs another name")
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", point.name):
            raise InputError(f"{label} is named {point.name!r}; use letters, digits, '-', '_' and '.'")
        if point.name in found and found[point.name].value != point.value:
            raise InputError(f"{label} and {found[point.name].value} are both named {point.name!r}")
        found[point.name] = point
    return found


def load_function(point: "EntryPoint", label: str) -> Callable[..., Any]:
    """The function of an entry point, which errors call `label`.

    Raises `InputError` if it cannot be imported or called.
    """
    try:
        function = point.load()
    except Exception as fault:  # importing another package's module may raise anything
        raise InputError(f"{label} cannot be loaded: {type(fault).__name__}: {fault}") from fault
    if not callable(function):
        raise InputError(f"{label} is {type(function).__name__}, which cannot be called")
    return function


def package_of(point: "EntryPoint") -> str:
    """What errors call the package of an entry point."""
    return f"the package {point.dist.name}" if point.dist else "a package"
