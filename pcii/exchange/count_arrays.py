"""Arrays of light and of photon counts, and files of photon counts, whose frames are added up.

The frames of a view are an array (T, H, W) or, packed, (T, H, ceil(W / 8)) of uint8: the first pixel of a row
is in the highest bit of its first byte, as numpy.packbits has it. Files may be larger than memory.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.exchange.image_folders import VIEWS, files_by_camera, is_picture, pages_of, views_of
from pcii.exchange.pixel_files import Encoding, decode, picture_of, to_radiance
from pcii.exchange.stated_cameras import AS_STORED, Optics, Tell, ViewOrder, warn
from pcii.types.arrays import whole_counts
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

PIECE_BYTES = 1 << 23
"""Bytes of frames that are read at once."""
MOST_KEPT = 1 << 24
"""Largest number of single counts of all views whose frames are kept."""
FRAMES_AT_ONCE = 255
"""Their sum fits in a byte."""
MIN_COLUMN_MEAN = 10
"""Mean number of counts of a column from which a column without any is warned of; by chance it is one in
e^10. If it is smaller, dim captures are warned of without a reason."""
EXACT = tuple(kind for kind in VIEWS if kind != "JPEG")
"""Kinds of pictures that keep photon counts."""
MIN_JUDGED_BYTES = 100
"""Number of bytes above 0 from which they are tested for packed bits. If it is smaller, chance decides."""


def import_arrays(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    grid: tuple[int, int] | None = None,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
) -> Views:
    """Radiance of an array (K, L, H, W) or (K, L, H, W, C), C = 1 or 3, or of a .npy file of one.

    With a `grid` (K, L) it is (K L, H, W) or (K L, H, W, C). Floats are linear, unless `encoding` says
    otherwise; whole numbers need it: they may be sRGB of pictures or linear values of a sensor, which the
    file does not tell. `cfa` is a Bayer pattern, of which arrays of one channel are mosaics. Raises
    `InputError` for what does not fit.
    """
    is_array = isinstance(source, np.ndarray)
    numbers, name = (source, "array") if is_array else (map_array(Path(source)), str(source))
    views = order.arrange(_by_camera(numbers, name, grid, order, "H, W[, C]"))
    if views.dtype.kind != "f" and views.dtype.newbyteorder("=") not in (np.uint8, np.uint16):
        raise InputError(f"{name}: expected float, uint8, uint16, or --counts for photons; got {views.dtype}")
    if views.ndim == 4:
        if grid is None and views.shape[3] in (3, 4):
            raise InputError(f"{name}: has the shape {numbers.shape}; give --grid if it is (N, H, W, C)")
        views = views[..., None]
    if views.ndim != 5 or 0 in views.shape or views.shape[4] not in (1, 3):
        raise InputError(f"{name}: expected (K, L, H, W) or (K, L, H, W, 1 or 3), got {numbers.shape}")
    if views.dtype.kind == "u" and encoding is None:
        raise InputError(
            f"{name}: {views.dtype} may be sRGB of pictures or linear values of a sensor; say which, with "
            "--srgb, --linear or --gamma (encoding)"
        )
    try:
        radiance = to_radiance(np.asarray(views), encoding)
    except InputError as fault:
        raise InputError(f"{name}: {fault}") from None
    return views_of(radiance, optics, cfa)


def import_counts(
    source: str | Path | np.ndarray,
    optics: Optics | CameraGrid,
    *,
    pattern: str | None = None,
    grid: tuple[int, int] | None = None,
    order: ViewOrder = AS_STORED,
    cfa: str | None = None,
    frames: tuple[int, int] | None = None,
    bitpack: bool = False,
    width: int | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> PhotonCounts:
    """Photon counts whose frames are added up, of a folder of files by `pattern`, or of an array.

    An array (K, L) of `Path` names the file of each view. A `CameraGrid` states the size of views too.
    A file of a view is a TIFF, each with as many pages, a grey PNG of 1, 8 or 16 bits, or a .npy file
    (N, H, W) or (H, W); for `pattern` and `grid`, and for one TIFF file whose pages are the views, see
    `import_images`. An array, or a .npy file of one, is (K, L, H, W) or, with N frames, (K, L, N, H, W);
    with a `grid` (K, L) it is (K L, H, W) or (K L, N, H, W). With `bitpack` arrays have frames of bits, eight
    pixels in a byte, whose rows are `width` pixels wide, by default all bits. `frames` are the first and the
    last to add up, from 0. The frame of each single count of bits and of arrays of bool is kept, up to 2^24
    counts. `tell` takes sentences on what is left out or looks wrong. Raises `InputError` for counts that are
    negative or fractional in any frame.
    """
    if width is not None and not bitpack:
        raise InputError("--width: is for packed frames; give --bitpack too")
    stacks = _stacks_of(source, pattern, grid, order, bitpack, tell)
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
    shape = (*stacks.shape, height, row)
    camera_grid = optics.grid(shape) if isinstance(optics, Optics) else optics
    if camera_grid.shape_KLHW != shape:
        stated = f"{camera_grid.height} x {camera_grid.width}"
        raise InputError(f"{name}: is {height} x {row} px, and {stated} are stated, rows x columns")
    is_binary = bitpack or first.dtype == np.bool_
    count = stop - begin
    sums = np.zeros(camera_grid.shape_KLHW, np.min_scalar_type(count) if is_binary else np.uint64)
    total, singles = 0, [np.empty((0, 5), np.int32)]
    for number, (camera, stack) in enumerate(np.ndenumerate(stacks)):
        array = stack.load()
        if (array.shape, array.dtype) != (first.shape, first.dtype):
            shapes = [f"{one.dtype} {one.shape}" for one in (array, first)]
            raise InputError(f"{stack.name}: has frames {shapes[0]}, where {name} has {shapes[1]}")
        most = max(PIECE_BYTES // max(array[0].nbytes, 1), 1)
        for start in range(begin, stop, most):
            piece = np.array(array[start : min(start + most, stop)])
            if isinstance(array, np.memmap):
                array = stack.load()  # a new map, so that what was read leaves memory
            if not is_binary:
                if number == 0 and start == begin:
                    _warn_of_packed_bytes(name, piece, tell)
                    _warn_of_multiples(name, whole_counts(name, piece), tell)
                sums[camera] += whole_counts(stack.name, piece).sum(axis=0, dtype=np.uint64)
            else:
                bits = np.unpackbits(piece, axis=2) if bitpack else piece.view(np.uint8)
                if bits[:, :, row:].any():
                    raise InputError(
                        f"{stack.name}: bits beyond the {row} pixels of a row are set; the width is wrong, "
                        "or bits are not packed along the width as numpy.packbits packs them"
                    )
                bits = bits[:, :, :row]
                for low in range(0, len(bits), FRAMES_AT_ONCE):
                    sums[camera] += np.add.reduce(bits[low : low + FRAMES_AT_ONCE], axis=0, dtype=np.uint8)
                total += int(np.count_nonzero(bits))
                if total <= MOST_KEPT:
                    frame, i, j = np.nonzero(bits)
                    k, l = (np.full(frame.size, index) for index in camera)
                    singles.append(np.stack([k, l, i, j, frame + start - begin], axis=1).astype(np.int32))
        report("views", number + 1, stacks.size)
    if not is_binary:
        return PhotonCounts.from_dense(sums, camera_grid, cfa=cfa, frames=count)
    if bitpack:
        _warn_of_dark_columns(sums, "--width" if isinstance(optics, Optics) else "w", tell)
    if total > MOST_KEPT:
        tell(
            f"only the sums of {count} frames are kept: there are {total} counts, and the frame of each is "
            f"kept for up to {MOST_KEPT}"
        )
        return PhotonCounts.from_dense(sums, camera_grid, cfa=cfa, frames=count, bits=1)
    k, l, i, j, frame = np.concatenate(singles).T
    n = np.ones(k.size, np.uint8)
    return PhotonCounts.from_events(k, l, i, j, n, camera_grid, cfa=cfa, frames=count, bits=1, frame=frame)


def _warn_of_packed_bytes(name: str, numbers: np.ndarray, tell: Tell) -> None:
    """Warn of bytes whose high bits are set about as often as the low ones; in dim counts they are rarer."""
    if numbers.dtype != np.uint8 or np.count_nonzero(numbers) < MIN_JUDGED_BYTES:
        return
    share = np.unpackbits(numbers[..., None], axis=-1).reshape(-1, 8).mean(axis=0)
    if share.max() < 0.4 and share[:4].sum() > share.sum() / 3:
        tell(f"warning: {name} looks like bits packed eight to a byte; if so, import again with --bitpack")


def _warn_of_multiples(name: str, numbers: np.ndarray, tell: Tell) -> None:
    """Warn of counts that are all multiples of a number, such as of binary pictures of 0 and 255."""
    step = int(np.gcd.reduce(numbers, axis=None))
    if step > 1 and np.count_nonzero(numbers) * np.log(step) > 20:  # by chance it is one in e^20
        tell(f"warning: all numbers of {name} are multiples of {step}; if that is one photon, divide by it")


def _warn_of_dark_columns(sums: np.ndarray, option: str, tell: Tell) -> None:
    """Warn of columns at the end of packed rows without a count in any view."""
    columns = sums.sum(axis=(0, 1, 2), dtype=np.int64)
    width, lit = columns.size, int(np.flatnonzero(columns).max(initial=-1)) + 1
    if lit < width and columns.sum() >= MIN_COLUMN_MEAN * width:
        is_padding = -(-lit // 8) == -(-width // 8)  # padding is less than a byte
        advice = f"import again with {option} {lit}" if is_padding else "cut them off the frames"
        what = f"the last {width - lit} columns of {width} have no count in any view"
        tell(f"warning: {what}; if the camera has fewer, {advice}")


def _by_camera(
    numbers: np.ndarray, name: str, grid: tuple[int, int] | None, order: ViewOrder, axes: str
) -> np.ndarray:
    """An array as (A, B, ...), the table of views as stored; of a `grid` its first axis counts the views."""
    if numbers.ndim < (4 if grid is None else 3):
        raise InputError(f"{name}: expected (K, L, {axes}), or with --grid (N, {axes}), got {numbers.shape}")
    if grid is None:
        return numbers
    return numbers.reshape(*order.table_of(name, numbers.shape[0], grid), *numbers.shape[1:])


def _frames_of(path: Path) -> np.ndarray:
    """The frames (T, H, row) of a view: pages of a picture, or a .npy file, which is mapped into memory."""
    if is_picture(path):
        return _without_colours(path, np.stack([*decode(picture_of(path, EXACT))]))
    numbers = map_array(path)
    numbers = numbers[None] if numbers.ndim == 2 else numbers
    return numbers[..., 0] if numbers.ndim == 4 and numbers.shape[3] == 1 else numbers  # one channel


def _without_colours(path: Path, pixels: np.ndarray) -> np.ndarray:
    """Pixels (..., H, W) of pages (..., H, W, 1)."""
    if pixels.shape[-1] != 1:
        raise InputError(f"{path}: has {pixels.shape[-1]} channels; photon counts have one")
    return pixels[..., 0]


class FrameStack(NamedTuple):
    """The frames of a view: `load` returns them, (T, H, row), in memory or mapped from a file `name`."""

    name: str
    load: Callable[[], np.ndarray]


def _stacks_of(
    source: str | Path | np.ndarray,
    pattern: str | None,
    grid: tuple[int, int] | None,
    order: ViewOrder,
    bitpack: bool,
    tell: Tell,
) -> np.ndarray:
    """The frames of each view, (K, L) of `FrameStack`."""
    is_table = isinstance(source, np.ndarray) and isinstance(next(iter(source.flat), None), Path)
    if pattern is not None or is_table:
        paths = source if is_table else files_by_camera(Path(str(source)), str(pattern), grid, order, tell)
        paths = order.arrange(np.asarray(paths))
        stacks = np.empty(paths.shape, object)
        for camera, path in np.ndenumerate(paths):
            stacks[camera] = FrameStack(str(path), partial(_frames_of, path))
        return stacks
    if not isinstance(source, np.ndarray) and is_picture(Path(source)):
        _, pages = pages_of(Path(source), grid, order, tell)
        source, grid, order = _without_colours(Path(source), pages), None, AS_STORED
    is_array = isinstance(source, np.ndarray)
    numbers, name = (source, "array") if is_array else (map_array(Path(source)), str(source))

    def arrange(numbers: np.ndarray) -> np.ndarray:
        views = order.arrange(_by_camera(numbers, name, grid, order, "[T,] H, W"))
        return views[:, :, None] if views.ndim == 4 and not bitpack else views

    def load(camera: tuple[int, int]) -> np.ndarray:
        return arrange(source if isinstance(source, np.ndarray) else map_array(Path(source)))[camera]

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


def map_array(path: Path) -> np.ndarray:
    """The array of a .npy file, mapped into memory; `InputError` for any other file."""
    try:
        numbers = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or visible(str(fault))})") from None
    except MemoryError:
        raise
    except Exception:  # damaged headers raise various exceptions
        raise InputError(f"{path}: not an array of numbers in a .npy file, as numpy.save writes it") from None
    if not isinstance(numbers, np.ndarray):
        raise InputError(f"{path}: is an archive; save a .npy file, which is read piece by piece")
    return numbers
