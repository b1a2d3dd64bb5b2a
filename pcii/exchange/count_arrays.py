"""Arrays of light and of photon counts, and stacks of frames of counts that are added up.

Frames of one bit are read by `photon_cubes`, which keeps the frame of each count.
"""

import math
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.core.arrays import LARGEST_COUNT, whole_counts
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.exchange.image_folders import (
    AS_STORED,
    Optics,
    Tell,
    ViewOrder,
    check_size,
    files_by_camera,
    headers_of,
    is_picture,
    pages_of,
    views_of,
    warn,
)
from pcii.exchange.photon_cubes import BitFrames, binary_counts, frames_of_files, map_array, span_of_frames
from pcii.exchange.pixel_files import LARGEST_BYTES, Encoding, Picture, check_encoding, decode, to_radiance

NUMPY = ".npy"
HIGH_BITS = (16, 32, 64, 128)
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
    return views_of(radiance, optics.grid(radiance.shape), cfa)


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
    report: Report = silent,
    tell: Tell = warn,
) -> PhotonCounts:
    """Photon counts whose frames are added up, of a folder of files by `pattern`, or of an array.

    A file of a view is a TIFF, each with as many pages, a grey PNG of 1, 8 or 16 bits, or a .npy file of N
    frames (N, H, W); for `pattern` and `grid`, and for one TIFF file whose pages are the views, see
    `import_images`. An array, or a .npy or .npz file of one, is (K, L, H, W) or, with N frames,
    (K, L, N, H, W); with a `grid` (K, L) it is (K L, H, W) or (K L, N, H, W). `frames` are the first and the
    last to add up, from 0. The frame of each single count of arrays of bool is kept, up to 2^24 counts.
    `tell` takes sentences on what is left out or looks wrong. Raises `InputError` for counts that are
    negative or fractional in any frame.
    """
    if pattern is not None and not isinstance(source, np.ndarray):
        folder = Path(source)
        paths = order.arrange(files_by_camera(folder, pattern, grid, order, tell))
        if all(path.suffix == NUMPY for path in paths.flat):
            stacks = frames_of_files(paths, packed=False)
        else:
            return _added_up(_of_files(folder, paths, frames, tell), optics, cfa, report)
    elif not isinstance(source, np.ndarray) and is_picture(Path(source)):
        return _added_up(_of_pages(Path(source), grid, order, frames), optics, cfa, report)
    else:
        stacks = _of_array(source, array, grid, order)
    first: BitFrames = stacks[0, 0]
    span = span_of_frames(frames, first.frames, first.name)
    if first.dtype == np.bool_:
        cameras = optics.grid((*stacks.shape, first.height, first.row))
        return binary_counts(stacks, cameras, span, cfa=cfa, report=report, tell=tell)
    views = (
        (camera, ((stack.name, frame) for piece in stack.pieces(*span) for frame in piece))
        for camera, stack in np.ndenumerate(stacks)
    )
    shape = (*stacks.shape, first.height, first.row)
    if first.dtype == np.uint8 and first.frames > 1:
        _warn_of_packed_bits(first, tell)
    return _added_up(
        _Stack(Path(first.name), shape, first.dtype, span[1] - span[0], views), optics, cfa, report
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
    with zipfile.ZipFile(path) as archive:
        sizes = {member.filename.removesuffix(NUMPY): member.file_size for member in archive.infolist()}
    if array is None and len(sizes) != 1:
        raise InputError(f"{path}: has {len(sizes)} arrays; name one by --array: {', '.join([*sizes][:9])}")
    chosen = array or next(iter(sizes))
    if chosen not in sizes:
        raise InputError(f"{path}: has no array {chosen!r}; there are {', '.join([*sizes][:9])}")
    if sizes[chosen] > LARGEST_BYTES:
        raise InputError(f"{path}: {chosen} unpacks to {sizes[chosen] >> 30} GiB; save it as a .npy file")
    try:
        with np.load(path, allow_pickle=False) as loaded:
            return loaded[chosen], f"{path}: {chosen}"
    except (ValueError, EOFError, OSError, zipfile.BadZipFile) as fault:
        raise InputError(f"{path}: {chosen} cannot be read ({visible(str(fault))})") from None


def _by_camera(
    numbers: np.ndarray, name: str, grid: tuple[int, int] | None, order: ViewOrder, axes: str
) -> np.ndarray:
    """An array as (A, B, ...), the table of views as stored; of a `grid` its first axis counts the views."""
    if grid is None:
        return numbers
    if numbers.ndim < 3:
        raise InputError(f"{name}: expected (N, {axes}) with --grid, got {numbers.shape}")
    return numbers.reshape(*order.table_of(name, numbers.shape[0], grid), *numbers.shape[1:])


Frames = Iterable[tuple[str, np.ndarray]]
"""Name and counts (H, W) of each frame of a view."""


@dataclass(frozen=True, eq=False)
class _Stack:
    """Frames of views of the shape (K, L, H, W), of numbers of a `dtype`."""

    name: Path
    shape: tuple[int, ...]
    dtype: np.dtype
    frames: int
    views: Iterator[tuple[tuple[int, ...], Frames]]
    """For each camera (k, l) the frames that are added up."""


def _added_up(stack: _Stack, optics: Optics, cfa: str | None, report: Report) -> PhotonCounts:
    most = {"b": 1, "f": LARGEST_COUNT}.get(stack.dtype.kind)
    if most is None:
        most = min(np.iinfo(stack.dtype).max, LARGEST_COUNT) if stack.dtype.kind in "iu" else LARGEST_COUNT
    # The smallest unsigned type that holds every sum; each number is at most 2^40, and so is a sum.
    dtype = np.min_scalar_type(min(int(most) * stack.frames, 2 * LARGEST_COUNT))
    check_size(stack.name, stack.shape)
    counts = np.zeros(stack.shape, dtype)
    for done, (camera, frames) in enumerate(stack.views, start=1):
        for name, frame in frames:
            counts[camera] += whole_counts(name, frame).astype(dtype, copy=False)
            if counts[camera].max(initial=0) > LARGEST_COUNT:
                raise InputError(f"{name}: more than 2^40 photons in a pixel cannot be summed exactly")
        report("views", done, math.prod(stack.shape[:2]))
    bits = 1 if stack.dtype.kind == "b" else None
    return PhotonCounts.from_dense(counts, optics.grid(stack.shape), cfa=cfa, frames=stack.frames, bits=bits)


def _of_files(folder: Path, files: np.ndarray, frames: tuple[int, int] | None, tell: Tell) -> _Stack:
    pictures = headers_of(files, pages=True, tell=tell)
    first = pictures[0, 0]
    _check_grey(first)
    start, stop = span_of_frames(frames, first.pages, str(first.path))
    views = (
        (camera, ((str(picture.path), page[..., 0]) for page in [*decode(picture)][start:stop]))
        for camera, picture in np.ndenumerate(pictures)
    )
    return _Stack(folder, (*files.shape, *first.shape[:2]), first.dtype, stop - start, views)


def _of_pages(
    path: Path, grid: tuple[int, int] | None, order: ViewOrder, frames: tuple[int, int] | None
) -> _Stack:
    span_of_frames(frames, 1, str(path))
    picture, size, pages = pages_of(path, grid, order)
    _check_grey(picture)
    views = ((camera, [(str(path), pixels[..., 0])]) for camera, pixels in pages)
    return _Stack(path, (*size, *picture.shape[:2]), picture.dtype, 1, views)


def _check_grey(picture: Picture) -> None:
    if picture.shape[2] != 1:
        raise InputError(f"{picture.path}: has {picture.shape[2]} channels; photon counts have one")


def _of_array(
    source: str | Path | np.ndarray, array: str | None, grid: tuple[int, int] | None, order: ViewOrder
) -> np.ndarray:
    """The frames of each view of an array, (K, L) of `BitFrames`."""
    numbers, name = open_array(source, array)
    views = _by_camera(numbers, name, grid, order, "H, W) or (N, T, H, W")
    views = views[:, :, None] if views.ndim == 4 else views
    if views.ndim != 5 or 0 in views.shape:
        raise InputError(f"{name}: expected (K, L, H, W) or (K, L, N, H, W), got {numbers.shape}")
    if grid is None and numbers.ndim == 4 and numbers.shape[3] in (3, 4):
        raise InputError(f"{name}: has the shape {numbers.shape}, with colours last; photon counts have none")
    views = order.arrange(views)
    stacks = np.empty(views.shape[:2], object)
    for camera in np.ndindex(*stacks.shape):
        stacks[camera] = BitFrames.of(name, lambda camera=camera: views[camera], packed=False)
    return stacks


def _warn_of_packed_bits(stack: BitFrames, tell: Tell) -> None:
    """Warn of numbers that look like eight pixels in a byte: single bits, high ones as often as low ones."""
    piece = next(stack.pieces(0, stack.frames))
    histogram = np.bincount(piece.ravel(), minlength=256)
    single = histogram[1 << np.arange(8)].sum()
    seen = histogram[1:].sum()
    if seen >= FEWEST_BYTES and 2 * single >= seen and 4 * histogram[list(HIGH_BITS)].sum() >= single:
        tell(
            f"warning: {stack.name} looks like bits packed eight to a byte, of which the numbers are no "
            "counts; if they are, import again with --bitpack"
        )
