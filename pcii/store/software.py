"""The software that a result follows from: versions, hashes of sources, and how those differ."""

import hashlib
import os
import platform
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from pcii.store.folders import hash_file

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PACKAGE = "photon-integral-imaging"
COMPUTING = ("numpy", "scipy", "scikit-image", "numba", "llvmlite", "onnxruntime")
"""Other packages by which this one computes: another version may give another result."""
_SOURCE = "source of "


def versions(*packages: str) -> dict[str, str]:
    """Versions of installed packages."""
    return {name: version(name) for name in packages}


@cache
def own_software() -> dict[str, str]:
    """Versions of this package and of what it computes by, and the hash of its source."""
    source = {f"{_SOURCE}{PACKAGE}": hash_of_source([Path(__file__).parents[1]])}
    return versions(PACKAGE) | source | {"python": platform.python_version()} | versions(*COMPUTING)


def software_of_entry_point(point: "EntryPoint") -> dict[str, str]:
    """Version and source, as it is now, of the package that an entry point is of."""
    package = point.dist
    modules = {point.module.partition(".")[0]}
    if package is None:
        return {f"{_SOURCE}{point.module}": hash_of_source(_places(modules))}
    modules |= set((package.read_text("top_level.txt") or "").split())
    software = {package.name: package.version, f"{_SOURCE}{package.name}": hash_of_source(_places(modules))}
    for requirement in package.requires or ():
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        with suppress(PackageNotFoundError):
            software[name] = version(name)
    return software


def software_of_function(source: str) -> dict[str, str]:
    """The file of a function named "module:function" or "file.py:function", as it is now."""
    place = source.rpartition(":")[0]
    places = [Path(place)] if place.endswith(".py") else _places([place])
    return {f"{_SOURCE}{place}": hash_of_source(places)}


def machine() -> str:
    """Processor and system, without a name by which the machine could be found."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = f"{models[0]} ({platform.machine()})" if models else platform.machine()
    return f"{processor}, {os.cpu_count()} logical cores, {platform.system()}"


def differences(before: Mapping[str, str] | None, now: Mapping[str, str] | None) -> str:
    """How the software that made something differs from that of now, in words; empty if it does not.

    >>> differences({"numpy": "2.1", "source of mine": "a"}, {"numpy": "2.2", "source of mine": "b"})
    'numpy 2.1 is now 2.2, the source of mine has changed'
    >>> differences(None, {"numpy": "2.2"})
    'what makes them is not known'
    """
    if before is None or now is None:
        return "what makes them is not known"
    changes: list[str] = []
    for name in sorted({*before, *now}):
        old, new = before.get(name, "absent"), now.get(name, "absent")
        if old != new:
            is_source = name.startswith(_SOURCE)
            changes.append(f"the {name} has changed" if is_source else f"{name} {old} is now {new}")
    return ", ".join(changes)


def hash_of_source(places: Iterable[Path]) -> str:
    """Hash of all files of these folders and files, but for hidden and compiled ones: also of weights."""
    content = hashlib.sha256()
    for place in places:
        for file in [place] if place.is_file() else sorted(place.rglob("*")):
            name = file.relative_to(place.parent)
            if file.is_file() and not any(part.startswith((".", "__pycache__")) for part in name.parts):
                content.update(f"{name.as_posix()}\0{hash_file(file)}\0".encode())
    return content.hexdigest()[:16]


def _places(modules: Iterable[str]) -> list[Path]:
    """Files and folders of modules, without importing those at the top level."""
    places: list[Path] = []
    for name in sorted(modules):
        spec = find_spec(name)
        if spec is not None and spec.submodule_search_locations is not None:
            places += map(Path, spec.submodule_search_locations)
        elif spec is not None and spec.has_location and spec.origin is not None:
            places.append(Path(spec.origin))
    return places
