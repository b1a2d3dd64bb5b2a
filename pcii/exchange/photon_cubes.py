"""Photon cubes: frames of one bit a pixel, in NumPy files that may be larger than memory.

The frames of a view are (T, H, W) of bool or, packed, (T, H, ceil(W / 8)) of uint8: the first pixel of a row
is in the highest bit of its first byte, as numpy.packbits has it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.exchange.image_folders import (
    AS_STORED,
    Optics,
    Tell,
    ViewOrder,
    check_size,
    files_by_camera,
    warn,
)
from pcii.types.camera_grid import CameraGrid
from pcii.types.photon_counts import PhotonCounts

PIECE_BYTES = 1 << 23
"""Bytes of frames that are read at once."""
MOST_KEPT = 1 << 24
"""Largest number of single counts of all views whose frames are kept."""
FRAMES_AT_ONCE = 255
"""Their sum fits in a byte."""
FEWEST_PER_COLUMN = 10
"""Mean number of counts of a column from which an empty one is remarkable: e^-10 is the chance of one."""


@dataclass(frozen=True, eq=False)
class FrameStack:
    """T frames of a view, each of H rows of so many numbers: pixels, or bytes of eight pixels if `packed`.

    `load` returns the array (T, H, row), in memory or mapped from a file; a map is made anew for each piece,
    so that what was read leaves memory.
    """

    name: str
    load: Callable[[], np.ndarray]
    dtype: np.dtype[Any]
    frames: int
    height: int
    row: int
    packed: bool

    @classmethod
    def of(cls, name: str, load: Callable[[], np.ndarray], *, packed: bool) -> "FrameStack":
        """The frames that `load` returns; raises `InputError` for another shape or type."""
        array = load()
        if array.ndim != 3 or 0 in array.shape:
            expected = "(T, H, W / 8) with eight pixels in a byte" if packed else "(T, H, W)"
            raise InputError(f"{name}: expected frames {expected}, got {array.shape}")
        if packed and array.dtype != np.uint8:
            raise InputError(f"{name}: expected bits that are packed in uint8, got {array.dtype}")
        frames, height, row = array.shape
        return cls(name, load, array.dtype, frames, height, row, packed)

    def layout(self) -> str:
        """Shape and type in words, by which views are compared."""
        what = "bytes of eight pixels" if self.packed else f"pixels of {self.dtype}"
        return f"{self.frames} frames of {self.height} rows of {self.row} {what}"

    def pieces(self, first: int, stop: int) -> Iterator[np.ndarray]:
        """Frames `first` .. `stop` - 1 some at a time, (n, H, row)."""
        most = max(PIECE_BYTES // (self.height * self.row * self.dtype.itemsize), 1)
        array = self.load()
        for begin in range(first, stop, most):
            yield np.array(array[begin : min(begin + most, stop)])
            if isinstance(array, np.memmap):
                array = self.load()


def frames_of_files(paths: np.ndarray, *, packed: bool) -> np.ndarray:
    """Of a .npy file for each view, paths (K, L), their frames: (K, L) of `FrameStack`.

    A last axis of 1, the channel, may follow those of the frames. Raises `InputError`, naming a file, for any
    other, and for one that differs from the first.
    """
    stacks = np.empty(paths.shape, object)
    for camera, path in np.ndenumerate(paths):

        def load(path: Path = path) -> np.ndarray:
            numbers = map_array(path)
            return numbers[..., 0] if numbers.ndim == 4 and numbers.shape[3] == 1 else numbers

        stacks[camera] = stack = FrameStack.of(str(path), load, packed=packed)
        first: FrameStack = stacks[0, 0]
        if stack.layout() != first.layout():
            raise InputError(f"{path}: has {stack.layout()}, where {first.name} has {first.layout()}")
    return stacks


def map_array(path: Path) -> np.ndarray:
    """The array of a .npy file, mapped into memory; `InputError` for any other file."""
    try:
        numbers = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or visible(str(fault))})") from None
    except MemoryError:
        raise
    except Exception as fault:  # damaged headers raise various exceptions
        raise InputError(f"{path}: not a NumPy array ({visible(str(fault))})") from None
    if not isinstance(numbers, np.ndarray):
        raise InputError(f"{path}: is an archive; save a .npy file, which is read piece by piece")
    return numbers


def span_of_frames(frames: tuple[int, int] | None, count: int, name: str) -> tuple[int, int]:
    """The first of the requested frames, from 0, and the one after the last; by default all of `count`.

    Raises `InputError`, naming the source, for frames that are not there.
    """
    if frames is None:
        return 0, count
    first, last = frames
    if not 0 <= first <= last < count:
        raise InputError(
            f"{name}: has the frames 0 to {count - 1}; expected two of them, the first and the last, got "
            f"{first} and {last}"
        )
    return first, last + 1


def import_packed_frames(
    source: str | Path,
    optics: Optics,
    *,
    pattern: str | None = None,
    grid: tuple[int, int] | None = None,
    width: int | None = None,
    order: ViewOrder = AS_STORED,
    cfa: str | None = None,
    frames: tuple[int, int] | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> PhotonCounts:
    """Photon counts of packed frames: a folder of files (T, H, W / 8) by `pattern`, or (K, L, T, H, W / 8).

    One file may also be (K L, T, H, W / 8) of a `grid` (K, L). Rows are `width` pixels wide, by default all
    bits. For the other arguments see `pcii.import_counts`. Raises `InputError` for another shape or type, and
    for bits that are set beyond the width.
    """
    if pattern is not None:
        paths = order.arrange(files_by_camera(Path(source), pattern, grid, order, tell))
        stacks = frames_of_files(paths, packed=True)
    else:
        stacks = order.arrange(_frames_of_file(Path(source), grid, order))
    first: FrameStack = stacks[0, 0]
    width = 8 * first.row if width is None else width
    check_width(first, width, "--width")
    span = span_of_frames(frames, first.frames, first.name)
    cameras = optics.grid((*stacks.shape, first.height, width))
    return binary_counts(stacks, cameras, span, cfa=cfa, report=report, tell=tell)


def _frames_of_file(path: Path, grid: tuple[int, int] | None, order: ViewOrder) -> np.ndarray:
    """The frames of each view of one file, (A, B) of `FrameStack`, in the table of the file."""
    numbers = map_array(path)
    table = numbers.shape[:2] if grid is None else order.table_of(path, numbers.shape[0], grid)
    if numbers.ndim != 3 + len(table) - (grid is not None):
        expected = "(K, L, T, H, W / 8)" if grid is None else "(K L, T, H, W / 8)"
        raise InputError(f"{path}: expected {expected} with eight pixels in a byte, got {numbers.shape}")
    stacks = np.empty(table, object)
    for number, camera in enumerate(np.ndindex(*table)):
        place = camera if grid is None else (number,)
        stacks[camera] = FrameStack.of(str(path), lambda place=place: map_array(path)[place], packed=True)
    return stacks


def check_width(stack: FrameStack, width: int, whence: str) -> None:
    """Raise `InputError` unless rows of packed frames have as many bytes as so many pixels need."""
    if width < 1 or -(-width // 8) != stack.row:
        raise InputError(
            f"{stack.name}: its rows are of {8 * stack.row - 7} to {8 * stack.row} pixels, where {whence} "
            f"says {width}; the width is wrong, or bits are packed along another axis"
        )


def binary_counts(
    stacks: np.ndarray,
    grid: CameraGrid,
    span: tuple[int, int],
    *,
    cfa: str | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> PhotonCounts:
    """Sums of the frames `span`, first and stop, of (K, L) `FrameStack` whose pixels are of one bit.

    The frame of each single count is kept up to `MOST_KEPT` counts in all. `tell` takes what is left out.
    Raises `InputError`, naming a file, for bits that are set beyond the width of the grid.
    """
    frames = span[1] - span[0]
    check_size(Path(stacks[0, 0].name), grid.shape_KLHW)
    sums = np.zeros(grid.shape_KLHW, np.min_scalar_type(frames))
    total, columns = 0, []
    for number, (camera, stack) in enumerate(np.ndenumerate(stacks)):
        begin, places = 0, [np.empty(0, np.int64)]
        for piece in stack.pieces(*span):
            packed = piece if stack.packed else np.packbits(piece, axis=2)
            unused = 8 * packed.shape[2] - grid.width
            if unused and (packed[:, :, -1] & ((1 << unused) - 1)).any():
                raise InputError(
                    f"{stack.name}: bits beyond the {grid.width} pixels of a row are set; the width is "
                    "wrong, or bits are packed otherwise than numpy.packbits packs them along the width"
                )
            for low in range(0, len(packed), FRAMES_AT_ONCE):
                bits = np.unpackbits(packed[low : low + FRAMES_AT_ONCE], axis=2, count=grid.width)
                sums[camera] += np.add.reduce(bits, axis=0, dtype=np.uint8)
            total += int(np.bitwise_count(packed).sum(dtype=np.int64))
            if total <= MOST_KEPT:
                frame, i, j = places_of_bits(packed)
                places.append((i * grid.width + j) * frames + begin + frame)
            begin += len(packed)
        if total <= MOST_KEPT:
            columns.append(_columns(camera, np.sort(np.concatenate(places)), frames, grid))
        report("views", number + 1, stacks.size)
    _tell_of_columns(sums, stacks[0, 0].packed, tell)
    if total > MOST_KEPT:
        tell(
            f"only the sums of {frames} frames are kept: there are {total} counts, and the frame of each is "
            f"kept for up to {MOST_KEPT}"
        )
        return PhotonCounts.from_dense(sums, grid, cfa=cfa, frames=frames, bits=1)
    k, l, i, j, n, frame = (np.concatenate(column) for column in zip(*columns, strict=True))
    return PhotonCounts.from_events(k, l, i, j, n, grid, cfa=cfa, frames=frames, bits=1, frame=frame)


def places_of_bits(packed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, row and column of each set bit of packed frames (n, H, row), three arrays of integers.

    >>> frames = np.packbits([[[0, 1, 0, 0, 0, 0, 0, 0, 1, 1]]], axis=2)
    >>> [index.tolist() for index in places_of_bits(frames)]
    [[0, 0, 0], [0, 0, 0], [1, 8, 9]]
    """
    byte = np.flatnonzero(packed.ravel() != 0)
    of_byte, bit = np.nonzero(np.unpackbits(packed.ravel()[byte][:, None], axis=1))
    frame, i, column = np.unravel_index(byte[of_byte], packed.shape)
    return frame, i, 8 * column + bit


