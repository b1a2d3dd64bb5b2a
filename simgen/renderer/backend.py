"""The renderer behind everything: the one place that loads Mitsuba and Dr.Jit.

Dr.Jit compiles its kernels with the system's LLVM library, and takes whichever it finds: with LLVM
14 the import fails, with 15 and 16 the first kernel aborts the process. So each candidate is tried
in a subprocess, which may die, and only what was seen to work is loaded here. Order: CUDA, then
LLVM 17 or newer, then Mitsuba's scalar mode, which needs neither.

`SIMGEN_BACKEND` = cuda, llvm or scalar asks for one. Answers are cached under a key that changes
with the libraries.
"""

import contextlib
import ctypes.util
import importlib.util
import os
import platform
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from pcii.base.errors import InputError
from simgen.base.file_lookup import cached

NEEDED = ("mitsuba", "drjit")
Kind = Literal["cuda", "llvm", "scalar"]
KINDS: tuple[Kind, ...] = ("cuda", "llvm", "scalar")
VARIANTS: dict[Kind, str] = {"cuda": "cuda_ad_rgb", "llvm": "llvm_ad_rgb", "scalar": "scalar_rgb"}
OLDEST_LLVM = 17
PROBE_LIMIT_S = 120

# A kernel with minimum, a gather and a ray: what LLVM 15 and 16 die of, and what rendering needs.
_PROBE = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "path", "max_depth": 3},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
    "light": {"type": "constant"},
    "ball": {"type": "sphere", "center": [0, 0, 3]},
})
import numpy
assert numpy.isfinite(numpy.array(mi.render(scene, spp=1, seed=1))).all()
print("rendered")
"""


@dataclass(frozen=True)
class Candidate:
    """One way to run, and what trying it showed."""

    kind: Kind
    library: str | None
    """Path of the shared library it rests on; None for scalar."""
    version: str
    works: bool
    detail: str


@dataclass(frozen=True)
class Backend:
    """The choice: how rendering runs on this machine, and why."""

    kind: Kind
    variant: str
    library: str | None
    reason: str

    def variant_for(self, spectral: bool) -> str:
        """Mitsuba's name of this backend's variant for colours or for spectra."""
        return self.variant.replace("rgb", "spectral") if spectral else self.variant

    def line(self) -> str:
        """One line for logs and manifests."""
        return f"{self.variant}: {self.reason}"


def choose() -> Backend:
    """The fastest backend that works here.

    Raises `InputError` if Mitsuba is not installed, and if `SIMGEN_BACKEND` asks for what does not work.
    """
    check_installed()
    asked = os.environ.get("SIMGEN_BACKEND", "").strip().lower()
    if asked and asked not in KINDS:
        raise InputError(f"SIMGEN_BACKEND: use one of {', '.join(KINDS)}, not {asked!r}")
    tried: list[str] = []
    for kind in KINDS:
        if asked and kind != asked:
            continue
        for candidate in _candidates(kind):
            if candidate.works:
                why = "asked for by SIMGEN_BACKEND" if asked else "; ".join(tried)
                reason = candidate.detail + (f" ({why})" if why else "")
                return Backend(kind, VARIANTS[kind], candidate.library, reason)
            tried.append(candidate.detail)
    raise InputError(f"SIMGEN_BACKEND: {asked} does not work here: {'; '.join(tried) or 'no such library'}")


def survey() -> list[Candidate]:
    """Every candidate on this machine with its verdict, best first; for `simgen doctor`."""
    check_installed()
    return [candidate for kind in KINDS for candidate in _candidates(kind)]


def advice() -> str | None:
    """What to install for a faster backend, or None if a compiled one works already."""
    if any(candidate.works and candidate.kind != "scalar" for candidate in survey()):
        return None
    return (
        "Rendering runs in scalar mode, about 3 times slower than with LLVM 19. To install that on "
        "Debian 12 or Ubuntu 24.04, type:  sudo apt-get install libllvm19"
    )


def load(*, spectral: bool = False) -> Any:
    """The `mitsuba` module with the chosen variant set, that for spectra if asked for.

    A scene lives as long as its variant is set: who changes the variant lets go of its scenes first.
    """
    mi, variant = _mitsuba(), choose().variant_for(spectral)
    if mi.variant() != variant:
        with _uninterrupted():
            mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    return mi


def load_drjit() -> Any:
    """The `drjit` module, once the backend is chosen; it computes nothing in scalar mode."""
    _mitsuba()
    import drjit as dr

    return dr


def is_scalar(mi: Any) -> bool:
    """Whether rays are traced one by one, for want of a compiled backend."""
    return mi.variant().startswith("scalar")


def use_threads(count: int) -> None:
    """Let the compiled backend of this process run on so many threads."""
    load_drjit().set_thread_count(count)


@cache
def _mitsuba() -> Any:
    backend = choose()
    if "mitsuba" in sys.modules:  # someone else's choice: the library cannot be changed any more
        return sys.modules["mitsuba"]
    if backend.kind == "llvm" and backend.library:
        # Read once, when Dr.Jit first needs LLVM; a later setting does nothing.
        os.environ["DRJIT_LIBLLVM_PATH"] = backend.library
    with _uninterrupted():
        import mitsuba as mi

    return mi


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: while the library is loading it would abort the process."""
    if threading.current_thread() is not threading.main_thread():  # which alone hears of it
        yield
        return
    arrived: list[tuple[Any, ...]] = []
    before = signal.signal(signal.SIGINT, lambda *told: arrived.append(told))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if arrived and callable(before):
        before(*arrived[0])


