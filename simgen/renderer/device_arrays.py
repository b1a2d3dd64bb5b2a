"""NumPy's arrays as the renderer's, and parts of those; for compiled backends."""

from typing import Any

import numpy as np

from simgen.renderer.backend import load_drjit

ALIGNMENT_BYTES = 64


def unsigned(mi: Any, values: np.ndarray) -> Any:
    """Whole numbers from 0 as a flat array of 32 bits."""
    return _upload(mi.UInt32, values, np.uint32)


def signed(mi: Any, values: np.ndarray) -> Any:
    """Whole numbers as a flat array of 32 bits."""
    return _upload(mi.Int32, values, np.int32)


def floats(mi: Any, values: np.ndarray) -> Any:
    """Numbers as a flat array in single precision."""
    return _upload(mi.Float, values, np.float32)


def doubles(mi: Any, values: np.ndarray) -> Any:
    """Numbers as a flat array in double precision."""
    return _upload(mi.Float64, values, np.float64)


def opaque(kind: Any, value: float) -> Any:
    """One number that is passed to kernels as data: as a constant it would be compiled into each."""
    return load_drjit().opaque(kind, value)


def gathered(array: Any, index: Any, active: Any = True) -> Any:
    """Elements of one of the renderer's arrays; 0 where not active."""
    return load_drjit().gather(type(array), array, index, active)


def _upload(kind: Any, values: np.ndarray, dtype: Any) -> Any:
    flat = np.ascontiguousarray(values, dtype=dtype).ravel()
    # Where NumPy happened to keep a single number is compiled into the kernel, if it is handed over.
    return opaque(kind, flat[0].item()) if flat.size == 1 else kind(_aligned(flat))


def _aligned(flat: np.ndarray) -> np.ndarray:
    """A copy (N,) that begins at a multiple of `ALIGNMENT_BYTES`.

    Where the renderer reads NumPy's memory in place its alignment is compiled into the kernel, and NumPy's
    own is a matter of chance: each combination that a kernel's arrays have would wait for a compiler.
    """
    memory = np.empty(flat.nbytes + ALIGNMENT_BYTES, np.uint8)
    begin = -memory.ctypes.data % ALIGNMENT_BYTES
    copy = memory[begin : begin + flat.nbytes].view(flat.dtype)
    copy[...] = flat
    return copy
