"""The software that a result follows from: versions, hashes of sources, and how those differ."""

import hashlib
import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from pcii.store.folders import hash_file

PACKAGE = "photon-integral-imaging"
COMPUTING = ("numpy", "scipy", "scikit-image", "numba", "llvmlite", "onnxruntime")
"""Other packages by which this one computes: another version may give another result."""


def versions(*packages: str) -> dict[str, str]:
    """Versions of installed packages."""
    return {name: version(name) for name in packages}


@cache
def own_software() -> dict[str, str]:
    """Versions of this package and of what it computes by, and the hash of its source."""
    source = {f"source of {PACKAGE}": hash_of_source(Path(__file__).parents[1])}
    return versions(PACKAGE) | source | {"python": platform.python_version()} | versions(*COMPUTING)


def software_with(place: str) -> dict[str, str]:
    """This software, and the hash of the source of a module (of its whole package), or of a file "x.py"."""
    if place.endswith(".py"):
        return own_software() | {f"source of {place}": hash_of_source(Path(place))}
    package = place.partition(".")[0]
    spec = find_spec(package)
    assert spec is not None
    source = next(iter(spec.submodule_search_locations or ()), spec.origin)
    return own_software() | {f"source of {package}": hash_of_source(Path(str(source)))}


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
            is_source = name.startswith("source of ")
            changes.append(f"the {name} has changed" if is_source else f"{name} {old} is now {new}")
    return ", ".join(changes)


def hash_of_source(place: Path) -> str:
    """Hash of a file, or of all files of a folder but for hidden and compiled ones: also of weights."""
    content = hashlib.sha256()
    for file in [place] if place.is_file() else sorted(place.rglob("*")):
        name = file.relative_to(place.parent)
        if file.is_file() and not any(part.startswith((".", "__pycache__")) for part in name.parts):
            content.update(f"{name.as_posix()}\0{hash_file(file)}\0".encode())
    return content.hexdigest()[:16]
