"""The frames of every view, from arrays and from files of photon counts, whose views may be in any order.

Files may be larger than memory: the frames of a view are loaded when they are added up.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pcii.base import InputError
from pcii.exchange.array_files import open_array
from pcii.exchange.frame_formats import EXACT, FrameFormat
from pcii.exchange.image_folders import files_by_camera, is_picture, pages_of
from pcii.exchange.pixel_files import decode, picture_of
from pcii.exchange.stated_cameras import AS_STORED, Note, ViewOrder

MANY_VIEWS = 100
"""An array of more views than this, and of more than each view has pixels, has its axes in another order:
what was taken for cameras are pixels."""

AXES = "KLNTHWC"
"""The order in which axes are understood: cameras or views, frames, pixels, colours."""


@dataclass(frozen=True, kw_only=True)
class ViewTable:
    """How an array holds views: of a `grid` (K, L), in an `order`, with named `axes` such as "HWKL".

    Without `axes` they are in the order of `AXES`, and of a `grid` the first axis counts the views.
    """

    grid: tuple[int, int] | None = None
    order: ViewOrder = AS_STORED
    axes: str | None = None

    def by_camera(self, numbers: np.ndarray, name: str, ordinary: str) -> np.ndarray:
        """An array as (K, L, ...), in the order of `AXES`; `ordinary` are its other axes in words.

        Raises `InputError` for other axes, and for more views than pixels in an order that nobody has named.
        """
        axes = self.axes
        if axes is None:
            if numbers.ndim < (4 if self.grid is None else 3):
                expected = f"(K, L, {ordinary}), or with --grid (N, {ordinary})"
                raise InputError(f"{name}: expected {expected}, got {numbers.shape}")
            axes = "KL" if self.grid is None else "N"
            count = np.prod(numbers.shape[: len(axes)], dtype=np.int64)
            # Colours of single pictures have a sentence of their own.
            is_known = numbers.ndim - len(axes) < 2 or (numbers.ndim == 4 and numbers.shape[-1] in (3, 4))
            if not is_known and count > max(MANY_VIEWS, np.prod(numbers.shape[len(axes) :], dtype=np.int64)):
                raise InputError(
                    f"{name}: {numbers.shape} would be more views than each has numbers; name the order of "
                    "its axes with --axes, such as HWKL"
                )
        else:
            numbers = _in_order(numbers, name, axes)
        if "N" in axes:
            table = self.order.table_of(name, numbers.shape[0], self.grid)
            numbers = numbers.reshape(*table, *numbers.shape[1:])
        return self.order.arrange(numbers)


def _in_order(numbers: np.ndarray, name: str, axes: str) -> np.ndarray:
    """An array whose axes are named, in the order of `AXES`; `InputError` for names that do not fit."""
    names = {*axes}
    is_known = len(names) == len(axes) and names <= {*AXES} and {*"HW"} <= names
    if not is_known or (names & {*"KLN"}) not in ({*"KL"}, {"N"}):
        raise InputError(
            "--axes: expected each axis once, K and L (rows and columns of cameras) or N (views), "
            f"T (frames), H and W (rows and columns of pixels), C (colours), such as HWKL; got {axes!r}"
        )
    if len(axes) != numbers.ndim:
        raise InputError(f"{name}: has the shape {numbers.shape}, and --axes {axes} are {len(axes)} axes")
    return numbers.transpose([axes.index(axis) for axis in AXES if axis in names])


class FrameStack(NamedTuple):
    """The frames of a view: `load` returns them, (T, H, row[, 3]), in memory or mapped from a file `name`."""

    name: str
    load: "Callable[[], np.ndarray | FrameFiles]"


class FrameFiles:
    """Files (T,) of a frame each as an array (T, H, row[, 3]), of which slices of frames are read."""

    def __init__(self, stored: FrameFormat, key: str | None, paths: Sequence[Path]) -> None:
        self.stored, self.key, self.paths = stored, key, paths
        first = self[:1]
        self.shape, self.ndim, self.dtype = (len(paths), *first.shape[1:]), first.ndim, first.dtype

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, some: slice) -> np.ndarray:
        frames = [_frames_of(self.stored, self.key, path) for path in self.paths[some]]
        for path, frame in zip(self.paths[some], frames, strict=True):
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
    is_path_array = isinstance(source, np.ndarray) and isinstance(next(iter(source.flat), None), Path)
    if not is_path_array and pattern is None:
        return _stacks_in_array(source, table, key, stored, note)
    paths = source
    if not is_path_array:
        paths = files_by_camera(Path(str(source)), str(pattern), table.grid, table.order, note)
    paths = table.order.arrange(np.asarray(paths))
    stacks = np.empty(paths.shape, object)
    for camera, path in np.ndenumerate(paths):
        if isinstance(path, tuple):
            stacks[camera] = FrameStack(str(path[0]), partial(FrameFiles, stored, key, path))
        else:
            stacks[camera] = FrameStack(str(path), partial(_frames_of, stored, key, path))
    return stacks


def _stacks_in_array(
    source: str | Path | np.ndarray, table: ViewTable, key: str | None, stored: FrameFormat, note: Note
) -> np.ndarray:
    """The frames of each view of an array, or of a file of one."""
    if stored.frame_size is not None:
        raise InputError(f"{source}: --frame-size is for a folder of files without a header and --pattern")
    if not isinstance(source, np.ndarray) and is_picture(Path(source)):
        _, pages = pages_of(Path(source), table.grid, table.order, note)
        source, table = _of_one_channel(pages), ViewTable()
    is_array = isinstance(source, np.ndarray)
    numbers, name = (source, "array") if is_array else (open_array(Path(source), key), str(source))

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
    if stored.frame_size is not None:
        return stored.frames_in(path)
    if is_picture(path):
        return _of_one_channel(np.stack([*decode(picture_of(path, EXACT))]))
    numbers = open_array(path, key)
    return _of_one_channel(numbers[None] if numbers.ndim == 2 else numbers)


def _of_one_channel(frames: np.ndarray) -> np.ndarray:
    """Frames without the axis of their channels, if there is one channel."""
    return frames[..., 0] if frames.ndim >= 4 and frames.shape[-1] == 1 else frames
