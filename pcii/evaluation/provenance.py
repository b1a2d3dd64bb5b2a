"""What made a figure: the source and the weights of what computes, versions, and the machine.

`software_of` decides for the results of `pcii run` and for the rows of an evaluation alike: what other
software made is made again.
"""

import os
import platform
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pcii.depth import methods as depth
from pcii.evaluation.method_names import NamedMethod, estimator_of
from pcii.removal import methods as removal
from pcii.store.folders import hash_bytes
from pcii.store.software import PACKAGE, own_software, software_with


def software_of(method: str) -> dict[str, str]:
    """All software that the result of a method, by its full name, follows from: versions, hashes of sources.

    For a method of another package this is also the source of that package: every file of it, so also the
    weights of a network.
    """
    estimator = estimator_of(method)
    point = removal.REGISTRY.point_of(method) if estimator is None else depth.REGISTRY.point_of(estimator)
    return own_software() if point is None else software_with(point.module)


def software_of_method(method: NamedMethod) -> dict[str, str] | None:
    """The same of a method that may be a function: of one with a source that file, of others nobody knows."""
    if method.function is None:
        return software_of(method.name)
    if not method.source:
        return None
    return software_with((estimator_of(method.source) or method.source).rpartition(":")[0])


def origin_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What measured rows: how many each version of each package, and each machine, did; first and last day.

    `differing` names what has several versions or sources, `unknown` is the number of rows that do not tell,
    and `datasets` the SHA-256 of the identities of their datasets.
    """
    software: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        for name, number in (row.get("software") or {}).items():
            software[name][number] += 1
    identities = sorted({row["identity"] for row in rows})
    days = sorted(row["date"] for row in rows if "date" in row)
    return {
        "version": version(PACKAGE),
        "software": {name: dict(counter) for name, counter in software.items()},
        "differing": sorted(name for name, counter in software.items() if len(counter) > 1),
        "unknown": sum(not row.get("software") for row in rows),
        "machines": dict(Counter(row["machine"] for row in rows if "machine" in row)),
        "days": [days[0], days[-1]] if days else [],
        "datasets": hash_bytes("\0".join(identities).encode(errors="backslashreplace")),
    }


def machine() -> str:
    """Processor and system, without a name by which the machine could be found."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = f"{models[0]} ({platform.machine()})" if models else platform.machine()
    return f"{processor}, {os.cpu_count()} logical cores, {platform.system()}"
