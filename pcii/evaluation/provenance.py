"""What made a figure: the source and the weights of what computes, versions, and the machine.

`software_of` decides for the results of `pcii run` and for the rows of an evaluation alike: what other
software made is made again.
"""

import hashlib
import os
import platform
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pcii.base
from pcii.depth import methods as depth
from pcii.evaluation.method_names import estimator_of
from pcii.removal import methods as removal
from pcii.store.hashes import hash_bytes, hash_file

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PACKAGE = "photon-integral-imaging"
COMPUTING = ("numpy", "scipy", "scikit-image", "numba", "llvmlite", "onnxruntime")
"""Other packages by which this one computes: another version may give another result."""
_SOURCE = "source of "


def software_of(method: str) -> dict[str, str]:
    """All software that the result of a method, by its full name, follows from: versions, hashes of sources.

    For a method of another package these are also that package's version, source and requirements. The source
    is every file of a package, so also the weights of a network.
    """
    point = _entry_point(method)
    return dict(_own()) if point is None else _own() | _of_plugin(point)


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


def record(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What measured rows: how many each version of each package, and each machine, did; first and last day.

    `differing` names what has several versions or sources, `unknown` is the number of rows that do not tell,
    and `datasets` the SHA-256 of the identities of their datasets.
    """
    software: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        for name, number in (row.get("software") or {}).items():
            software[name][number] += 1
    days = sorted(row["date"] for row in rows if "date" in row)
    return {
        "software": {name: dict(counter) for name, counter in software.items()},
        "differing": sorted(name for name, counter in software.items() if len(counter) > 1),
        "unknown": sum(not row.get("software") for row in rows),
        "machines": dict(Counter(row["machine"] for row in rows if "machine" in row)),
        "days": [days[0], days[-1]] if days else None,
        "datasets": _digest(sorted({row["identity"] for row in rows})),
    }


def machine() -> str:
    """Processor and system, without a name by which the machine could be found."""
    return f"{_processor()}, {os.cpu_count()} logical cores, {platform.system()}"


def _entry_point(method: str) -> "EntryPoint | None":
    """Where another package has the method; None for a built-in one."""
    estimator = estimator_of(method)
    return removal.DOOR.point_of(method) if estimator is None else depth.DOOR.point_of(estimator)


@cache
def _own() -> dict[str, str]:
    return {
        PACKAGE: version(PACKAGE),
        f"{_SOURCE}{PACKAGE}": _hash_of([Path(pcii.base.__file__).parents[1]]),
        "python": platform.python_version(),
        **{name: version(name) for name in COMPUTING},
    }


def _of_plugin(point: "EntryPoint") -> dict[str, str]:
    """Not kept for a second call: the source may be changed and loaded again while Python runs."""
    package = point.dist
    modules = {point.module.partition(".")[0]}
    if package is None:
        return {f"{_SOURCE}{point.module}": _hash_of(_places(modules))}
    modules |= set((package.read_text("top_level.txt") or "").split())
    found = {package.name: package.version, f"{_SOURCE}{package.name}": _hash_of(_places(modules))}
    for requirement in package.requires or ():
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _places(modules: Iterable[str]) -> list[Path]:
    """Files and folders of modules at the top level, without importing them."""
    places: list[Path] = []
    for name in sorted(modules):
        spec = find_spec(name)
        if spec is not None and spec.submodule_search_locations is not None:
            places += map(Path, spec.submodule_search_locations)
        elif spec is not None and spec.has_location and spec.origin is not None:
            places.append(Path(spec.origin))
    return places


def _hash_of(places: Iterable[Path]) -> str:
    """Hash of all files of these folders and files, but for hidden and compiled ones."""
    content = hashlib.sha256()
    for place in places:
        for file in [place] if place.is_file() else sorted(place.rglob("*")):
            name = file.relative_to(place.parent)
            if file.is_file() and not any(part.startswith((".", "__pycache__")) for part in name.parts):
                content.update(f"{name.as_posix()}\0{hash_file(file)}\0".encode())
    return content.hexdigest()[:16]


def _digest(texts: Iterable[str]) -> str:
    return hash_bytes("\0".join(texts).encode(errors="backslashreplace"))


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0]} ({platform.machine()})" if models else platform.machine()