def _columns(
    camera: tuple[int, ...], places: np.ndarray, frames: int, grid: CameraGrid
) -> tuple[np.ndarray, ...]:
    """k, l, i, j, n of the pixels of a view, and the frame of each single count, of the smallest types.

    A place is the number of a pixel times `frames`, plus a frame; places are sorted.
    """
    pixel, frame = np.divmod(places, frames)
    starts = np.flatnonzero(np.diff(pixel, prepend=-1))
    i, j = np.divmod(pixel[starts], grid.width)
    k, l = (np.full(starts.size, index) for index in camera)
    n = np.diff(starts, append=pixel.size)
    largest = (*grid.shape_KLHW, frames, frames)
    numbers = (k, l, i, j, n, frame)
    return tuple(a.astype(np.min_scalar_type(most)) for a, most in zip(numbers, largest, strict=True))


def _tell_of_columns(sums: np.ndarray, packed: bool, tell: Tell) -> None:
    """Say how many bits of padding there are, and warn of columns at the end that count nothing."""
    width = sums.shape[3]
    if not packed:
        return
    if width % 8:
        tell(f"left out {-width % 8} padding bits at the end of each row, none of which is set")
    columns = sums.sum(axis=(0, 1, 2), dtype=np.int64)
    last = int(np.flatnonzero(columns).max(initial=-1))
    if 0 <= last < width - 1 and columns.sum() >= FEWEST_PER_COLUMN * width:
        tell(
            f"warning: the last {width - 1 - last} columns of {width} have no count in any view; if the "
            f"camera has fewer, import again with --width {last + 1}"
        )
