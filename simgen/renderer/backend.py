"""The renderer behind everything: the one place that loads Mitsuba and Dr.Jit, and gives arrays to them.

Dr.Jit compiles its kernels with the system's LLVM library: with LLVM 14 the import fails, with 15 and 16 the
first kernel aborts the process. So each library is tried in a subprocess, and only one that works is loaded
here. Order: CUDA, the newest LLVM, and Mitsuba's scalar mode, which needs neither; `SIMGEN_BACKEND` = cuda,
llvm or scalar allows only one. Answers are cached under a key that changes with the libraries.
"""

import contextlib
import ctypes.util
import os
import platform
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, threads_of_worker
from simgen.base import cached, check_installed

VARIANTS = {"cuda": "cuda_ad_rgb", "llvm": "llvm_ad_rgb", "scalar": "scalar_rgb"}
LIBRARY_FOLDERS = ("usr/lib", "usr/lib64", "usr/local/lib", "usr/lib/*-linux-gnu", "usr/lib/llvm-*/lib")
"""Where LLVM is looked for, from the root, besides LD_LIBRARY_PATH."""
PROBE_LIMIT_S = 120
ALIGNMENT_BYTES = 64

# A kernel with minimum, a gather and a ray: what LLVM 15 and 16 die of, and what rendering needs.
_PROBE = """
import os, sys, numpy, mitsuba as mi
mi.file_resolver().clear()
mi.file_resolver().append(os.path.dirname(mi.__file__))
mi.set_variant(sys.argv[1])
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "path", "max_depth": 3},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
    "light": {"type": "constant"},
    "ball": {"type": "sphere", "center": [0, 0, 3]},
})
assert numpy.isfinite(numpy.array(mi.render(scene, spp=1, seed=1))).all()
"""


@dataclass(frozen=True)
class Backend:
    """One way to render on this machine, and what a trial of it showed.

    `variant` is Mitsuba's name of it for light of three colours, `library` the file that it needs, if any.
    """

    kind: str
    variant: str
    library: str | None
    works: bool
    detail: str

    def variant_for(self, spectral: bool) -> str:
        """Mitsuba's name of this backend's variant for colours or for spectra."""
        return self.variant.replace("rgb", "spectral") if spectral else self.variant

    def line(self) -> str:
        """One line for logs."""
        return f"{self.variant}: {self.detail}"


def choose() -> Backend:
    """The fastest backend that works here.

    Raises `InputError` if Mitsuba is not installed, and if `SIMGEN_BACKEND` asks for what does not work.
    """
    request = os.environ.get("SIMGEN_BACKEND", "").strip().lower()
    if request not in ("", *VARIANTS):
        raise InputError(f"SIMGEN_BACKEND: use one of {', '.join(VARIANTS)}, not {request!r}")
    failures = list[str]()
    for candidate in _candidates(request):
        if candidate.works:
            return candidate
        failures.append(candidate.detail)
    reasons = "; ".join(failures) or "there is no such library"
    raise InputError(f"SIMGEN_BACKEND: {request} does not work here: {reasons}")


def survey() -> list[Backend]:
    """Every backend of this machine with what its trial showed, best first; for `simgen doctor`."""
    return list(_candidates())


def advice() -> str | None:
    """What to install for a faster backend, or None if a compiled one works."""
    if any(candidate.works and candidate.kind != "scalar" for candidate in survey()):
        return None
    return (
        "Rendering runs in scalar mode, about 3 times slower than with LLVM 19. To install that on "
        "Debian 12 or Ubuntu 24.04, type:  sudo apt-get install libllvm19"
    )


def describe(*, spectral: bool = False) -> dict[str, Any]:
    """The choice as plain values for a manifest, with the versions of the libraries."""
    choice = choose()
    versions = {"mitsuba": version("mitsuba"), "drjit": version("drjit")}
    return asdict(choice) | {"variant": choice.variant_for(spectral)} | versions


