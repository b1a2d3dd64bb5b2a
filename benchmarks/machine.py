"""The machine and the software that figures are of."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from simgen.dataset.software import versions as dataset_versions
from simgen.renderer import backend

PEERS = ("scipy", "numba", "colour-science", "colour-demosaicing")
EXTRAS = ("opencv-python-headless", "flip-evaluator", "mitsuba-oidn")
BUSY = 0.5
"""Load per core from which on a machine counts as busy."""


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory, renderer, and how busy the machine is now."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "renderer": backend.choose().variant,
        "load": round(os.getloadavg()[0], 2),
    }


def was_busy(found: Mapping[str, Any]) -> bool:
    """Whether something else was running when a study began."""
    return found["load"] > BUSY * found["cores"]


def versions() -> dict[str, str]:
    """Versions of Python and of all packages that are measured; of extras, those that are installed."""
    found = {"python": platform.python_version(), **dataset_versions()}
    found |= {name: version(name) for name in PEERS}
    for name in EXTRAS:
        if has(name):
            found[name] = version(name)
    return found


def has(package: str) -> bool:
    """Whether a package is installed."""
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
