"""Photon counts of real detectors: arrays, or stacks of frames, of one bit each or more, added up."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.photon_counts import LARGEST_COUNT, PhotonCounts, whole_counts
from pcii.importing.array_files import opened_array
from pcii.importing.camera_order import AS_STORED, Optics, ViewOrder
from pcii.importing.file_patterns import files_by_camera
from pcii.importing.image_decoding import decode
from pcii.importing.image_folders import check_size, headers_of


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
    `grid` see `import_images`. An array, or a .npy or .npz file of one, is (K, L, H, W) or, with N frames,
    (K, L, N, H, W). Raises `InputError` for counts that are negative or fractional, in any frame.
    """
    if pattern is not None and not isinstance(source, np.ndarray):
        views, shape = _of_files(order.arranged(files_by_camera(Path(source), pattern, grid)))
    else:
        views, shape = _of_array(source, array, order)
    counts = np.zeros(shape, np.int64)
    K, L = shape[:2]
    for done, (camera, frames) in enumerate(zip(np.ndindex(K, L), views, strict=True), start=1):
        for name, frame in frames:
            counts[camera] += whole_counts(name, frame).astype(np.int64, copy=False)
            if counts[camera].max(initial=0) > LARGEST_COUNT:
                raise InputError(f"{name}: more than 2^40 photons in a pixel cannot be summed exactly")
        report("views", done, K * L)
    return PhotonCounts.from_dense(counts, optics.grid(shape), cfa=cfa)


Frames = Iterator[Iterator[tuple[str, np.ndarray]]]
"""For each view the name and the counts (H, W) of each of its frames."""


def _of_files(files: np.ndarray) -> tuple[Frames, tuple[int, ...]]:
    pictures = headers_of(files, pages=True)
    first = pictures[0, 0]
    if first.shape[2] != 1:
        raise InputError(f"{first.path}: has {first.shape[2]} channels; photon counts have one")
    check_size(first.path.parent, (2, *files.shape, *first.shape[:2]))
    views = (((str(picture.path), page[..., 0]) for page in decode(picture)) for picture in pictures.flat)
    return views, (*files.shape, *first.shape[:2])


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
    return (((name, frame) for frame in numbers[camera]) for camera in np.ndindex(K, L)), (K, L, H, W)