def load(*, spectral: bool = False) -> Any:
    """The `mitsuba` module with the variant of `choose` set, that for spectra on request.

    A scene lives as long as its variant is set: let go of scenes before another variant is loaded.
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


@cache
def _mitsuba() -> Any:
    choice = choose()
    if choice.kind == "llvm" and choice.library:
        # Dr.Jit reads it once, when it first needs LLVM.
        os.environ["DRJIT_LIBLLVM_PATH"] = choice.library
    with _uninterrupted():
        import mitsuba

    mi: Any = mitsuba
    # Plugins, which Mitsuba runs, are looked for in its package alone, not in the working directory.
    mi.file_resolver().clear()
    mi.file_resolver().append(str(Path(mi.__file__).parent))
    if (threads := threads_of_worker()) is not None:
        import drjit as dr

        dr.set_thread_count(threads)
    return mi


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: while a library is loading it would abort the process."""
    if threading.current_thread() is not threading.main_thread():  # only the main one receives signals
        yield
        return
    arrivals: list[tuple[Any, ...]] = []
    handler = signal.signal(signal.SIGINT, lambda *arguments: arrivals.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if arrivals and callable(handler):
        handler(*arrivals[0])


def is_scalar(mi: Any) -> bool:
    """Whether rays are traced one by one, for want of a compiled backend."""
    return mi.variant().startswith("scalar")


def is_spectral(mi: Any) -> bool:
    """Whether rays carry wavelengths; else linear sRGB."""
    return "spectral" in mi.variant()


def shape_numbers(scene: Any) -> list[int]:
    """The number by which the `shape_index` output names each shape of a Mitsuba scene, in its order.

    Scalar mode counts from 1; the numbers of compiled modes follow no order. A miss is 0 in both.
    """
    mi = _mitsuba()
    if is_scalar(mi):
        return list(range(1, len(scene.shapes()) + 1))
    numbers: Any = load_drjit().reinterpret_array(mi.UInt32, scene.shapes_dr())
    return [int(number) for number in numbers]


def _upload(kind: str, dtype: Any, mi: Any, values: np.ndarray) -> Any:
    """Numbers as a flat array of a compiled backend, from a copy that begins at a multiple of 64 bytes.

    Where the backend reads NumPy's memory in place its alignment is compiled into the kernel, and NumPy's own
    is a matter of chance: each combination that a kernel's arrays have would wait for a compiler.
    """
    flat = np.ascontiguousarray(values, dtype=dtype).ravel()
    if flat.size == 1:  # its address would be compiled into the kernel
        return opaque(getattr(mi, kind), flat[0].item())
    memory = np.empty(flat.nbytes + ALIGNMENT_BYTES, np.uint8)
    begin = -memory.ctypes.data % ALIGNMENT_BYTES
    copy = memory[begin : begin + flat.nbytes].view(flat.dtype)
    copy[...] = flat
    return getattr(mi, kind)(copy)


unsigned = partial(_upload, "UInt32", np.uint32)
signed = partial(_upload, "Int32", np.int32)
floats = partial(_upload, "Float", np.float32)
doubles = partial(_upload, "Float64", np.float64)
whole = partial(_upload, "UInt64", np.uint64)
"""Each makes a flat array of `mi` and `values` of any shape."""


def vectors(mi: Any, kind: Any, rows: np.ndarray) -> Any:
    """Rows (N, 2 or 3) as points or vectors of this `kind`, of a compiled backend."""
    return kind(*(floats(mi, column) for column in rows.T))


def opaque(kind: Any, value: float) -> Any:
    """One number that is passed to kernels as data: as a constant it would be compiled into each."""
    return load_drjit().opaque(kind, value)


def gathered(array: Any, index: Any, active: Any = True) -> Any:
    """Elements of one of the backend's arrays; 0 where not active."""
    return load_drjit().gather(type(array), array, index, active)


@cache
def cuda_driver() -> str | None:
    """File name of the CUDA driver, if there is one: looking for it starts a compiler."""
    return ctypes.util.find_library("cuda")


def _candidates(request: str = "") -> Iterator[Backend]:
    """The backends of this machine, or those of one kind, each tried, best first."""
    check_installed()
    if request in ("", "cuda") and (driver := cuda_driver()):
        yield _trial("cuda", driver, "CUDA")
    for path in _llvm_libraries() if request in ("", "llvm") else ():
        yield _trial("llvm", str(path), f"LLVM {_llvm_version(path) or ''}".strip())
    if request in ("", "scalar"):
        yield Backend("scalar", VARIANTS["scalar"], None, True, "scalar mode needs no library")


def _trial(kind: str, library: str, name: str) -> Backend:
    """What the probe kernel showed in a subprocess, now or when libraries and devices were the same."""
    key = [kind, library, sys.version, platform.node(), version("mitsuba"), version("drjit")]
    if (driver := Path("/proc/driver/nvidia/version")).exists() and kind == "cuda":
        key += [driver.read_text(), os.environ.get("CUDA_VISIBLE_DEVICES", "")]
    if (path := Path(library).resolve()).exists():
        key += [str(path), str(path.stat().st_size), str(path.stat().st_mtime_ns)]

    def read(answer: dict[str, Any]) -> Backend:
        return Backend(kind, VARIANTS[kind], library, bool(answer["works"]), f"{name} {answer['detail']}")

    return cached("backend", key, lambda: _probe(kind, library), read)


def _probe(kind: str, library: str) -> dict[str, Any]:
    environment = os.environ | ({"DRJIT_LIBLLVM_PATH": library} if kind == "llvm" else {})
    # -P: no module is imported from the working directory.
    command = [sys.executable, "-P", "-c", _PROBE, VARIANTS[kind]]
    try:
        run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PROBE_LIMIT_S)
    except subprocess.TimeoutExpired:
        return {"works": False, "detail": f"did not answer within {PROBE_LIMIT_S} s"}
    if run.returncode < 0:
        return {"works": False, "detail": f"ended the trial process with signal {-run.returncode}"}
    last_line = (run.stderr.strip().splitlines() or ["no message"])[-1]
    detail = f"failed: {last_line[:200]}" if run.returncode else "works"
    return {"works": run.returncode == 0, "detail": detail}


def _llvm_libraries() -> list[Path]:
    """LLVM libraries of this machine: the one of DRJIT_LIBLLVM_PATH, or all, the newest first."""
    if path := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return [Path(path)]
    files = [file for folder in LIBRARY_FOLDERS for file in Path("/").glob(f"{folder}/libLLVM*.so*")]
    for folder in filter(None, os.environ.get("LD_LIBRARY_PATH", "").split(":")):
        files += Path(folder).glob("libLLVM*.so*")
    libraries = {file.resolve() for file in files if _llvm_version(file)}
    return sorted(libraries, key=lambda file: (-_llvm_version(file), file))


def _llvm_version(library: Path) -> int:
    """Major version from the library's file name, 0 if it does not say."""
    digits = re.match(r"libLLVM(?:-|\.so\.)(\d+)", library.resolve().name)
    return int(digits[1]) if digits else 0
