"""How files keep the frames of a photon counter, and what looks wrong in them.

The frames of a view are an array (T, H, W) of numbers, or (T, H, W, 3) in colours; or, packed, of uint8
(T, H, ceil(W / 8)[, 3]) with eight pixels in a byte. Files without a header have nothing but frames.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pcii.base import InputError
from pcii.exchange.array_files import open_array
from pcii.exchange.pixel_files import decode, kind_of, picture_of
from pcii.exchange.stated_cameras import Note
from pcii.types import whole_counts

BitOrder = Literal["big", "little"]
MOST_BITS = 16
"""Of a frame of a sensor."""
EXACT = ("PNG", "TIFF", "EXR")
"""Kinds of pictures that keep photon counts."""
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


@dataclass(frozen=True, kw_only=True)
class FrameFormat:
    """How frames of photon counts are kept."""

    bits: int | None = None
    """Bits of a frame, 1 to 16: its pixels count to 2^bits - 1 and saturate there. Default: 1 of packed
    frames, of bool, and of numbers 0 and 1 in light that would give some 2; else no limit."""
    bitpack: bool = False
    """Frames are of bits, packed eight to a byte along the width, as numpy.packbits packs them."""
    bit_order: BitOrder | None = None
    """The first of eight packed pixels is in the highest bit, big (the default), or in the lowest, little."""
    width: int | None = None
    """Pixels in a row of packed frames. Default: all bits."""
    frame_size: tuple[int, int] | None = None
    """Width and height of the frames of files without a header: packed, or of bytes or, of more than 8
    --bits, of two bytes a pixel, the lower one first."""
    skip_bytes: tuple[int, int] | None = None
    """Bytes before and after each frame of such files."""
    offset: float | None = None
    """What a pixel reads without a photon, which is subtracted."""
    gain: float | None = None
    """How much a photon adds to a number, which is divided by it and rounded."""
    mask: Path | None = None
    """A picture or .npy file of a view, not 0 at pixels that are dead or hot: these count nothing."""

    def check(self) -> None:
        """Raise `InputError` for what cannot be, or does not go together."""
        for names, needed in ((("width", "bit_order"), "bitpack"), (("skip_bytes",), "frame_size")):
            for name in names:
                if getattr(self, name) is not None and not getattr(self, needed):
                    what = "packed frames" if needed == "bitpack" else "files without a header"
                    raise InputError(f"{_option(name)}: is for {what}; give {_option(needed)} too")
        if self.bits is not None and not 1 <= self.bits <= (1 if self.bitpack else MOST_BITS):
            most = "1 of packed frames" if self.bitpack else f"1 to {MOST_BITS}"
            raise InputError(f"--bits: expected {most}, got {self.bits}")
        if self.bitpack and (self.offset is not None or self.gain is not None):
            raise InputError("--offset, --gain: are for numbers, and packed frames have bits")
        if self.gain is not None and not self.gain > 0:
            raise InputError(f"--gain: expected a number above 0, got {self.gain:g}")
        if self.bit_order not in (None, "big", "little"):
            raise InputError(f"--bit-order: expected big or little, got {self.bit_order!r}")
        if self.frame_size is not None and min(*self.frame_size, *(n + 1 for n in self.skip_bytes or ())) < 1:
            raise InputError("--frame-size, --skip-bytes: expected at least one pixel, and no bytes below 0")

    def frames_in(self, path: Path) -> np.ndarray:
        """The frames of a file without a header, mapped into memory; `InputError` for one of other frames."""
        assert self.frame_size is not None
        width, height = self.frame_size
        row = -(-width // 8) if self.bitpack else width
        before, after = self.skip_bytes or (0, 0)
        number = "<u2" if (self.bits or 1) > 8 else "u1"
        frame = np.dtype([("before", f"V{before}"), ("frame", number, (height, row)), ("after", f"V{after}")])
        size = path.stat().st_size
        if size == 0 or size % frame.itemsize:
            raise InputError(
                f"{path}: {size} bytes are no whole number of frames of {frame.itemsize} bytes; correct "
                "--frame-size, --skip-bytes, --bits or --bitpack"
            )
        return np.memmap(path, frame, mode="r")["frame"]

    def width_of(self, name: str, row: int) -> int:
        """Pixels in a row of `row` stored numbers; `InputError` if the stated width is another one."""
        if not self.bitpack:
            return row
        width = self.width or (self.frame_size or (8 * row,))[0]
        if -(-width // 8) != row:
            raise InputError(
                f"{name}: its rows are of {8 * row - 7} to {8 * row} pixels, and the stated width is "
                f"{width}; it is wrong, or bits are packed along another axis"
            )
        return width

    def counts_of(self, name: str, stored: np.ndarray, dead: np.ndarray | None) -> np.ndarray:
        """Counts (T, H, W[, 3]), whole numbers, of stored frames, none where pixels (H, W) are `dead`.

        Raises `InputError` for counts that are negative, fractional or more than the bits hold.
        """
        if self.bitpack:
            width = self.width_of(name, stored.shape[2])
            counts = np.unpackbits(stored, axis=2, bitorder=self.bit_order or "big")
            if counts[:, :, width:].any():
                raise InputError(
                    f"{name}: bits beyond the {width} pixels of a row are set; the width or --bit-order is "
                    "wrong, or bits are not packed along the width as numpy.packbits packs them"
                )
            counts = counts[:, :, :width]
        else:
            if dead is not None:  # whose marks are no counts
                stored = np.where(_like(dead, stored), 0, stored)
            if self.offset is not None or self.gain is not None:
                photons = (stored.astype(np.float64) - (self.offset or 0)) / (self.gain or 1)
                stored = photons.round().clip(min=0)
            counts = whole_counts(name, stored)
        if dead is not None:
            counts = np.where(_like(dead, counts), 0, counts)
        limit = None if self.bits is None else (1 << self.bits) - 1
        if limit is not None and counts.max(initial=0) > limit:
            raise InputError(f"{name}: counts to {counts.max()}, and --bits {self.bits} hold {limit}")
        return counts

    def dead_pixels(self, shape_HW: tuple[int, ...]) -> np.ndarray | None:
        """Pixels (H, W) that the mask names, None without one; `InputError` for a mask of another shape."""
        if self.mask is None:
            return None
        path = Path(self.mask)
        if path.is_file() and kind_of(path) is not None:
            dead = np.any(next(decode(picture_of(path, EXACT))), axis=2)
        else:
            dead = open_array(path).astype(np.bool_)
        if dead.shape != shape_HW:
            raise InputError(f"--mask: {path} is {dead.shape}, and views are {shape_HW}, rows and columns")
        return dead


AS_COUNTED = FrameFormat()
"""Numbers of photons."""


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _like(dead: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Dead pixels (H, W) with the axes of frames (T, H, W[, 3])."""
    return dead[..., None] if frames.ndim == 4 else dead


