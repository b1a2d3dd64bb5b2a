"""The machine and the software that figures are of."""

import os
import platform
import shutil
import subprocess
import time
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from simgen.dataset.prepared import versions as dataset_versions
from simgen.renderer import backend

PEERS = ("scipy", "numba", "colour-science")
EXTRAS = ("opencv-python-headless", "flip-evaluator")
BUSY = 0.25
"""Share of the cores in use from which on a machine counts as busy."""
LOOK_S = 1.0
"""How long it is looked at: the load average would count the study before."""


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory, renderer, and how busy the machine is now."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "renderer": backend.choose().variant,
        "cores_in_use": round(_cores_in_use(), 2),
    }


def in_words(found: Mapping[str, Any]) -> str:
    """Processor, cores and renderer of a machine."""
    return f"{found['processor']}, {found['cores']} cores, {found['renderer']}"


def commit() -> str:
    """The commit of this source, with -dirty if files differ from it; "unknown" outside a repository."""
    if not shutil.which("git"):
        return "unknown"
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude", "*"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def was_busy(found: Mapping[str, Any]) -> bool:
    """Whether something else was running when a study began."""
    return found["cores_in_use"] > BUSY * found["cores"]


def versions() -> dict[str, str]:
    """Commit, and versions of Python and all packages that are measured; of extras, those installed."""
    versions_by_name = {"commit": commit(), "python": platform.python_version(), **dataset_versions()}
    versions_by_name |= {name: version(name) for name in PEERS}
    for name in EXTRAS:
        if has(name):
            versions_by_name[name] = version(name)
    return versions_by_name


def has(package: str) -> bool:
    """Whether a package is installed."""
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def _cores_in_use() -> float:
    """Cores that all programs together use while this one waits."""
    before = _busy_s()
    time.sleep(LOOK_S)
    return (_busy_s() - before) / LOOK_S


def _busy_s() -> float:
    """Seconds that all cores together have been in use; 0 where the system does not tell."""
    stat = Path("/proc/stat")
    if not stat.is_file():
        return 0.0
    user, nice, system, _, _, *interrupts = map(
        int, stat.read_text(encoding="utf-8").splitlines()[0].split()[1:8]
    )
    return (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
