"""Scenes that Python functions draw: those that ship, and those that other packages register.

In the pyproject.toml of such a package:

    [project.entry-points."simgen.scenes"]
    my-scenes = "my_package.scenes:draw"

`draw(number)` returns the values of a scene as a dict, like those of a scene.toml, the same for a number
whenever it is asked. Files that the scene names are looked for beside the module of the function.
"""

import re
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from simgen.drawn import GENERATORS

GROUP = "simgen.scenes"


def generators() -> dict[str, str]:
    """Names of all generators, with a line about each.

    Raises `InputError` for a name of another package that is taken or that cannot be typed. The package is
    not imported.
    """
    found = {name: (function.__doc__ or "").splitlines()[0] for name, function in GENERATORS.items()}
    return found | {name: f"Made by {_package(point)}." for name, point in _registered().items()}


def generated(name: str, number: int) -> tuple[dict[str, Any], Path]:
    """The values of the scene that a generator draws by a number, and the folder of its files.

    Raises `InputError` if the function of another package cannot be loaded, fails or returns no dict.
    """
    if name in GENERATORS:
        function, module = GENERATORS[name], GENERATORS[name].__module__
        return function(number), _folder_of(module)
    point = _registered()[name]
    label = f"scene: {name!r} of {_package(point)}"
    try:
        values = point.load()(number)
    except Exception as fault:  # another package's function may raise anything
        raise InputError(f"{label} cannot be drawn: {type(fault).__name__}: {fault}") from fault
    if not isinstance(values, dict):
        raise InputError(f"{label} must return the values of a scene as a dict, not {type(values).__name__}")
    return values, _folder_of(point.module)


def _registered() -> dict[str, EntryPoint]:
    """Generators of other packages by name."""
    found: dict[str, EntryPoint] = {}
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        label = f"{GROUP}: {point.value} of {_package(point)}"
        own = GENERATORS.get(point.name)
        if own is not None and point.value == f"{own.__module__}:{own.__name__}":
            continue
        if own is not None:
            raise InputError(f"{label} takes the name of the built-in {point.name!r}; it needs another name")
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", point.name):
            raise InputError(f"{label} is named {point.name!r}; use letters, digits, '-', '_' and '.'")
        if point.name in found and found[point.name].value != point.value:
            raise InputError(f"{label} and {found[point.name].value} are both named {point.name!r}")
        found[point.name] = point
    return found


def _folder_of(module: str) -> Path:
    return Path(sys.modules[module].__file__ or "").parent


def _package(point: EntryPoint) -> str:
    return f"the package {point.dist.name}" if point.dist else "a package"
