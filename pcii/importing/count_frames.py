"""Photon counts of real detectors: arrays, or stacks of frames, of one bit each or more, added up."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.arrays import LARGEST_COUNT, whole_counts
from pcii.core.photon_counts import PhotonCounts
from pcii.importing.array_files import opened_array
from pcii.importing.camera_order import AS_STORED, Optics, ViewOrder
from pcii.importing.file_patterns import files_by_camera
from pcii.importing.image_folders import check_size, headers_of, is_picture, pages_of
from pcii.pictures.picture_files import Picture, decode


def import_counts(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    pattern: str | None = None,
    grid: tuple[int, int] | None = None,
    array: str | None = None,
    order: ViewOrder = AS_STORED,
    cfa: str | None = None,
    report: Report = silent,
) -> PhotonCounts:
    """Photon counts whose frames are added up, of a folder of files by `pattern`, or of an array.

    A file of a view is a TIFF, each with as many pages, or a grey PNG of 1, 8 or 16 bits; for `pattern` and
    `grid`, and for one TIFF file whose pages are the views, see `import_images`. An array, or a .npy or .npz
    file of one, is (K, L, H, W) or, with N frames, (K, L, N, H, W). Raises `InputError` for counts that are
    negative or fractional, in any frame.
    """
    if isinstance(source, np.ndarray):
        views, shape = _of_array(source, array, order)
    elif pattern is not None:
        views, shape = _of_files(order.arranged(files_by_camera(Path(source), pattern, grid)))
    elif is_picture(Path(source)):
        views, shape = _of_pages(Path(source), grid, order)
    else:
        views, shape = _of_array(source, array, order)
    counts = np.zeros(shape, np.int64)
    K, L = shape[:2]
    for done, (camera, frames) in enumerate(views, start=1):
        for name, frame in frames:
            counts[camera] += whole_counts(name, frame).astype(np.int64, copy=False)
            if counts[camera].max(initial=0) > LARGEST_COUNT:
                raise InputError(f"{name}: more than 2^40 photons in a pixel cannot be summed exactly")
        report("views", done, K * L)
    return PhotonCounts.from_dense(counts, optics.grid(shape), cfa=cfa)


Frames = Iterator[tuple[tuple[int, ...], Iterable[tuple[str, np.ndarray]]]]
"""For each camera (k, l) the name and the counts (H, W) of each of its frames."""


def _of_files(files: np.ndarray) -> tuple[Frames, tuple[int, ...]]:
    pictures = headers_of(files, pages=True)
    shape = _checked_shape(pictures[0, 0], files.shape)
    views = (
        (camera, ((str(picture.path), page[..., 0]) for page in decode(picture)))
        for camera, picture in np.ndenumerate(pictures)
    )
    return views, shape


def _of_pages(path: Path, grid: tuple[int, int] | None, order: ViewOrder) -> tuple[Frames, tuple[int, ...]]:
    picture, size, pages = pages_of(path, grid, order)
    shape = _checked_shape(picture, size)
    return ((camera, [(str(path), pixels[..., 0])]) for camera, pixels in pages), shape


def _checked_shape(first: Picture, size: tuple[int, ...]) -> tuple[int, ...]:
    """Shape (K, L, H, W) of counts of which `first` is one of `size` views; `InputError` for colours."""
    height, width, channels = first.shape
    if channels != 1:
        raise InputError(f"{first.path}: has {channels} channels; photon counts have one")
    check_size(first.path.parent, (2, *size, height, width))
    return (*size, height, width)


def _of_array(
    source: str | Path | np.ndarray, array: str | None, order: ViewOrder
) -> tuple[Frames, tuple[int, ...]]:
    numbers, name = opened_array(source, array)
    if numbers.ndim == 4:
        numbers = numbers[:, :, None]
    if numbers.ndim != 5 or 0 in numbers.shape:
        raise InputError(f"{name}: expected (K, L, H, W) or (K, L, N, H, W), got {numbers.shape}")
    numbers = order.arranged(numbers)
    K, L, _, H, W = numbers.shape
    check_size(Path(name), (2, K, L, H, W))
    views = ((camera, ((name, frame) for frame in numbers[camera])) for camera in np.ndindex(K, L))
    return views, (K, L, H, W)
