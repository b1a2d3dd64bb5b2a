"""Photon counts of binary frames of all views: sums, and the single counts if they are few."""

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.camera_grid import CameraGrid
from pcii.core.photon_counts import PhotonCounts
from pcii.frames.binary_frames import (
    MOST_FRAMES_AT_ONCE,
    has_padding_set,
    number_set,
    packed_row,
    places_set,
    sum_of_frames,
)
from pcii.frames.frame_files import FrameFile

MOST_KEPT = 1 << 24
"""Most single counts of all views whose frames are kept."""
SEARCHED_BYTES = 1 << 18
"""Of frames that are searched for set bits at once: the search takes up to 500 times as much memory."""


def chosen_frames(asked: tuple[int, int] | None, frames: int, name: str) -> tuple[int, int]:
    """The first of the asked frames, from 0, and the one after the last; without asking, all of `frames`.

    Raises `InputError`, naming the source, for frames that are not there.
    """
    if asked is None:
        return 0, frames
    first, last = asked
    if not 0 <= first <= last < frames:
        raise InputError(
            f"{name}: has the frames 0 to {frames - 1}; expected two of them, the first and the last, got "
            f"{first} and {last}"
        )
    return first, last + 1


def check_width(files: np.ndarray, width: int, whence: str) -> None:
    """Raise `InputError` unless rows of packed files (K, L) have as many bytes as so many pixels need."""
    first: FrameFile = files[0, 0]
    if width < 1 or packed_row(width) != first.row:
        most = 8 * first.row
        raise InputError(
            f"{first.path}: its rows are of {most - 7} to {most} pixels, where {whence} says {width}; the "
            "width is wrong, or bits are packed along another axis"
        )


def binary_counts(
    files: np.ndarray,
    grid: CameraGrid,
    span: tuple[int, int],
    *,
    cfa: str | None = None,
    report: Report = silent,
) -> PhotonCounts:
    """Sums of the frames `span`, first and stop, of files (K, L) whose pixels are of one bit.

    Files are packed or of bool. Frames of the single counts are kept up to `MOST_KEPT` counts in all. Raises
    `InputError`, naming a file, for bits beyond the width of the grid, and for a file that ends early.
    """
    first, stop = span
    room = MOST_KEPT
    sums: np.ndarray | None = None
    kept: list[np.ndarray] = []
    for number, (camera, file) in enumerate(np.ndenumerate(files)):
        places, total = _read(file, span, grid, room)
        if total is None:
            room -= places.size
            kept.append(places)
        else:
            room = -1
            if sums is None:
                sums = np.zeros(grid.shape_KLHW, total.dtype)
                for before, events in enumerate(kept):
                    sums[divmod(before, grid.cols)] = _sums(events, span, grid)
                kept.clear()
            sums[camera] = total
        report("views", number + 1, files.size)
    frames = stop - first
    if sums is not None:
        return PhotonCounts.from_dense(sums, grid, cfa=cfa, frames=frames, bits=1)
    return _of_single_counts(kept, frames, grid, cfa)


def _read(
    file: FrameFile, span: tuple[int, int], grid: CameraGrid, room: int
) -> tuple[np.ndarray, np.ndarray | None]:
    """Single counts of a view if there is room for them, else none and the sum of its frames (H, W).

    A single count is the number of its pixel times the number of frames, plus its frame in the span; sorted.
    """
    first, stop = span
    kept: list[np.ndarray] = []
    total: np.ndarray | None = None
    begin = first
    for numbers in file.pieces(first, stop):
        frames = numbers if file.packed else np.packbits(numbers, axis=2)
        if has_padding_set(frames, grid.width):
            raise InputError(
                f"{file.path}: bits beyond the {grid.width} pixels of a row are set; the width is wrong, or "
                "bits are packed otherwise than numpy.packbits packs them along the width"
            )
        found = number_set(frames)
        if total is None and found > room:
            total = _sums(np.concatenate([*kept, np.empty(0, np.int64)]), span, grid)
            kept.clear()
        if total is None:
            some = max(SEARCHED_BYTES // frames[0].nbytes, 1)
            for low in range(0, len(frames), some):
                frame, i, j = places_set(frames[low : low + some])
                kept.append((i * grid.width + j) * (stop - first) + (begin + low - first) + frame)
            room -= found
        else:
            for low in range(0, len(frames), MOST_FRAMES_AT_ONCE):
                total += sum_of_frames(frames[low : low + MOST_FRAMES_AT_ONCE])[:, : grid.width]
        begin += len(frames)
    return np.sort(np.concatenate([*kept, np.empty(0, np.int64)])), total


def _sums(places: np.ndarray, span: tuple[int, int], grid: CameraGrid) -> np.ndarray:
    """The sum of frames (H, W) of single counts, of the smallest type that holds every such sum."""
    frames = span[1] - span[0]
    sums = np.bincount(places // frames, minlength=grid.height * grid.width)
    return sums.reshape(grid.shape_HW).astype(np.min_scalar_type(frames))


def _of_single_counts(kept: list[np.ndarray], frames: int, grid: CameraGrid, cfa: str | None) -> PhotonCounts:
    """Counts with their frames, of the single counts of each view."""
    # Of the smallest types: these lists are in memory beside the sorted ones.
    largest = {**dict(zip("klij", grid.shape_KLHW, strict=True)), "n": frames, "frame": frames}
    columns: dict[str, list[np.ndarray]] = {name: [] for name in largest}
    for number in range(len(kept)):
        pixel, frame = np.divmod(kept[number], frames)
        kept[number] = np.empty(0, np.int64)
        starts = np.flatnonzero(np.diff(pixel, prepend=-1))
        k, l = divmod(number, grid.cols)
        i, j = np.divmod(pixel[starts], grid.width)
        n = np.diff(starts, append=pixel.size)
        found = {"k": np.full(starts.size, k), "l": np.full(starts.size, l), "i": i, "j": j, "n": n}
        for name, values in (found | {"frame": frame}).items():
            columns[name].append(values.astype(np.min_scalar_type(largest[name])))
    k, l, i, j, n, frame = (np.concatenate(columns.pop(name)) for name in largest)
    return PhotonCounts.from_events(k, l, i, j, n, grid, cfa=cfa, frames=frames, bits=1, frame=frame)
