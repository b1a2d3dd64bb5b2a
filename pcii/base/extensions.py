"""Functions of others: entry points of installed packages, `module:function` and `file.py:function`."""

import re
import sys
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from pcii.base.plain_text import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

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
        """Built-in names, or those of them that are `offered`, then those of packages."""
        return (*(self.built_in if offered is None else offered), *registered(self.group, self.built_in))

    def point_of(self, name: str) -> "EntryPoint | None":
        """Where another package has a method; None for a built-in name and for one that nobody has."""
        return None if name in self.built_in else registered(self.group, self.built_in).get(name)

    def find(
        self, method: str | Function, noun: str, offered: Mapping[str, Function | str] | None = None
    ) -> Function:
        """The method of this name, or a function or the name of one (`load_function`), checked.

        Raises `InputError`, which lists the known names, if there is no such `noun` among those `offered`.
        """
        known = self.built_in if offered is None else offered
        if isinstance(method, str) and ":" in method and method not in known:
            method = load_function(method)
        if callable(method):
            return self.checked(method, f"method: {name_of(method)!r}", None)
        if method in known:
            function = known[method]
            return resolve_name(function) if isinstance(function, str) else function
        point = self.point_of(method)
        if point is None:
            raise InputError(f"method: no {noun} named {method!r}; use {', '.join(self.names(known))}")
        label = f"method: {method!r} of {package_of(point)}"
        return self.checked(_loaded(point.load, label), label, method)


def registered(group: str, taken: Collection[str]) -> dict[str, "EntryPoint"]:
    """Entry points of a group by name, sorted.

    Raises `InputError` for a name that is `taken`, that two packages use, or that cannot be a file name.
    """
    from importlib.metadata import entry_points

    points: dict[str, EntryPoint] = {}
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        is_new = point.name not in taken and point.name not in points
        if not is_new or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", point.name):
            raise InputError(
                f"{group}: {point.value} of {package_of(point)} needs another name than {point.name!r}: "
                "one that is not taken, of letters, digits, '-', '_' and '.'"
            )
        points[point.name] = point
    return points


def load_function(text: str) -> Function:
    """The function that `module:function` or `file.py:function` means.

    Modules of the working directory are found, as `python -m` finds them, and a file is imported as a module,
    so that its functions can be sent to other processes. Raises `InputError` if there is no such function.
    """
    where, _, name = text.rpartition(":")

    def load() -> Function:
        path = Path(where).resolve()
        folder, module_name = (str(path.parent), path.stem) if where.endswith(".py") else ("", where)
        if folder not in sys.path:
            sys.path.insert(0, folder)
        module = import_module(module_name)
        if folder and Path(module.__file__ or "").resolve() != path:
            raise InputError(f"a module of the name {module_name!r} is at {module.__file__}; rename the file")
        return getattr(module, name)

    return _loaded(load, f"method: {text!r}")


def _loaded(load: Callable[[], Any], label: str) -> Function:
    """What `load` returns; raises `InputError`, which begins with `label`, if it fails or is no function."""
    try:
        function = load()
    except (Exception, SystemExit) as fault:  # importing another package's module may raise anything
        raise InputError(f"{label} cannot be loaded: {type(fault).__name__}: {fault}") from fault
    if not callable(function):
        raise InputError(f"{label} is {type(function).__name__}, which cannot be called")
    return function


def called(function: Function, label: str, *inputs: object) -> Any:
    """What a function of somebody else returns for these inputs, whose arrays cannot be written to.

    Raises `InputError`, which begins with `label`, if it fails or ends the program.
    """
    try:
        return function(*inputs)
    except (InputError, MemoryError):
        raise
    except (Exception, SystemExit) as fault:
        raise InputError(f"{label} failed: {type(fault).__name__}: {fault}") from fault


def name_of(function: Function) -> str:
    """Name of a function, or of the type of what can be called like one."""
    return getattr(function, "__name__", type(function).__name__)


def package_of(point: "EntryPoint") -> str:
    """What errors call the package of an entry point."""
    return f"the package {point.dist.name}" if point.dist else "a package"
