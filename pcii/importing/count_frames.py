"""Photon counts of real detectors: arrays, or stacks of frames, of one bit each or more, added up."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.arrays import LARGEST_COUNT, whole_counts
from pcii.core.photon_counts import PhotonCounts
from pcii.frames.cube_folders import CubeFolder
from pcii.frames.frame_files import FrameFile, files_of_views, packed_views_of
from pcii.frames.frame_sums import MOST_KEPT, binary_counts, check_width, chosen_frames
from pcii.importing.array_files import opened_array
from pcii.importing.camera_order import AS_STORED, Optics, ViewOrder
from pcii.importing.file_patterns import files_by_camera
from pcii.importing.image_folders import LARGEST_BYTES, headers_of, is_picture, pages_of
from pcii.pictures.picture_files import Picture, decode

NUMPY = ".npy"


def import_counts(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    pattern: str | None = None,
    grid: tuple[int, int] | None = None,
    array: str | None = None,
    order: ViewOrder = AS_STORED,
    cfa: str | None = None,
    bitpack: bool = False,
    width: int | None = None,
    frames: tuple[int, int] | None = None,
    report: Report = silent,
) -> PhotonCounts:
    """Photon counts whose frames are added up, of a folder of files by `pattern`, or of an array.

    A file of a view is a TIFF, each with as many pages, a grey PNG of 1, 8 or 16 bits, or a .npy file of N
    frames (N, H, W); for `pattern` and `grid`, and for one TIFF file whose pages are the views, see
    `import_images`. An array, or a .npy or .npz file of one, is (K, L, H, W) or, with N frames,
    (K, L, N, H, W). With `bitpack` .npy files are of bits, packed along the width as numpy.packbits does, of
    `width` pixels (default: all bits): (N, H, W / 8) or (K, L, N, H, W / 8). `frames` are the first and the
    last to add up, from 0. The frames of single counts are kept of packed files and of those of bool by
    `pattern`, up to 2^24 counts. Raises `InputError` for counts that are negative or fractional, in any
    frame, and for bits that are set beyond the width.
    """
    if width is not None and not bitpack:
        raise InputError("--width: is for --bitpack; other files tell how wide they are")
    paths = None
    if pattern is not None and not isinstance(source, np.ndarray):
        paths = order.arranged(files_by_camera(Path(source), pattern, grid))
    if bitpack:
        files = _packed(source, paths, array, order)
        return _of_bits(files, optics, width, frames, cfa, report)
    if paths is not None and all(path.suffix == NUMPY for path in paths.flat):
        files = files_of_views(paths, packed=False)
        if files.flat[0].dtype == np.bool_:
            return _of_bits(files, optics, None, frames, cfa, report)
        stack = _of_numpy_files(files, frames)
    elif paths is not None:
        stack = _of_files(paths, frames)
    elif not isinstance(source, np.ndarray) and is_picture(Path(source)):
        stack = _of_pages(Path(source), grid, order, frames)
    else:
        stack = _of_array(source, array, order, frames)
    return _added_up(stack, optics, cfa, report)


def import_cube(
    folder: CubeFolder,
    *,
    cfa: str | None = None,
    frames: tuple[int, int] | None = None,
    report: Report = silent,
) -> PhotonCounts:
    """Photon counts of a folder of photon cubes, or of its `frames`, the first and the last of them.

    `cfa` is the Bayer pattern where the folder tells none.
    """
    first: FrameFile = folder.files[0, 0]
    span = chosen_frames(frames, first.frames, str(first.path))
    _check_room(first.path, folder.grid.shape_KLHW, np.min_scalar_type(span[1] - span[0]))
    return binary_counts(folder.files, folder.grid, span, cfa=folder.cfa or cfa, report=report)


def notes_on_frames(counts: PhotonCounts, width: int | None) -> list[str]:
    """What is to be said of counts of frames; `width` in px of packed ones, None for that of all bits."""
    notes = []
    if width is not None and width % 8:
        notes.append(f"left out {-width % 8} padding bits at the end of each row, none of which is set")
    if counts.readout.frames > 1 and counts.readout.bits == 1 and counts.frame is None:
        why = f": there are {counts.total} counts, and the frame of each is kept for up to {MOST_KEPT}"
        many = counts.total > MOST_KEPT
        notes.append(f"only the sums of {counts.readout.frames} frames are kept{why if many else ''}")
    return notes


def _packed(
    source: str | Path | np.ndarray, paths: np.ndarray | None, array: str | None, order: ViewOrder
) -> np.ndarray:
    if isinstance(source, np.ndarray):
        raise InputError("bitpack: is for .npy files; give an array unpacked by numpy.unpackbits")
    if array is not None:
        raise InputError(f"{source}: packed frames are in .npy files, whose array has no name")
    if paths is not None:
        return files_of_views(paths, packed=True)
    return order.arranged(packed_views_of(Path(source)))


def _of_bits(
    files: np.ndarray,
    optics: Optics,
    width: int | None,
    frames: tuple[int, int] | None,
    cfa: str | None,
    report: Report,
) -> PhotonCounts:
    """Counts of files of bits, packed or of bool."""
    first: FrameFile = files[0, 0]
    wide = first.row * (8 if first.packed else 1) if width is None else width
    if first.packed:
        check_width(files, wide, "--width")
    span = chosen_frames(frames, first.frames, str(first.path))
    shape = (*files.shape, first.height, wide)
    _check_room(first.path, shape, np.min_scalar_type(span[1] - span[0]))
    return binary_counts(files, optics.grid(shape), span, cfa=cfa, report=report)


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
    """For each camera (k, l) the chosen frames."""


def _added_up(stack: _Stack, optics: Optics, cfa: str | None, report: Report) -> PhotonCounts:
    dtype = _type_of_sums(stack)
    _check_room(stack.name, stack.shape, dtype)
    counts = np.zeros(stack.shape, dtype)
    K, L = stack.shape[:2]
    for done, (camera, frames) in enumerate(stack.views, start=1):
        for name, frame in frames:
            counts[camera] += whole_counts(name, frame).astype(dtype, copy=False)
            if counts[camera].max(initial=0) > LARGEST_COUNT:
                raise InputError(f"{name}: more than 2^40 photons in a pixel cannot be summed exactly")
        report("views", done, K * L)
    bits = 1 if stack.dtype.kind == "b" else None
    return PhotonCounts.from_dense(counts, optics.grid(stack.shape), cfa=cfa, frames=stack.frames, bits=bits)


def _type_of_sums(stack: _Stack) -> np.dtype:
    """The smallest unsigned type that holds every sum; each number is at most 2^40, and so is a sum."""
    most = {"b": 1, "f": LARGEST_COUNT}.get(stack.dtype.kind)
    if most is None:
        most = min(np.iinfo(stack.dtype).max, LARGEST_COUNT) if stack.dtype.kind in "iu" else LARGEST_COUNT
    return np.min_scalar_type(min(int(most) * stack.frames, 2 * LARGEST_COUNT))


def _check_room(name: Path, shape: tuple[int, ...], dtype: np.dtype) -> None:
    """Raise `InputError` if the sums and a copy of them need more memory than is allowed."""
    needed = 2 * int(np.prod(shape, dtype=object)) * dtype.itemsize
    if needed > LARGEST_BYTES:
        raise InputError(
            f"{name}: counts of {' x '.join(map(str, shape))} need {needed / 2**30:.1f} GiB, and at most "
            f"{LARGEST_BYTES / 2**30:g} are allowed; leave views out"
        )


def _of_files(files: np.ndarray, frames: tuple[int, int] | None) -> _Stack:
    pictures = headers_of(files, pages=True)
    first: Picture = pictures[0, 0]
    span = chosen_frames(frames, first.pages, str(first.path))
    views = (
        (camera, ((str(picture.path), page[..., 0]) for page in islice(decode(picture), *span)))
        for camera, picture in np.ndenumerate(pictures)
    )
    shape = _checked_shape(first, files.shape)
    return _Stack(first.path.parent, shape, first.dtype, span[1] - span[0], views)


def _of_numpy_files(files: np.ndarray, frames: tuple[int, int] | None) -> _Stack:
    first: FrameFile = files[0, 0]
    span = chosen_frames(frames, first.frames, str(first.path))
    views = (
        (camera, ((str(file.path), frame) for piece in file.pieces(*span) for frame in piece))
        for camera, file in np.ndenumerate(files)
    )
    shape = (*files.shape, first.height, first.row)
    return _Stack(first.path.parent, shape, first.dtype, span[1] - span[0], views)


def _of_pages(
    path: Path, grid: tuple[int, int] | None, order: ViewOrder, frames: tuple[int, int] | None
) -> _Stack:
    chosen_frames(frames, 1, str(path))
    picture, size, pages = pages_of(path, grid, order)
    views = ((camera, [(str(path), pixels[..., 0])]) for camera, pixels in pages)
    return _Stack(path, _checked_shape(picture, size), picture.dtype, 1, views)


def _checked_shape(first: Picture, size: tuple[int, ...]) -> tuple[int, ...]:
    """Shape (K, L, H, W) of counts of which `first` is one of `size` views; `InputError` for colours."""
    height, width, channels = first.shape
    if channels != 1:
        raise InputError(f"{first.path}: has {channels} channels; photon counts have one")
    return (*size, height, width)


def _of_array(
    source: str | Path | np.ndarray,
    array: str | None,
    order: ViewOrder,
    frames: tuple[int, int] | None,
) -> _Stack:
    numbers, name = opened_array(source, array)
    if numbers.ndim == 4:
        numbers = numbers[:, :, None]
    if numbers.ndim != 5 or 0 in numbers.shape:
        raise InputError(f"{name}: expected (K, L, H, W) or (K, L, N, H, W), got {numbers.shape}")
    first, stop = chosen_frames(frames, numbers.shape[2], name)
    numbers = order.arranged(numbers)[:, :, first:stop]
    K, L, N, H, W = numbers.shape
    views = ((camera, ((name, frame) for frame in numbers[camera])) for camera in np.ndindex(K, L))
    return _Stack(Path(name), (K, L, H, W), numbers.dtype, N, views)
