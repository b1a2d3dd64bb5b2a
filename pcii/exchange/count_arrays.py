"""Arrays of light and of photon counts, and files of photon counts, whose frames are added up.

The frames of a view are an array (T, H, W) or, packed, (T, H, ceil(W / 8)) of uint8: the first pixel of a row
is in the highest bit of its first byte, as numpy.packbits has it. Files may be larger than memory.
"""

import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.exchange.image_folders import VIEWS, check_size, files_by_camera, is_picture, pages_of, views_of
from pcii.exchange.pixel_files import LARGEST_BYTES, Encoding, check_encoding, decode, picture_of, to_radiance
from pcii.exchange.stated_cameras import AS_STORED, Optics, Tell, ViewOrder, warn
from pcii.types.arrays import whole_counts
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

NUMPY = ".npy"
PIECE_BYTES = 1 << 23
"""Bytes of frames that are read at once."""
MOST_KEPT = 1 << 24
"""Largest number of single counts of all views whose frames are kept."""
FRAMES_AT_ONCE = 255
"""Their sum fits in a byte."""
FEWEST_PER_COLUMN = 10
"""Mean number of counts of a column from which an empty one is remarkable: e^-10 is the chance of one."""
FEWEST_BYTES = 100
"""Numbers above 0 of which it is judged whether they are packed bits."""


def import_arrays(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    array: str | None = None,
    grid: tuple[int, int] | None = None,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
) -> Views:
    """Radiance of an array (K, L, H, W) or (K, L, H, W, C), C = 1 or 3, or of a .npy or .npz file of one.

    With a `grid` (K, L) it is (K L, H, W) or (K L, H, W, C). `array` names one of several arrays of an .npz
    file. Floats are linear, unless `encoding` says otherwise; whole numbers need it: they may be sRGB of
    pictures or linear values of a sensor, which the file does not tell. `cfa` is a Bayer pattern, of
    which arrays of one channel are mosaics. Raises `InputError` for what does not fit.
    """
    check_encoding(encoding)
    numbers, name = open_array(source, array)
    views = order.arrange(_by_camera(numbers, name, grid, order, "H, W[, C]"))
    if views.ndim == 4:
        if grid is None and views.shape[3] in (3, 4):
            raise InputError(f"{name}: has the shape {numbers.shape}; give --grid if it is (N, H, W, C)")
        views = views[..., None]
    if views.ndim != 5 or 0 in views.shape or views.shape[4] not in (1, 3):
        raise InputError(f"{name}: expected (K, L, H, W) or (K, L, H, W, 1 or 3), got {numbers.shape}")
    if views.dtype.kind != "f" and views.dtype.newbyteorder("=") not in (np.uint8, np.uint16):
        raise InputError(f"{name}: expected float, uint8 or uint16, got {views.dtype}")
    if views.dtype.kind == "u" and encoding is None:
        raise InputError(
            f"{name}: {views.dtype} may be sRGB of pictures or linear values of a sensor; say which, with "
            "--srgb, --linear or --gamma (encoding)"
        )
    check_size(Path(name), views.shape)
    radiance = np.empty(views.shape, np.float32)
    for camera in np.ndindex(*views.shape[:2]):
        try:
            radiance[camera] = to_radiance(views[camera], encoding)
        except InputError as fault:
            raise InputError(f"{name}: view {camera} {fault}") from None
    return views_of(radiance, optics, cfa)


