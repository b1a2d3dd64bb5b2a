"""Arrays of light, and photon counts of arrays and files, whose frames are added up.

How frames are kept is a `FrameFormat`, where they are `frame_stacks`.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pcii.base import InputError, Report, silent
from pcii.exchange.array_files import open_array
from pcii.exchange.frame_formats import (
    AS_COUNTED,
    SURE_NATS,
    FrameFormat,
    expected_above_one,
    warn_of_bit_order,
    warn_of_dark_columns,
    warn_of_numbers,
)
from pcii.exchange.frame_stacks import FrameFiles, FrameStack, ViewTable, stacks_of
from pcii.exchange.image_folders import views_of
from pcii.exchange.pixel_files import Encoding, to_radiance
from pcii.exchange.stated_cameras import AS_STORED, Note, Optics, ViewOrder, warn
from pcii.types import CameraGrid, PhotonCounts, Views, mosaic

PIECE_BYTES = 1 << 23
"""Bytes of frames that are read at once."""
MOST_KEPT = 1 << 24
"""Largest number of single counts of all views whose frames are kept."""
FRAMES_AT_ONCE = 255
"""Their sum fits in a byte."""


def import_arrays(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    grid: tuple[int, int] | None = None,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    axes: str | None = None,
    key: str | None = None,
) -> Views:
    """Radiance of an array (K, L, H, W) or (K, L, H, W, C), C = 1 or 3, or of a file of one.

    With a `grid` (K, L) it is (K L, H, W) or (K L, H, W, C); or its `axes` are named, such as "HWKL", N
    being views. Files are .npy, .npz, .mat and HDF5, of which `key` names one of several arrays. Floats are
    linear, unless `encoding` says otherwise; whole numbers need it: they may be sRGB of pictures or linear
    values of a sensor, which the file does not say. `cfa` is a Bayer pattern, of which arrays of one channel
    are mosaics. Raises `InputError` for what does not fit.
    """
    is_array = isinstance(source, np.ndarray)
    numbers, name = (source, "array") if is_array else (open_array(Path(source), key), str(source))
    views = ViewTable(grid=grid, order=order, axes=axes).by_camera(numbers, name, "H, W[, C]")
    if views.dtype.kind != "f" and views.dtype.newbyteorder("=") not in (np.uint8, np.uint16):
        raise InputError(f"{name}: expected float, uint8, uint16, or --counts for photons; got {views.dtype}")
    if views.ndim == 4:
        if grid is None and axes is None and views.shape[3] in (3, 4):
            raise InputError(
                f"{name}: has the shape {numbers.shape}; give --grid if it is (N, H, W, C), or --axes"
            )
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
    axes: str | None = None,
    key: str | None = None,
    frames: tuple[int, int] | None = None,
    stored: FrameFormat = AS_COUNTED,
    report: Report = silent,
    note: Note = warn,
) -> PhotonCounts:
    """Photon counts whose frames are added up, of a folder of files by `pattern`, or of an array.

    An array (K, L) of `Path` names the file of each view. A `CameraGrid` states the size of views too.
    A file of a view is a TIFF, each with as many pages, a grey PNG of 1, 8 or 16 bits, an array (N, H, W) or
    (H, W) in a .npy, .npz, .mat or HDF5 file, in which `key` names it, or has no header (see `FrameFormat`);
    with {frame} in the pattern it is one frame.
    For `pattern` and `grid`, and for one TIFF file whose pages are the views, see `import_images`. An array,
    or a file of one, is (K, L, H, W) or, with N frames, (K, L, N, H, W); with a `grid` (K, L) it is
    (K L, H, W) or (K L, N, H, W); or its `axes` are named, such as "HWKL" or "NTHW", N being views and T
    frames. Of frames in three channels each pixel keeps the colour of its filter in
    `cfa`. `stored` says how frames are kept, `frames` are the first and the last to add up, from 0. The frame
    of each single count of frames of one bit is kept, up to 2^24 counts. `note` takes sentences on what is
    left out or looks wrong. Raises `InputError` for counts that are negative or fractional in any frame.
    """
    stored.check()
    stacks = stacks_of(source, pattern, ViewTable(grid=grid, order=order, axes=axes), key, stored, note)
    name, first = stacks[0, 0].name, stacks[0, 0].load()
    _check_frames(name, first, stored, cfa)
    begin, stop = (0, len(first)) if frames is None else (frames[0], frames[1] + 1)
    if not 0 <= begin < stop <= len(first):
        raise InputError(
            f"{name}: has the frames 0 to {len(first) - 1}; expected two of them, the first and the last, "
            f"got {begin} and {stop - 1}"
        )
    shape = (*stacks.shape, first.shape[1], stored.width_of(name, first.shape[2]))
    camera_grid = optics.grid(shape) if isinstance(optics, Optics) else optics
    if camera_grid.shape_KLHW != shape:
        stated = f"{camera_grid.height} x {camera_grid.width}"
        raise InputError(f"{name}: is {shape[2]} x {shape[3]} px, and {stated} are stated, rows x columns")
    is_binary = stored.bitpack or first.dtype == np.bool_ or stored.bits == 1
    total = _Sum(camera_grid, stop - begin, 1 if is_binary else stored.bits)
    dead = stored.dead_pixels(camera_grid.shape_HW)
    for number, (camera, stack) in enumerate(np.ndenumerate(stacks)):
        for start, piece in _pieces(stack, name, first, begin, stop):
            if number == 0 and start == begin:
                warn_of_numbers(name, piece, stored, note)
            counts = stored.counts_of(stack.name, piece, dead)
            if cfa is not None and counts.ndim == 4:
                counts = mosaic(counts, cfa)
            total.add(camera, start - begin, counts)
        report("views", number + 1, stacks.size)
    if dead is not None:
        note(f"{np.count_nonzero(dead)} pixels of --mask count nothing")
    if stored.bitpack:
        warn_of_dark_columns(total.sums, "--width" if isinstance(optics, Optics) else "w", note)
        warn_of_bit_order(total.sums, stored.bit_order or "big", cfa, note)
    return total.photon_counts(cfa, name, note)


def _check_frames(name: str, frames: np.ndarray | FrameFiles, stored: FrameFormat, cfa: str | None) -> None:
    """Raise `InputError` for frames of a view that are not (T, H, row), or in three channels of a `cfa`."""
    if frames.ndim not in (3, 4) or 0 in frames.shape or (stored.bitpack and frames.dtype != np.uint8):
        expected = "uint8 (T, H, W / 8) with eight pixels in a byte" if stored.bitpack else "(T, H, W)"
        raise InputError(f"{name}: expected frames {expected}, got {frames.dtype} {frames.shape}")
    if frames.ndim == 4 and (frames.shape[3] != 3 or cfa is None):
        raise InputError(
            f"{name}: has {frames.shape[3]} channels; photon counts have one, or three of which --cfa says "
            "which one each pixel keeps"
        )


def _pieces(
    stack: FrameStack, name: str, first: np.ndarray | FrameFiles, begin: int, stop: int
) -> Iterator[tuple[int, np.ndarray]]:
    """Frames `begin` to `stop` of a view piece by piece, each with the number of its first one.

    Raises `InputError` for frames of another shape or type than the `first` ones, those of the file `name`.
    """
    frames = stack.load()
    if (frames.shape, frames.dtype) != (first.shape, first.dtype):
        shapes = [f"{one.dtype} {one.shape}" for one in (frames, first)]
        raise InputError(f"{stack.name}: has frames {shapes[0]}, where {name} has {shapes[1]}")
    most = max(PIECE_BYTES // max(frames[:1].nbytes, 1), 1)
    for start in range(begin, stop, most):
        piece = np.array(frames[start : min(start + most, stop)])
        if isinstance(frames, np.memmap):
            frames = stack.load()  # a new map, so that what was read leaves memory
        yield start, piece


class _Sum:
    """The sums of frames, and as long as none counts more than 1 and they are few, the frame of each count.

    `bits` are those of a frame, None if it may count without a limit.
    """

    def __init__(self, grid: CameraGrid, frames: int, bits: int | None) -> None:
        self.grid, self.frames, self.bits = grid, frames, bits
        most = np.iinfo(np.uint64).max if bits is None else frames * ((1 << bits) - 1)
        self.sums = np.zeros(grid.shape_KLHW, np.min_scalar_type(most))
        self.singles: list[np.ndarray] | None = [np.empty((0, 5), np.int32)]
        self.number, self.is_above_one = 0, False

    def add(self, camera: tuple[int, ...], first: int, counts: np.ndarray) -> None:
        """Add frames (T, H, W) of a camera, from the frame number `first` on."""
        self.is_above_one |= self.bits != 1 and bool(counts.max(initial=0) > 1)
        if self.is_above_one:
            self.singles = None
            self.sums[camera] += counts.sum(axis=0, dtype=np.uint64).astype(self.sums.dtype)
            return
        bits = counts.astype(np.uint8, copy=False)
        for low in range(0, len(bits), FRAMES_AT_ONCE):
            self.sums[camera] += np.add.reduce(bits[low : low + FRAMES_AT_ONCE], axis=0, dtype=np.uint8)
        self.number += int(np.count_nonzero(bits))
        if self.singles is not None and self.number <= MOST_KEPT:
            frame, i, j = np.nonzero(bits)
            k, l = (np.full(frame.size, index) for index in camera)
            self.singles.append(np.stack([k, l, i, j, frame + first], axis=1).astype(np.int32))

    def photon_counts(self, cfa: str | None, name: str, note: Note) -> PhotonCounts:
        """The counts; of numbers 0 and 1 alone in light that would give others as frames of one bit."""
        if self.bits is None and not self.is_above_one:
            expected = expected_above_one(self.number, self.sums.size * self.frames)
            if expected > SURE_NATS:
                note(
                    f"{name} is taken for frames of one bit: no pixel of a frame counts more than 1, where "
                    f"{expected:.3g} would by chance; if they are not, give --bits 8"
                )
                self.bits = 1
        options = {"cfa": cfa, "frames": self.frames, "bits": self.bits}
        if self.bits != 1:
            return PhotonCounts.from_dense(self.sums, self.grid, **options)
        if self.singles is None or self.number > MOST_KEPT:
            note(
                f"only the sums of {self.frames} frames are kept: there are {self.number} counts, and the "
                f"frame of each is kept for up to {MOST_KEPT}"
            )
            return PhotonCounts.from_dense(self.sums, self.grid, **options)
        k, l, i, j, frame = np.concatenate(self.singles).T
        n = np.ones(k.size, np.uint8)
        return PhotonCounts.from_events(k, l, i, j, n, self.grid, frame=frame, **options)