def warn_of_numbers(name: str, stored: np.ndarray, stated: FrameFormat, note: Note) -> None:
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
    """Warn of numbers that pile up at the largest that some bits hold: pixels stop counting there."""
    top = int(stored.max(initial=0))
    if top < 3 or top & (top + 1):
        return
    full, next_to_it = (int(np.count_nonzero(stored == value)) for value in (top, top - 1))
    if full > 2 * next_to_it + MIN_JUDGED:
        note(
            f"warning: {full / stored.size:.2g} of the numbers of {name} are {top}, more than are {top - 1}: "
            f"if frames are full there, give --bits {top.bit_length()}"
        )


def warn_of_dark_columns(sums: np.ndarray, option: str, note: Note) -> None:
    """Warn of columns at the end of packed rows without a count in any view."""
    columns = sums.sum(axis=(0, 1, 2), dtype=np.int64)
    width, lit = columns.size, int(np.flatnonzero(columns).max(initial=-1)) + 1
    if lit < width and columns.sum() >= MIN_COLUMN_MEAN * width:
        is_padding = -(-lit // 8) == -(-width // 8)  # padding is less than a byte
        advice = f"import again with {option} {lit}" if is_padding else "cut them off the frames"
        what = f"the last {width - lit} columns of {width} have no count in any view"
        note(f"warning: {what}; if the camera has fewer, {advice}")


def warn_of_bit_order(sums: np.ndarray, order: BitOrder, cfa: str | None, note: Note) -> None:
    """Warn if views (K, L, H, W) are smoother where the bits of each byte are turned round.

    Steps between neighbours of one colour at the ends of bytes are compared in both orders: what stands there
    side by side is, in the wrong order, 15 pixels apart. Views and rows
    show how far that is by chance.
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


def expected_above_one(counts: int, samples: int) -> float:
    """How many of `samples` numbers, of which `counts` are 1 and no other is above 0, Poisson counts of the
    same light would have above 1, at least."""
    dark = 1 - counts / samples
    return samples * (1 - dark * (1 - np.log(dark)) if dark > 0 else 1.0)
