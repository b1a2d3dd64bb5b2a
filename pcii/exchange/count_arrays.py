"""Arrays of light and of photon counts, and stacks of frames of counts that are added up.

Frames of one bit are read by `photon_cubes`, which keeps the frame of each count.
"""

import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

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
    headers_of,
    is_picture,
    pages_of,
    views_of,
    warn,
)
from pcii.exchange.photon_cubes import FrameStack, binary_counts, frames_of_files, map_array, span_of_frames
from pcii.exchange.pixel_files import LARGEST_BYTES, Encoding, Picture, check_encoding, decode, to_radiance
from pcii.types.arrays import LARGEST_COUNT, whole_counts
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

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
    if isinstance(source, np.ndarray) or (pattern is None and not is_picture(Path(source))):
        stacks = _of_array(source, array, grid, order)
    elif pattern is None:
        stacks = _of_pages(Path(source), grid, order)
    else:
        paths = order.arrange(files_by_camera(Path(source), pattern, grid, order, tell))
        is_numpy = all(path.suffix == NUMPY for path in paths.flat)
        stacks = frames_of_files(paths, packed=False) if is_numpy else _of_pictures(paths, tell)
    first: FrameStack = stacks[0, 0]
    span = span_of_frames(frames, first.frames, first.name)
    cameras = optics.grid((*stacks.shape, first.height, first.row))
    check_size(Path(first.name), cameras.shape_KLHW)
    if first.dtype == np.bool_:
        return binary_counts(stacks, cameras, span, cfa=cfa, report=report, tell=tell)
    if first.dtype == np.uint8 and first.frames > 1:
        _warn_of_packed_bits(first, tell)
    # The smallest unsigned type that holds every sum; each number is at most 2^40, and so is a sum.
    is_whole = first.dtype.kind in "iu"
    most = min(np.iinfo(first.dtype).max, LARGEST_COUNT) if is_whole else LARGEST_COUNT
    dtype = np.min_scalar_type(min(int(most) * (span[1] - span[0]), 2 * LARGEST_COUNT))
    sums = np.zeros(cameras.shape_KLHW, dtype)
    for done, (camera, stack) in enumerate(np.ndenumerate(stacks), start=1):
        for frame in (frame for piece in stack.pieces(*span) for frame in piece):
            sums[camera] += whole_counts(stack.name, frame).astype(dtype, copy=False)
            if sums[camera].max(initial=0) > LARGEST_COUNT:
                raise InputError(f"{stack.name}: more than 2^40 photons in a pixel cannot be summed exactly")
        report("views", done, stacks.size)
    return PhotonCounts.from_dense(sums, cameras, cfa=cfa, frames=span[1] - span[0])


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


def _of_pictures(files: np.ndarray, tell: Tell) -> np.ndarray:
    """The pages of pictures, one for each view, as (K, L) of `FrameStack`."""
    stacks = np.empty(files.shape, object)
    for camera, picture in np.ndenumerate(headers_of(files, pages=True, tell=tell)):
        load = partial(lambda one: np.stack([page[..., 0] for page in decode(one)]), picture)
        stacks[camera] = _stack_of(picture, load, picture.pages)
    return stacks


def _of_pages(path: Path, grid: tuple[int, int] | None, order: ViewOrder) -> np.ndarray:
    """The pages of a file, of which each is a view, as (K, L) of `FrameStack`."""
    picture, size, pages = pages_of(path, grid, order)
    stacks = np.empty(size, object)
    for camera, pixels in pages:
        stacks[camera] = _stack_of(picture, partial(np.transpose, pixels, (2, 0, 1)), 1)
    return stacks


def _stack_of(picture: Picture, load: Callable[[], np.ndarray], frames: int) -> FrameStack:
    height, width, channels = picture.shape
    if channels != 1:
        raise InputError(f"{picture.path}: has {channels} channels; photon counts have one")
    return FrameStack(str(picture.path), load, picture.dtype, frames, height, width, packed=False)


def _of_array(
    source: str | Path | np.ndarray, array: str | None, grid: tuple[int, int] | None, order: ViewOrder
) -> np.ndarray:
    """The frames of each view of an array, (K, L) of `FrameStack`."""
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
        stacks[camera] = FrameStack.of(name, partial(views.__getitem__, camera), packed=False)
    return stacks


def _warn_of_packed_bits(stack: FrameStack, tell: Tell) -> None:
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
