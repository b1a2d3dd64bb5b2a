"""Scenes that Python functions draw: those that ship, and those that other packages register.

In the pyproject.toml of such a package:

    [project.entry-points."simgen.scenes"]
    my-scenes = "my_package.scenes:draw"

`draw(number)` returns the values of a scene as a dict, like those of a scene.toml, the same for a number
whenever it is asked. Files that the scene names are looked for beside the module of the function.
"""

import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.extensions import package_of, registered
from simgen.drawn import GENERATORS

GROUP = "simgen.scenes"


def generators() -> dict[str, str]:
    """Names of all generators, with a line about each.

    Raises `InputError` for a name of another package that is taken or that cannot be typed. The package is
    not imported.
    """
    found = {name: (function.__doc__ or "").splitlines()[0] for name, function in GENERATORS.items()}
    return found | {name: f"Made by {package_of(point)}." for name, point in _registered().items()}


def generated(name: str, number: int) -> tuple[dict[str, Any], Path]:
    """The values of the scene that a generator draws by a number, and the folder of its files.

    Raises `InputError` if the function of another package cannot be loaded, fails or returns no dict.
    """
    if name in GENERATORS:
        function, module = GENERATORS[name], GENERATORS[name].__module__
        return function(number), _folder_of(module)
    point = _registered()[name]
    label = f"scene: {name!r} of {package_of(point)}"
    try:
        values = point.load()(number)
    except (Exception, SystemExit) as fault:  # another package's function may raise anything
        raise InputError(f"{label} cannot be drawn: {type(fault).__name__}: {fault}") from fault
    if not isinstance(values, dict):
        raise InputError(f"{label} must return the values of a scene as a dict, not {type(values).__name__}")
    return values, _folder_of(point.module)


def _registered() -> dict[str, EntryPoint]:
    """Generators of other packages by name."""
    own = {name: f"{function.__module__}:{function.__name__}" for name, function in GENERATORS.items()}
    return registered(GROUP, GENERATORS, own)


def _folder_of(module: str) -> Path:
    return Path(sys.modules[module].__file__ or "").parent