def import_counts(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    pattern: str | None = None,
    grid: tuple[int, int] | None = None,
    array: str | None = None,
    order: ViewOrder = AS_STORED,
    cfa: str | None = None,
    frames: tuple[int, int] | None = None,
    bitpack: bool = False,
    width: int | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> PhotonCounts:
    """Photon counts whose frames are added up, of a folder of files by `pattern`, or of an array.

    A file of a view is a TIFF, each with as many pages, a grey PNG of 1, 8 or 16 bits, or a .npy file of N
    frames (N, H, W); for `pattern` and `grid`, and for one TIFF file whose pages are the views, see
    `import_images`. An array, or a .npy or .npz file of one, is (K, L, H, W) or, with N frames,
    (K, L, N, H, W); with a `grid` (K, L) it is (K L, H, W) or (K L, N, H, W). With `bitpack` arrays have
    frames of bits, eight pixels in a byte, whose rows are `width` pixels wide, by default all bits. `frames`
    are the first and the last to add up, from 0. The frame of each single count of bits and of arrays of bool
    is kept, up to 2^24 counts. `tell` takes sentences on what is left out or looks wrong. Raises `InputError`
    for counts that are negative or fractional in any frame.
    """
    if width is not None and not bitpack:
        raise InputError("--width: is for packed frames; give --bitpack too")
    if isinstance(source, np.ndarray) or (pattern is None and not is_picture(Path(source))):
        stacks = _of_array(source, array, grid, order, bitpack)
    elif array is not None:
        raise InputError(f"{source}: --array names an array of a .npz file")
    elif pattern is None:
        stacks = _of_pages(Path(source), grid, order, tell)
    else:
        paths = order.arrange(files_by_camera(Path(source), pattern, grid, order, tell))
        is_numpy = bitpack or all(path.suffix == NUMPY for path in paths.flat)
        stacks = frames_of_files(paths) if is_numpy else _of_pictures(paths, tell)
    return add_frames(
        stacks, optics.grid, frames=frames, bitpack=bitpack, width=width, cfa=cfa, report=report, tell=tell
    )


def open_array(source: str | Path | np.ndarray, array: str | None = None) -> tuple[np.ndarray, str]:
    """An array, from a file if need be, and its name for messages; `InputError` if it cannot be read."""
    if isinstance(source, np.ndarray):
        return source, "array"
    path = Path(source)
    if path.is_file() and zipfile.is_zipfile(path):
        return _from_npz(path, array)
    if array is not None:
        raise InputError(f"{path}: has one array without a name; leave out --array")
    return map_array(path), str(path)


def _from_npz(path: Path, array: str | None) -> tuple[np.ndarray, str]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            names = archive.files
            name = names[0] if array is None and len(names) == 1 else array
            if name is None or name not in names:
                raise InputError(f"{path}: name one of its arrays by --array: {', '.join(names[:9])}")
            if archive.zip.getinfo(name + NUMPY).file_size > LARGEST_BYTES:
                raise InputError(f"{path}: {name} is larger than {LARGEST_BYTES >> 30} GiB; save a .npy file")
            return archive[name], f"{path}: {name}"
    except InputError:
        raise
    except (KeyError, ValueError, EOFError, OSError, zipfile.BadZipFile) as fault:
        raise InputError(f"{path}: cannot be read ({visible(str(fault))})") from None


def _by_camera(
    numbers: np.ndarray, name: str, grid: tuple[int, int] | None, order: ViewOrder, axes: str
) -> np.ndarray:
    """An array as (A, B, ...), the table of views as stored; of a `grid` its first axis counts the views."""
    if grid is None:
        return numbers
    if numbers.ndim < 3:
        raise InputError(f"{name}: expected (N, {axes}) with --grid, got {numbers.shape}")
    return numbers.reshape(*order.table_of(name, numbers.shape[0], grid), *numbers.shape[1:])


def _of_pictures(files: np.ndarray, tell: Tell) -> np.ndarray:
    """The pages of pictures, one for each view, as (K, L) of `FrameStack`."""
    stacks, first = np.empty(files.shape, object), files[0, 0]

    def load(path: Path) -> np.ndarray:
        return np.stack([_without_colours(path, page) for page in decode(picture_of(path, VIEWS))])

    for camera, path in np.ndenumerate(files):
        stacks[camera] = FrameStack(str(path), partial(load, path))
    unused = picture_of(first, VIEWS).unused
    if unused:
        tell(f"not used: {unused} in {first.name}")
    return stacks


def _of_pages(path: Path, grid: tuple[int, int] | None, order: ViewOrder, tell: Tell) -> np.ndarray:
    """The pages of a file, of which each is a view, as (K, L) of `FrameStack`."""
    _, pages = pages_of(path, grid, order, tell)
    stacks = np.empty(pages.shape[:2], object)
    for camera in np.ndindex(*stacks.shape):
        frame = _without_colours(path, pages[camera])[None]
        stacks[camera] = FrameStack(str(path), partial(np.asarray, frame))
    return stacks


def _without_colours(path: Path, pixels: np.ndarray) -> np.ndarray:
    """Pixels (H, W) of a page (H, W, 1)."""
    if pixels.shape[2] != 1:
        raise InputError(f"{path}: has {pixels.shape[2]} channels; photon counts have one")
    return pixels[..., 0]


def _of_array(
    source: str | Path | np.ndarray,
    array: str | None,
    grid: tuple[int, int] | None,
    order: ViewOrder,
    bitpack: bool,
) -> np.ndarray:
    """The frames of each view of an array, (K, L) of `FrameStack`."""
    numbers, name = open_array(source, array)

    def arrange(numbers: np.ndarray) -> np.ndarray:
        views = order.arrange(_by_camera(numbers, name, grid, order, "H, W) or (N, T, H, W"))
        return views[:, :, None] if views.ndim == 4 and not bitpack else views

    def load(camera: tuple[int, int]) -> np.ndarray:
        if isinstance(numbers, np.memmap) and not isinstance(source, np.ndarray):
            return arrange(map_array(Path(source)))[camera]
        return arrange(numbers)[camera]

    views = arrange(numbers)
    if views.ndim != 5 or 0 in views.shape:
        shape = "(K, L, T, H, W / 8) of packed bits" if bitpack else "(K, L, H, W) or (K, L, N, H, W)"
        raise InputError(f"{name}: expected {shape}, or with --grid one axis of views, got {numbers.shape}")
    if grid is None and numbers.ndim == 4 and numbers.shape[3] in (3, 4):
        raise InputError(f"{name}: has the shape {numbers.shape}, with colours last; photon counts have none")
    stacks = np.empty(views.shape[:2], object)
    for camera in np.ndindex(*stacks.shape):
        stacks[camera] = FrameStack(name, partial(load, camera))
    return stacks


@dataclass(frozen=True, eq=False)
class FrameStack:
    """The frames of a view: `load` returns them, (T, H, row), in memory or mapped from a file `name`."""

    name: str
    load: Callable[[], np.ndarray]

    def pieces(self, array: np.ndarray, first: int, stop: int) -> Iterator[np.ndarray]:
        """Frames `first` .. `stop` - 1 some at a time, (n, H, row), of the loaded `array`."""
        most = max(PIECE_BYTES // max(array[0].nbytes, 1), 1)
        for begin in range(first, stop, most):
            yield np.array(array[begin : min(begin + most, stop)])
            if isinstance(array, np.memmap):
                array = self.load()  # a new map, so that what was read leaves memory


def add_frames(
    stacks: np.ndarray,
    grid_of: Callable[[tuple[int, ...]], CameraGrid],
    *,
    frames: tuple[int, int] | None = None,
    bitpack: bool = False,
    width: int | None = None,
    cfa: str | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> PhotonCounts:
    """Sums of the frames of (K, L) `FrameStack`, whose grid is `grid_of` their shape (K, L, H, W).

    `frames` are the first and the last to add up, by default all; `width` is that of packed frames, by
    default all bits. Of bits, packed or bool, the frame of each single count is kept up to `MOST_KEPT` counts
    in all. `tell` takes what is left out or looks wrong. Raises `InputError`, naming a file, for views that
    differ, frames that are not there, bits that are set beyond the width, and numbers that are no counts.
    """
    name, first = stacks[0, 0].name, stacks[0, 0].load()
    if first.ndim != 3 or 0 in first.shape or (bitpack and first.dtype != np.uint8):
        expected = "uint8 (T, H, W / 8) with eight pixels in a byte" if bitpack else "(T, H, W)"
        raise InputError(f"{name}: expected frames {expected}, got {first.dtype} {first.shape}")
    begin, stop = (0, len(first)) if frames is None else (frames[0], frames[1] + 1)
    if not 0 <= begin < stop <= len(first):
        raise InputError(
            f"{name}: has the frames 0 to {len(first) - 1}; expected two of them, the first and the last, "
            f"got {begin} and {stop - 1}"
        )
    height, row = first.shape[1:]
    if bitpack and width is not None and -(-width // 8) != row:
        raise InputError(
            f"{name}: its rows are of {8 * row - 7} to {8 * row} pixels, and the stated width is {width}; it "
            "is wrong, or bits are packed along another axis"
        )
    if bitpack:
        row = width or 8 * row
    grid = grid_of((*stacks.shape, height, row))
    check_size(Path(name), grid.shape_KLHW)
    is_binary = bitpack or first.dtype == np.bool_
    count = stop - begin
    sums = np.zeros(grid.shape_KLHW, np.min_scalar_type(count) if is_binary else np.uint64)
    total, singles = 0, [np.empty((0, 5), np.int32)]
    for number, (camera, stack) in enumerate(np.ndenumerate(stacks)):
        array = stack.load()
        if (array.shape, array.dtype) != (first.shape, first.dtype):
            shapes = [f"{one.dtype} {one.shape}" for one in (array, first)]
            raise InputError(f"{stack.name}: has frames {shapes[0]}, where {name} has {shapes[1]}")
        offset = 0
        for piece in stack.pieces(array, begin, stop):
            if not is_binary:
                if piece.dtype == np.uint8 and number == offset == 0:
                    _warn_of_packed_bits(name, piece, tell)
                sums[camera] += whole_counts(stack.name, piece).sum(axis=0, dtype=np.uint64)
            else:
                packed = piece if bitpack else np.packbits(piece, axis=2)
                _add_bits(sums[camera], packed, stack.name)
                total += int(np.bitwise_count(packed).sum(dtype=np.int64))
                if total <= MOST_KEPT:
                    frame, i, j = places_of_bits(packed)
                    k, l = (np.full(frame.size, index) for index in camera)
                    singles.append(np.stack([k, l, i, j, frame + offset], axis=1).astype(np.int32))
            offset += len(piece)
        report("views", number + 1, stacks.size)
    if not is_binary:
        return PhotonCounts.from_dense(sums, grid, cfa=cfa, frames=count)
    if bitpack:
        _tell_of_columns(sums, tell)
    if total > MOST_KEPT:
        tell(
            f"only the sums of {count} frames are kept: there are {total} counts, and the frame of each is "
            f"kept for up to {MOST_KEPT}"
        )
        return PhotonCounts.from_dense(sums, grid, cfa=cfa, frames=count, bits=1)
    k, l, i, j, frame = np.concatenate(singles).T
    n = np.ones(k.size, np.uint8)
    return PhotonCounts.from_events(k, l, i, j, n, grid, cfa=cfa, frames=count, bits=1, frame=frame)


def _add_bits(sums: np.ndarray, packed: np.ndarray, name: str) -> None:
    """Add packed frames (n, H, row) to the sums (H, W) of a view."""
    width = sums.shape[1]
    unused = 8 * packed.shape[2] - width
    if unused and (packed[:, :, -1] & ((1 << unused) - 1)).any():
        raise InputError(
            f"{name}: bits beyond the {width} pixels of a row are set; the width is wrong, or bits are not "
            "packed along the width as numpy.packbits packs them"
        )
    for low in range(0, len(packed), FRAMES_AT_ONCE):
        bits = np.unpackbits(packed[low : low + FRAMES_AT_ONCE], axis=2, count=width)
        sums += np.add.reduce(bits, axis=0, dtype=np.uint8)


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


def frames_of_files(paths: np.ndarray) -> np.ndarray:
    """The frames of a .npy file for each view, paths (K, L), as (K, L) of `FrameStack`.

    A last axis of 1, the channel, may follow those of the frames.
    """
    stacks = np.empty(paths.shape, object)
    for camera, path in np.ndenumerate(paths):

        def load(path: Path = path) -> np.ndarray:
            numbers = map_array(path)
            return numbers[..., 0] if numbers.ndim == 4 and numbers.shape[3] == 1 else numbers

        stacks[camera] = FrameStack(str(path), load)
    return stacks


def _tell_of_columns(sums: np.ndarray, tell: Tell) -> None:
    """Say how many bits of padding there are, and warn of columns at the end that count nothing."""
    width = sums.shape[3]
    if width % 8:
        tell(f"left out {-width % 8} padding bits at the end of each row, none of which is set")
    columns = sums.sum(axis=(0, 1, 2), dtype=np.int64)
    last = int(np.flatnonzero(columns).max(initial=-1))
    if 0 <= last < width - 1 and columns.sum() >= FEWEST_PER_COLUMN * width:
        tell(
            f"warning: the last {width - 1 - last} columns of {width} have no count in any view; if the "
            f"camera has fewer, import again with --width {last + 1}"
        )


def _warn_of_packed_bits(name: str, numbers: np.ndarray, tell: Tell) -> None:
    """Warn of numbers that look like eight pixels in a byte: of which high bits are set as often as low ones.

    Of bright counts the lowest bit is set in half of the numbers.
    """
    share = np.unpackbits(numbers[..., None], axis=-1).reshape(-1, 8).mean(axis=0)
    if np.count_nonzero(numbers) >= FEWEST_BYTES and share.max() < 0.4 and share[:4].sum() > share.sum() / 3:
        tell(
            f"warning: {name} looks like bits packed eight to a byte, of which the numbers are no counts; if "
            "they are, import again with --bitpack"
        )
