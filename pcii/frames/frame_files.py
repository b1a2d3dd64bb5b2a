"""The frames of a view in a NumPy file, packed or not.

They are read into a small buffer. The pages of a memory map would count as memory of the process.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.pictures.array_headers import ArrayHeader, read_array_header

PIECE_BYTES = 1 << 23
"""Of what is read at once, but for larger frames."""


@dataclass(frozen=True)
class FrameFile:
    """T frames of a view, each of H rows of so many numbers: pixels, or bytes of eight pixels if `packed`."""

    path: Path
    dtype: np.dtype[Any]
    frames: int
    height: int
    row: int
    packed: bool
    start: int
    """Byte of the file at which the first frame begins."""

    def layout(self) -> str:
        """Shape and type in words, by which files of views are compared."""
        what = "bytes of eight pixels" if self.packed else f"pixels of {self.dtype}"
        return f"{self.frames} frames of {self.height} rows of {self.row} {what}"

    def pieces(self, first: int, stop: int) -> Iterator[np.ndarray]:
        """Frames `first` .. `stop` - 1 some at a time, (n, H, row); each array is overwritten by the next."""
        frame_bytes = self.height * self.row * self.dtype.itemsize
        most = min(max(PIECE_BYTES // frame_bytes, 1), stop - first)
        buffer = np.empty((most, self.height, self.row), self.dtype)
        try:
            with self.path.open("rb") as file:
                file.seek(self.start + first * frame_bytes)
                for begin in range(first, stop, most):
                    piece = buffer[: min(most, stop - begin)]
                    if file.readinto(piece.data.cast("B")) != piece.nbytes:
                        raise InputError(f"{self.path}: ends before frame {begin + len(piece) - 1}")
                    yield piece
        except OSError as fault:
            raise InputError(f"{self.path}: cannot be read ({fault.strerror})") from None


def files_of_views(paths: np.ndarray, *, packed: bool) -> np.ndarray:
    """Of a file for each view, paths (K, L), their frames: (K, L) of `FrameFile`.

    An array in a file is (T, H, W), or packed (T, H, W / 8), uint8; a last axis of 1 may follow, the channel.
    Raises `InputError`, naming a file, for any other, and for one that differs from the first.
    """
    files = np.empty(paths.shape, object)
    for camera, path in np.ndenumerate(paths):
        header, start = _header(path, packed=packed)
        shape = header.shape
        if len(shape) == 4 and shape[3] == 3:
            raise InputError(f"{path}: has frames in three colours, {shape}, and one channel is read")
        if len(shape) == 4 and shape[3] == 1:
            shape = shape[:3]
        if len(shape) != 3:
            raise InputError(f"{path}: expected {_axes('T, H', packed)}, got {header.shape}")
        files[camera] = file = FrameFile(path, header.dtype, *shape, packed, start)
        first: FrameFile = files[0, 0]
        if file.layout() != first.layout():
            raise InputError(f"{path}: has {file.layout()}, where {first.path} has {first.layout()}")
    return files


def packed_views_of(path: Path) -> np.ndarray:
    """The frames of each view, (K, L) of `FrameFile`, of one file with a packed array (K, L, T, H, W / 8).

    Raises `InputError` for any other.
    """
    header, start = _header(path, packed=True)
    if len(header.shape) != 5:
        raise InputError(f"{path}: expected {_axes('K, L, T, H', True)}, got {header.shape}")
    K, L, T, H, row = header.shape
    files = np.empty((K, L), object)
    for number in range(K * L):
        begin = start + number * T * H * row
        files.flat[number] = FrameFile(path, header.dtype, T, H, row, True, begin)
    return files


def _axes(names: str, packed: bool) -> str:
    return f"({names}, W / 8) with eight pixels in a byte" if packed else f"({names}, W)"


def _header(path: Path, *, packed: bool) -> tuple[ArrayHeader, int]:
    """The header of a file that has all its numbers, in the order of its axes, and where they begin."""
    try:
        if not path.is_file():
            raise InputError(f"{path}: there is no such file")
        with path.open("rb") as file:
            if file.read(2) == b"PK":
                raise InputError(f"{path}: is an archive; save a .npy file, which is read piece by piece")
            file.seek(0)
            header, start = read_array_header(file, path), file.tell()
        size = path.stat().st_size
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
    except (InputError, MemoryError):
        raise
    except Exception as fault:  # damaged headers raise various exceptions
        raise InputError(f"{path}: not a NumPy array ({visible(str(fault))})") from None
    if packed and header.dtype != np.uint8:
        raise InputError(f"{path}: expected bits that are packed in uint8, got {header.dtype}")
    if header.dtype.kind not in "biuf":
        raise InputError(f"{path}: photon counts must be whole numbers, got {visible(str(header.dtype))}")
    if not header.shape or min(header.shape) < 1:
        raise InputError(f"{path}: has no frames, its shape is {header.shape}")
    if header.is_fortran:
        raise InputError(f"{path}: is in Fortran's order; save numpy.ascontiguousarray of it")
    if size - start < header.size_bytes:
        raise InputError(
            f"{path}: cut off, it has {size - start} of the {header.size_bytes} bytes of {header.shape}"
        )
    return header, start
