"""Methods by name: built-in ones and entry points of installed packages; calls of functions of theirs."""

import inspect
import re
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, is_dataclass
from pkgutil import resolve_name
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

NONE: Mapping[str, str] = MappingProxyType({})
Function = Callable[..., Any]


@dataclass(frozen=True)
class MethodRegistry:
    """Methods by name, built in or of installed packages.

    `group` is that of entry points by which other packages register theirs; `built_in` has functions, or
    "module:function" of those that are loaded only when they are asked for. `checked` makes a method of a
    function that may do anything, of the label with which errors begin, and of its name in the group or None.
    """

    group: str
    built_in: Mapping[str, Function | str]
    checked: Callable[[Function, str, str | None], Function]

    def names(self, offered: Collection[str] | None = None) -> tuple[str, ...]:
        """Built-in names, or those of them that are `offered`, then those of packages.

        Raises `InputError` for a registered name that is already taken or no file name.
        """
        return (*(self.built_in if offered is None else offered), *registered(self.group, self.built_in))

    def point_of(self, name: str) -> "EntryPoint | None":
        """Where another package has a method; None for a built-in name and for one that nobody has."""
        return None if name in self.built_in else registered(self.group, self.built_in).get(name)

    def find(
        self, method: str | Function, noun: str, offered: Mapping[str, Function | str] | None = None
    ) -> Function:
        """The method of this name, or a function, checked.

        Raises `InputError`, which lists the known names, if there is no such `noun` among those `offered`.
        """
        if callable(method):
            return self.checked(method, f"method: {name_of(method)!r}", None)
        known = self.built_in if offered is None else offered
        if isinstance(method, str) and method in known:
            function = known[method]
            return resolve_name(function) if isinstance(function, str) else function
        point = self.point_of(method) if isinstance(method, str) else None
        if point is None:
            raise InputError(f"method: no {noun} named {method!r}; use {', '.join(self.names(known))}")
        label = f"method: {method!r} of {package_of(point)}"
        return self.checked(load_function(point, label), label, method)


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
    except (Exception, SystemExit) as fault:  # importing another package's module may raise anything
        raise InputError(f"{label} cannot be loaded: {type(fault).__name__}: {fault}") from fault
    if not callable(function):
        raise InputError(f"{label} is {type(function).__name__}, which cannot be called")
    return function


def called(function: Callable[..., Any], label: str, takes: str, *inputs: object) -> Any:
    """What a function of somebody else returns for these inputs, which are described by `takes`.

    Raises `InputError`, which begins with `label`, if it does not take so many, fails, ends the program or
    writes into arrays of the inputs: they are views that cannot be written to, unless somebody insists.
    """
    try:
        signature = inspect.signature(function)
    except ValueError:  # some compiled functions do not tell
        signature = inspect.signature(lambda *_: None)
    try:
        signature.bind(*inputs)
    except TypeError:
        raise InputError(f"{label} must take {takes}, not {signature}") from None
    parts = [part for value in inputs for part in _parts(value, type(value).__name__)]
    before = [(name, members, {*members}, _checksums(members)) for name, members in parts]
    try:
        result = function(*inputs)
    except (InputError, MemoryError):
        raise
    except (Exception, SystemExit) as fault:
        raise InputError(f"{label} failed: {type(fault).__name__}: {fault}") from fault
    for name, members, known, checksums in before:
        for later in members.keys() - known:  # what was computed meanwhile, from members that are checked
            members.pop(later, None)
        if _checksums(members) != checksums:
            raise InputError(f"{label} must not write into its input, and has changed {name}: read that anew")
    return result


def name_of(function: Callable[..., Any]) -> str:
    """Name of a function, or of the type of what can be called like one."""
    return getattr(function, "__name__", type(function).__name__)


def package_of(point: "EntryPoint") -> str:
    """What errors call the package of an entry point."""
    return f"the package {point.dist.name}" if point.dist else "a package"


def _parts(value: object, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Members of a dataclass and of those within it, each with its name."""
    if is_dataclass(value):
        yield name, vars(value)
        for part, inner in list(vars(value).items()):
            yield from _parts(inner, f"{name}.{part}")


def _checksums(members: Mapping[str, object]) -> dict[str, int]:
    found = list(members.items())  # at once: other threads may compute further ones
    arrays = {name: np.ascontiguousarray(value) for name, value in found if isinstance(value, np.ndarray)}
    return {name: zlib.crc32(array.data) for name, array in arrays.items()}