def shape_numbers(scene: Any) -> list[int]:
    """The number by which the `shape_index` output names each shape of a Mitsuba scene, in its order.

    Scalar mode counts from 1. Compiled modes use a registry that is filled in parallel and goes on
    counting from scene to scene, so that the numbers follow no order. A miss is 0 in both.
    """
    mi = _mitsuba()
    if is_scalar(mi):
        return list(range(1, len(scene.shapes()) + 1))
    numbers: Any = load_drjit().reinterpret_array(mi.UInt32, scene.shapes_dr())
    return [int(number) for number in numbers]


def _candidates(kind: Kind) -> list[Candidate]:
    """The candidates of one kind, each tried, best first."""
    if kind == "scalar":
        return [Candidate("scalar", None, "", True, "scalar mode needs no library")]
    if kind == "cuda":
        library = ctypes.util.find_library("cuda")
        return [_try("cuda", library, "")] if library else []
    return [_try_llvm(path) for path in _llvm_libraries()]


def _try_llvm(path: Path) -> Candidate:
    major = _major_version(path)
    if major is not None and major < OLDEST_LLVM:
        detail = f"LLVM {major} is too old, {OLDEST_LLVM} or newer is needed"
        return Candidate("llvm", str(path), str(major), False, detail)
    return _try("llvm", str(path), "" if major is None else str(major))


def _try(kind: Kind, library: str, number: str) -> Candidate:
    """Run the probe kernel in a subprocess, or read what it showed before."""
    name = f"{kind.upper()} {number}".strip()
    works, detail = cached(
        "backend",
        _deciding(kind, library),
        lambda: dict(zip(("works", "detail"), _probe(kind, library), strict=True)),
        lambda answer: (bool(answer["works"]), str(answer["detail"])),
    )
    return Candidate(kind, library, number, works, f"{name} {detail}")


def _probe(kind: Kind, library: str) -> tuple[bool, str]:
    environment = dict(os.environ)
    if kind == "llvm":
        environment["DRJIT_LIBLLVM_PATH"] = library
    command = [sys.executable, "-c", _PROBE, VARIANTS[kind]]
    try:
        run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PROBE_LIMIT_S)
    except subprocess.TimeoutExpired:
        return False, f"did not answer within {PROBE_LIMIT_S} s"
    if run.returncode == 0 and "rendered" in run.stdout:
        return True, "works"
    if run.returncode < 0:
        return False, f"ended the trial process with signal {-run.returncode}"
    last = (run.stderr.strip().splitlines() or ["no message"])[-1]
    return False, f"failed: {last[:200]}"


def _llvm_libraries() -> list[Path]:
    """LLVM libraries of this machine: the one asked for by DRJIT_LIBLLVM_PATH, then newest first."""
    asked = os.environ.get("DRJIT_LIBLLVM_PATH")
    if asked:
        return [Path(asked)]
    folders = [Path("/usr/lib"), Path("/usr/lib64"), Path("/usr/local/lib")]
    folders += [Path("/usr/lib") / f"{platform.machine()}-linux-gnu"]
    folders += sorted(Path("/usr/lib").glob("llvm-*/lib"))
    folders += [Path(p) for p in os.environ.get("LD_LIBRARY_PATH", "").split(":") if p]
    found: dict[Path, Path] = {}
    for folder in folders:
        for path in sorted(folder.glob("libLLVM*.so*")):
            if re.fullmatch(r"libLLVM([-.][\d.]+)?\.so(\.[\d.]+)?", path.name) and path.is_file():
                found.setdefault(path.resolve(), path)
    return sorted(found.values(), key=lambda path: -(_major_version(path) or 0))


def _major_version(path: Path) -> int | None:
    """Major version from the library's file name, None if it does not say."""
    for name in (path.name, path.resolve().name):
        digits = re.search(r"LLVM[-.](\d+)|\.so\.(\d+)", name)
        if digits:
            return int(digits[1] or digits[2])
    return None


def _deciding(kind: Kind, library: str) -> list[str]:
    """What decides on the probe's answer: the libraries and the interpreter."""
    parts = [kind, library, sys.version, platform.node(), version("mitsuba"), version("drjit")]
    path = Path(library)
    if path.exists():
        state = path.resolve().stat()
        parts += [str(path.resolve()), str(state.st_size), str(state.st_mtime_ns)]
    if kind == "cuda":
        driver = Path("/proc/driver/nvidia/version")
        devices = os.environ.get("CUDA_VISIBLE_DEVICES", "all"), *map(str, Path("/dev").glob("nvidia*"))
        parts += [driver.read_text() if driver.exists() else "", *devices]
    return parts


def describe(*, spectral: bool = False) -> dict[str, Any]:
    """The choice as plain values for a manifest, with the versions that it rests on."""
    chosen = choose()
    versions = {"mitsuba": version("mitsuba"), "drjit": version("drjit")}
    return asdict(chosen) | {"variant": chosen.variant_for(spectral)} | versions


def check_installed() -> None:
    """Raise `InputError`, with what to type, unless Mitsuba and Dr.Jit are installed."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(
            f"{' and '.join(missing)}: not installed, and needed for rendering; type in the source tree:  "
            "pip install '.[render]'"
        )
