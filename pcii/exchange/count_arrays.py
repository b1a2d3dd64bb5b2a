"""Photon counts of arrays and files, whose frames are added up, and what looks wrong in their numbers.

Where frames are and how they are kept is in `frame_files`.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pcii.base import InputError, Report, silent
from pcii.exchange.frame_files import (
    AS_COUNTED,
    MOST_BITS,
    BitOrder,
    FrameFiles,
    FrameFormat,
    FrameStack,
    stacks_of,
)
from pcii.exchange.stated_images import AS_STORED, Note, Optics, ViewOrder, ViewTable, warn
from pcii.types import CameraGrid, PhotonCounts, mosaic

SURE_NATS = 20.0
"""How much evidence a sentence on the numbers needs: by chance alone one import in e^20 would get it."""
MIN_COLUMN_MEAN = 10
"""Mean number of counts of a column from which a column without any is warned of; by chance it is one in
e^10. If it is smaller, dim captures are warned of without a reason."""
MIN_JUDGED = 100
"""Numbers above 0 from which they are judged. If it is smaller, chance decides."""
NARROW = 0.5
"""Share of the scatter of photon counts below their median from which they are taken to have an offset."""
SURE_DEVIATIONS = 6.0
"""Standard errors from which the order of bits is taken to be the other one."""
PIECE_BYTES = 1 << 23
"""Bytes of frames that are read at once."""
MOST_KEPT = 1 << 24
"""Largest number of single counts of all views whose frames are kept."""


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

    An array (K, L) of `Path` names the file of each view. A `CameraGrid` states the size of views too. A file
    of a view is a TIFF, each with as many pages, a grey PNG of 1, 8 or 16 bits, an array (N, H, W) or (H, W)
    in a .npy, .npz, .mat or HDF5 file, in which `key` names it, or has no header (see `FrameFormat`); with
    {frame} in the pattern it is one frame. For `pattern` and `grid`, and for one TIFF file whose pages are
    the views, see `import_images`. An array, or a file of one, is (K, L, H, W) or, with N frames,
    (K, L, N, H, W); with a `grid` (K, L) it is (K L, H, W) or (K L, N, H, W); or its `axes` are named, such
    as "HWKL" or "NTHW", N being views and T frames. Of frames in three channels each pixel keeps the colour
    of its filter in `cfa`. `stored` says how frames are kept, `frames` are the first and the last to add up,
    from 0. The frame of each single count of frames of one bit is kept, up to 2^24 counts. `note` takes
    sentences on what is left out or looks wrong. Raises `InputError` for counts that are negative or
    fractional in any frame.
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
                _warn_of_numbers(name, piece, stored, note)
            counts = stored.counts_of(stack.name, piece, dead)
            if cfa is not None and counts.ndim == 4:
                counts = mosaic(counts, cfa)
            total.add(camera, start - begin, counts)
        report("views", number + 1, stacks.size)
    if dead is not None:
        note(f"{np.count_nonzero(dead)} pixels of --mask count nothing")
    if stored.bitpack:
        _warn_of_dark_columns(total.sums, note)
        _warn_of_bit_order(total.sums, stored.bit_order or "big", cfa, note)
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
        self.singles = [np.empty((0, 5), np.int32)]
        self.number, self.is_above_one = 0, False

    def add(self, camera: tuple[int, ...], first: int, counts: np.ndarray) -> None:
        """Add frames (T, H, W) of a camera, from the frame number `first` on."""
        self.sums[camera] += counts.sum(axis=0, dtype=self.sums.dtype)
        self.is_above_one |= bool(counts.max(initial=0) > 1)
        self.number += int(np.count_nonzero(counts))
        if self.is_above_one or self.number > MOST_KEPT:
            self.singles.clear()
            return
        frame, i, j = np.nonzero(counts)
        k, l = (np.full(frame.size, index) for index in camera)
        self.singles.append(np.stack([k, l, i, j, frame + first], axis=1).astype(np.int32))

    def photon_counts(self, cfa: str | None, name: str, note: Note) -> PhotonCounts:
        """The counts; of numbers 0 and 1 alone in light that would give others as frames of one bit."""
        if self.bits is None and not self.is_above_one:
            samples = self.sums.size * self.frames
            dark = 1 - self.number / samples
            # Poisson counts of the same light would have at least this many numbers above 1.
            expected = samples * (1 - dark * (1 - np.log(dark)) if dark > 0 else 1.0)
            if expected > SURE_NATS:
                note(
                    f"{name} is taken for frames of one bit: no pixel of a frame counts more than 1, where "
                    f"{expected:.3g} would by chance; if they are not, give --bits 8"
                )
                self.bits = 1
        options = {"cfa": cfa, "frames": self.frames, "bits": self.bits}
        if self.bits == 1 and self.number <= MOST_KEPT:
            k, l, i, j, frame = np.concatenate(self.singles).T
            n = np.ones(k.size, np.uint8)
            return PhotonCounts.from_events(k, l, i, j, n, self.grid, frame=frame, **options)
        if self.bits == 1:
            note(
                f"only the sums of {self.frames} frames are kept: there are {self.number} counts, and the "
                f"frame of each is kept for up to {MOST_KEPT}"
            )
        return PhotonCounts.from_dense(self.sums, self.grid, **options)


def _warn_of_numbers(name: str, stored: np.ndarray, stated: FrameFormat, note: Note) -> None:
    """Warn of frames (T, H, W[, 3]) whose numbers look like packed bits, multiples, marks, or an offset.

    What is `stated` of them is not questioned.
    """
    if stored.dtype.kind not in "iu" or stated.bitpack or not stated.offset == stated.gain is None:
        return
    step = int(np.gcd.reduce(stored, axis=None))
    if step > 1 and np.count_nonzero(stored) * np.log(step) > SURE_NATS:
        advice = f"if that is one photon, give --gain {step}"
        advice += "; if the bytes of each number are in the other order, swap them" if step % 256 == 0 else ""
        note(f"warning: all numbers of {name} are multiples of {step}; {advice}")
        return
    if stated.bits is not None:
        return
    most = np.iinfo(stored.dtype).max
    marks = int(np.count_nonzero(stored == most))
    if marks:
        bits = 8 * stored.dtype.itemsize
        advice = "give --mask FILE if that marks dead pixels"
        advice += f", or --bits {bits} if they are saturated" if bits <= MOST_BITS else ""
        note(f"warning: {marks} numbers of {name} are {most}: {advice}")
        stored = stored[stored != most]
    else:
        _warn_of_full_frames(name, stored, note)
    if np.count_nonzero(stored) < MIN_JUDGED:
        return
    if stored.dtype == np.uint8:
        # High bits are set about as often as the low ones; in dim counts they are rarer.
        share = np.unpackbits(stored.reshape(-1, 1), axis=-1).mean(axis=0)
        if share.max() < 0.4 and share[:4].sum() > share.sum() / 3:
            note(
                f"warning: {name} looks like bits packed eight to a byte; if so, import again with --bitpack"
            )
            return
    least, low, median = np.quantile(stored, (0.0, 0.16, 0.5))
    if least > 0 and median - low < NARROW * np.sqrt(median) - 1:
        note(
            f"warning: no number of {name} is below {least:g}, and they scatter about {median:g} by "
            f"{median - low:g}, where photon counts would by {np.sqrt(median):.2g}: subtract what the camera "
            "reads without light with --offset, and divide by what a photon adds with --gain"
        )


def _warn_of_full_frames(name: str, stored: np.ndarray, note: Note) -> None:
    """Warn of numbers that pile up at the largest that some bits hold: pixels stop counting there.

    Where N_k numbers are k, photon counts of whatever light have N_k^2 k / (N_(k - 1) (k + 1)) of k + 1 or
    more: the moments of its rates are log-convex.
    """
    top = int(stored.max(initial=0))
    if top < 3 or top & (top + 1):
        return
    full, next_to_it = (int(np.count_nonzero(stored == value)) for value in (top, top - 1))
    expected_above = full**2 * top / (max(1, next_to_it) * (top + 1))
    if expected_above > SURE_NATS:
        note(
            f"warning: {full / stored.size:.2g} of the numbers of {name} are {top} and none is above, where "
            f"{expected_above:.2g} would by chance: if frames are full there, give --bits {top.bit_length()}"
        )


def _warn_of_dark_columns(sums: np.ndarray, note: Note) -> None:
    """Warn of columns at the end of packed rows without a count in any view."""
    columns = sums.sum(axis=(0, 1, 2), dtype=np.int64)
    dark = columns.size - 1 - int(np.flatnonzero(columns).max(initial=-1))
    if dark and columns.sum() >= MIN_COLUMN_MEAN * columns.size:
        note(
            f"warning: the last {dark} columns of {columns.size} have no count in any view; if the camera "
            "has fewer, correct the width (--width, or w of transforms.json), or cut them off the frames"
        )


def _warn_of_bit_order(sums: np.ndarray, order: BitOrder, cfa: str | None, note: Note) -> None:
    """Warn if views (K, L, H, W) are smoother where the bits of each byte are turned round.

    Steps between neighbours of one colour at the ends of bytes are compared in both orders: what stands there
    side by side is, in the wrong order, 15 pixels apart. Views and rows show how far that is by chance.
    """
    apart, width = (1 if cfa is None else 2), sums.shape[3] // 8 * 8
    if width < 16:
        return
    gains = []
    for view in sums.reshape(-1, *sums.shape[2:]):
        groups = view[:, :width].astype(np.float64).reshape(len(view), -1, 8)
        ends, starts = groups[:, :-1], groups[:, 1:]
        as_stored = (ends[:, :, 8 - apart] - starts[:, :, 0]) ** 2
        turned = (ends[:, :, apart - 1] - starts[:, :, 7]) ** 2
        gains.append((as_stored - turned).mean(axis=1))
    gain = np.concatenate(gains)
    error = gain.std(ddof=1) / np.sqrt(gain.size) if gain.size > 1 else np.inf
    if gain.mean() > SURE_DEVIATIONS * error > 0:
        other = "little" if order == "big" else "big"
        note(
            "warning: neighbours in two bytes differ as if the bits of each byte were in the other order; if "
            f"so, import again with --bit-order {other}"
        )
