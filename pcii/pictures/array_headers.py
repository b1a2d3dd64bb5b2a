"""Headers of NumPy files, read and checked before any number is."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from pcii.base.errors import InputError

LARGEST_BYTES = 1 << 34
"""Most bytes of an array in a file, 16 GiB."""


@dataclass(frozen=True)
class ArrayHeader:
    """Shape and type of an array as the head of a .npy file says them."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    is_fortran: bool

    @property
    def size_bytes(self) -> int:
        """Bytes of all numbers."""
        return math.prod(self.shape) * self.dtype.itemsize


def read_array_header(file: IO[bytes], path: Path) -> ArrayHeader:
    """The header at which `file` stands, of which messages say `path`; the numbers follow.

    Raises `InputError` for objects and for more bytes than are allowed, and ValueError for no header.
    """
    version = np.lib.format.read_magic(file)
    read: Any = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    shape, is_fortran, dtype = read(file)
    if dtype.hasobject:
        raise InputError(f"{path}: holds Python objects; save plain numbers")
    header = ArrayHeader(shape, dtype, is_fortran)
    if header.size_bytes > LARGEST_BYTES:
        size = header.size_bytes / 2**30
        raise InputError(f"{path}: {size:.1f} GiB, and at most {LARGEST_BYTES / 2**30:g} are read")
    return header
