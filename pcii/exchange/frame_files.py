"""The frames of every view of a photon counter, from arrays and files whose views may be in any order.

The frames of a view are an array (T, H, W) of numbers, or (T, H, W, 3) in colours; or, packed, of uint8
(T, H, ceil(W / 8)[, 3]) with eight pixels in a byte. Files without a header have nothing but frames. Files
may be larger than memory: the frames of a view are loaded when they are added up.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from pcii.base import InputError
from pcii.exchange.number_files import EXACT, VIEWS, decode, kind_of, open_array, picture_of
from pcii.exchange.stated_images import Note, ViewTable, files_by_camera, picture_of_views
from pcii.types import whole_counts

BitOrder = Literal["big", "little"]
MOST_BITS = 16
"""Of a frame of a sensor."""


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
        for name, needed, what in (
            ("width", "bitpack", "packed frames"),
            ("bit_order", "bitpack", "packed frames"),
            ("skip_bytes", "frame_size", "files without a header"),
        ):
            if getattr(self, name) is not None and not getattr(self, needed):
                option, other = name.replace("_", "-"), needed.replace("_", "-")
                raise InputError(f"--{option}: is for {what}; give --{other} too")
        if self.bits is not None and not 1 <= self.bits <= (1 if self.bitpack else MOST_BITS):
            most = "1 of packed frames" if self.bitpack else f"1 to {MOST_BITS}"
            raise InputError(f"--bits: expected {most}, got {self.bits}")
        if self.bitpack and (self.offset is not None or self.gain is not None):
            raise InputError("--offset, --gain: are for numbers, and packed frames have bits")
        if self.gain is not None and not 0 < self.gain < np.inf:
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
        width = (self.frame_size or (8 * row,))[0] if self.width is None else self.width
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
        if dead is not None and stored.ndim == 4:
            dead = dead[..., None]
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
                stored = np.where(dead, 0, stored)
            if self.offset is not None or self.gain is not None:
                photons = (stored.astype(np.float64) - (self.offset or 0)) / (self.gain or 1)
                stored = photons.round().clip(min=0)
            counts = whole_counts(name, stored)
        if dead is not None:
            counts = np.where(dead, 0, counts)
        limit = None if self.bits is None else (1 << self.bits) - 1
        if limit is not None and counts.max(initial=0) > limit:
            raise InputError(f"{name}: counts to {counts.max()}, and --bits {self.bits} hold {limit}")
        return counts

    def dead_pixels(self, shape_HW: tuple[int, ...]) -> np.ndarray | None:
        """Pixels (H, W) that the mask names, None without one; `InputError` for a mask of another shape."""
        if self.mask is None:
            return None
        path = Path(self.mask)
        if kind_of(path) is None:
            dead = open_array(path).astype(np.bool_)
        else:
            dead = decode(picture_of(path, EXACT))[0].any(axis=2)
        if dead.shape != shape_HW:
            raise InputError(f"--mask: {path} is {dead.shape}, and views are {shape_HW}, rows and columns")
        return dead


AS_COUNTED = FrameFormat()
"""Numbers of photons."""


class FrameStack(NamedTuple):
    """The frames of a view: `load` returns them, (T, H, row[, 3]), in memory or mapped from a file `name`."""

    name: str
    load: "Callable[[], np.ndarray | FrameFiles]"


class FrameFiles:
    """Files (T,) of a frame each as an array (T, H, row[, 3]), of which slices of frames are read."""

    def __init__(self, stored: FrameFormat, key: str | None, paths: np.ndarray) -> None:
        self.stored, self.key, self.paths = stored, key, paths
        first = self[:1]
        self.shape, self.ndim, self.dtype = (len(paths), *first.shape[1:]), first.ndim, first.dtype

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, numbers: slice) -> np.ndarray:
        paths = self.paths[numbers]
        frames = [_frames_of(self.stored, self.key, path) for path in paths]
        for path, frame in zip(paths, frames, strict=True):
            if frame.shape != (1, *frames[0].shape[1:]) or frame.dtype != frames[0].dtype:
                raise InputError(f"{path}: expected one frame as in {self.paths[0].name}")
        return np.concatenate(frames)


def stacks_of(
    source: str | Path | np.ndarray,
    pattern: str | None,
    table: ViewTable,
    key: str | None,
    stored: FrameFormat,
    note: Note,
) -> np.ndarray:
    """The frames of each view, (K, L) of `FrameStack`, of a folder, an array, a file, or (K, L) of `Path`."""
    if pattern is not None and table.axes is not None:
        raise InputError("--axes: is for one array; of files of a view each the axes are T, H and W")
    if isinstance(source, np.ndarray) and isinstance(next(iter(source.flat), None), Path):
        paths = source
    elif pattern is None:
        return _stacks_in_array(source, table, key, stored, note)
    else:
        paths = files_by_camera(Path(str(source)), pattern, table, note)
    stacks = np.empty(paths.shape[:2], object)
    for camera in np.ndindex(*stacks.shape):
        view = paths[camera]
        if isinstance(view, Path):
            stacks[camera] = FrameStack(str(view), partial(_frames_of, stored, key, view))
        else:
            stacks[camera] = FrameStack(str(view[0]), partial(FrameFiles, stored, key, view))
    return stacks


def _stacks_in_array(
    source: str | Path | np.ndarray, table: ViewTable, key: str | None, stored: FrameFormat, note: Note
) -> np.ndarray:
    """The frames of each view of an array, or of a file of one."""
    if stored.frame_size is not None:
        raise InputError(f"{source}: --frame-size is for a folder of files without a header and --pattern")
    if isinstance(source, np.ndarray):
        name, numbers = "array", source
    elif kind_of(Path(source)) in VIEWS:
        if table.axes is not None or key is not None:
            raise InputError(f"--axes, --key: are for arrays, and {source} has a page for each view")
        name, numbers = str(source), decode(picture_of_views(Path(source), note))
        table = replace(table, axes="NHWC")
    else:
        name, numbers = str(source), open_array(Path(source), key)

    def arrange(numbers: np.ndarray) -> np.ndarray:
        views = table.by_camera(numbers, name, "[T,] H, W")
        has_frames = "T" in table.axes if table.axes else views.ndim > 4 or stored.bitpack
        return views if has_frames else views[:, :, None]

    def load(camera: tuple[int, int]) -> np.ndarray:
        # A new map of each view, so that what was read of the others leaves memory.
        is_mapped = not isinstance(source, np.ndarray) and isinstance(numbers, np.memmap)
        views = arrange(open_array(Path(str(source)), key) if is_mapped else numbers)
        return _of_one_channel(views[camera])

    views = arrange(numbers)
    if views.ndim not in (5, 6) or 0 in views.shape:
        shape = "(K, L, T, H, W / 8) of packed bits" if stored.bitpack else "(K, L, H, W) or (K, L, N, H, W)"
        raise InputError(f"{name}: expected {shape}, or with --grid one axis of views, got {numbers.shape}")
    if table.grid is None and table.axes is None and numbers.ndim == 4 and numbers.shape[3] in (3, 4):
        raise InputError(f"{name}: has the shape {numbers.shape}, with colours last; photon counts have none")
    stacks = np.empty(views.shape[:2], object)
    for camera in np.ndindex(*stacks.shape):
        stacks[camera] = FrameStack(name, partial(load, camera))
    return stacks


def _frames_of(stored: FrameFormat, key: str | None, path: Path) -> np.ndarray:
    """The frames (T, H, row[, 3]) of a view: pages of a picture, or a file that is mapped into memory."""
    if stored.frame_size is None and kind_of(path) not in VIEWS:
        numbers = open_array(path, key)
        return _of_one_channel(numbers[None] if numbers.ndim == 2 else numbers)
    if key is not None:
        raise InputError(f"{path}: --key is for .npz, .mat and HDF5 files, and this is none")
    if stored.frame_size is not None:
        return stored.frames_in(path)
    return _of_one_channel(decode(picture_of(path, EXACT)))


def _of_one_channel(frames: np.ndarray) -> np.ndarray:
    """Frames without the axis of their channels, if there is one channel."""
    return frames[..., 0] if frames.ndim >= 4 and frames.shape[-1] == 1 else frames
