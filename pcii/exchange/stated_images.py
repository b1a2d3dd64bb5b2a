"""What is stated of images: where cameras stand, how views are stored, and which file is of which view.

A pattern names the files: {row} and {col}, or {index} that counts along the rows, and * for any text. Of
photon counts {frame} too, if each file holds one frame.
"""

import math
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path, PurePosixPath
from typing import cast

import numpy as np

from pcii.base import InputError, times, visible
from pcii.exchange.number_files import VIEWS, Picture, listed_names, picture_of
from pcii.types import CameraGrid

FIELD = re.compile(r"\{(row|col|index|frame)(?::(?:0[1-9])?d?)?\}")
MOST_VIEWS = 100_000
MANY_VIEWS = 100
"""An array of more views than this, and of more than each view has pixels, has its axes in another order:
what was taken for cameras are pixels."""
AXES = "KLNTHWC"
"""The order in which axes are understood: cameras or views, frames, pixels, colours."""
Note = Callable[[str], None]
"""Takes a sentence on what is left out or assumed."""


def warn(sentence: str) -> None:
    """Pass a sentence on as a Python warning: the default of readers."""
    warnings.warn(sentence, stacklevel=3)


@dataclass(frozen=True, kw_only=True)
class Optics:
    """Where cameras stand and how they see: all of a `CameraGrid` that pictures do not say.

    `pitch_mm` (x, y) is between neighbouring cameras, `focal_mm` from pinhole to film. The side of a pixel is
    `pixel_mm`, or follows from the width of the sensor, `sensor_mm`, and that of the pictures. `shear_px` is
    that of `CameraGrid`. Raises `InputError` unless exactly one of `pixel_mm` and `sensor_mm` is there.
    """

    pitch_mm: tuple[float, float]
    focal_mm: float
    pixel_mm: float | None = None
    sensor_mm: float | None = None
    shear_px: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.pixel_mm is None) == (self.sensor_mm is None):
            raise InputError(
                "pixel_mm, sensor_mm: give either the side of a pixel or the width of the sensor"
            )
        self.grid((1, 1, 1, 1))  # lengths are checked before pictures are read

    def pixel_of(self, width: int) -> float:
        """Side of a pixel in mm of pictures that are `width` px wide."""
        return cast(float, self.pixel_mm if self.sensor_mm is None else self.sensor_mm / width)

    def grid(self, shape: tuple[int, ...]) -> CameraGrid:
        """The camera grid of views of the shape (K, L, H, W, ...); raises `InputError` for a wrong length."""
        rows, cols, height, width = shape[:4]
        return CameraGrid(
            rows=rows,
            cols=cols,
            pitch_mm=self.pitch_mm,
            focal_mm=self.focal_mm,
            pixel_mm=self.pixel_of(width),
            height=height,
            width=width,
            shear_px=self.shear_px,
        )


@dataclass(frozen=True, kw_only=True)
class ViewOrder:
    """How the views were stored, if not rows from the top and in each row columns from the left.

    The changes are made in the order in which they stand here.
    """

    serpentine: bool = False
    """Every other row is stored backwards, as a stage takes them that moves to and fro."""
    swap_axes: bool = False
    """Rows and columns are exchanged; {index} and pages count down the columns."""
    flip_rows: bool = False
    """Rows are counted from the bottom."""
    flip_cols: bool = False
    """Columns are counted from the right."""

    def arrange(self, views: np.ndarray) -> np.ndarray:
        """An array (A, B, ...) of views as they were stored, by camera: (K, L, ...).

        >>> ViewOrder(swap_axes=True, flip_rows=True).arrange(np.array([[1, 2, 3], [4, 5, 6]])).tolist()
        [[3, 6], [2, 5], [1, 4]]
        >>> ViewOrder(serpentine=True).arrange(np.array([[1, 2, 3], [4, 5, 6]])).tolist()
        [[1, 2, 3], [6, 5, 4]]
        """
        if self.serpentine:
            views = np.copy(views)
            views[1::2] = views[1::2, ::-1]
        if self.swap_axes:
            views = views.swapaxes(0, 1)
        return views[:: -1 if self.flip_rows else 1, :: -1 if self.flip_cols else 1]

    def table_of(self, source: str | Path, count: int, grid: tuple[int, int] | None) -> tuple[int, int]:
        """The table (A, B) in which `count` views of a `grid` (K, L) are stored; square without a grid.

        Raises `InputError`, naming the source, if the count is another one.
        """
        rows, cols = grid or (math.isqrt(count), math.isqrt(count))
        if rows < 1 or rows * cols != count:
            right = "no square grid; say how many with --grid" if grid is None else f"not {rows} x {cols}"
            raise InputError(f"{source}: {count} views are {right}")
        return (cols, rows) if self.swap_axes else (rows, cols)


AS_STORED = ViewOrder()
"""Rows from the top, columns from the left."""


@dataclass(frozen=True, kw_only=True)
class ViewTable:
    """How an array holds views: of a `grid` (K, L), in an `order`, with named `axes` such as "HWKL".

    Without `axes` they are in the order of `AXES`, and of a `grid` the first axis counts the views.
    """

    grid: tuple[int, int] | None = None
    order: ViewOrder = AS_STORED
    axes: str | None = None

    def by_camera(self, numbers: np.ndarray, name: str, ordinary: str = "") -> np.ndarray:
        """An array as (K, L, ...), in the order of `AXES`; `ordinary` are its other axes in words.

        Raises `InputError` for other axes, and for more views than pixels in an order that nobody has named.
        """
        axes, shape = self.axes, numbers.shape
        if axes is not None:
            numbers = _in_order(numbers, name, axes)
        else:
            axes = "KL" if self.grid is None else "N"
            count, others = len(axes), shape[len(axes) :]
            if len(others) < 2:
                raise InputError(
                    f"{name}: expected (K, L, {ordinary}), or with --grid (N, {ordinary}), got {shape}"
                )
            # Colours of single pictures have a sentence of their own.
            are_colours = len(shape) == 4 and shape[-1] in (3, 4)
            if not are_colours and math.prod(shape[:count]) > max(MANY_VIEWS, math.prod(others)):
                raise InputError(
                    f"{name}: {shape} would be more views than each has numbers; name the order of its axes "
                    "with --axes, such as HWKL"
                )
        if "N" in axes:
            table = self.order.table_of(name, numbers.shape[0], self.grid)
            numbers = numbers.reshape(*table, *numbers.shape[1:])
        views = self.order.arrange(numbers)
        if self.grid is not None and views.shape[:2] != tuple(self.grid):
            sizes = times(views.shape[:2]), times(self.grid)
            raise InputError(f"{name}: has {sizes[0]} views, and --grid states {sizes[1]}")
        return views


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


def picture_of_views(path: Path, note: Note, *, has_pages: bool = True) -> Picture:
    """A picture of all views: with a page for each, or a single one of a lens array.

    `note` takes what else is in the file. Raises `InputError` for the other kind.
    """
    picture = picture_of(path, VIEWS)
    if has_pages and picture.pages == 1:
        raise InputError(
            f"{path}: is one picture; of a lens array it needs --lens-array, as one of several views its "
            "folder and --pattern"
        )
    if picture.pages > 1 and not has_pages:
        raise InputError(f"{path}: has {picture.pages} pages; expected one picture")
    if picture.unused:
        note(f"not used: {picture.unused} in {path.name}")
    return picture


def files_by_camera(folder: Path, pattern: str, views: ViewTable, note: Note) -> np.ndarray:
    """Paths (K, L) of the files in `folder` that fit a pattern such as "{col}_{row}.png".

    With {frame} they are (K, L, T), those of the frames of each view in the order of their numbers. {row} and
    {col} are axes; the numbers of {index} count along the table in which the views are stored. Numbers may
    begin anywhere and have a sign; endings in capitals fit too. Raises `InputError` for a pattern that is
    none, for files that are missing and for two of one view; `note` takes the names of other files.
    """
    grid, order = views.grid, views.order
    expression, fields = _expression(pattern)
    names = [name for name in fields if name != "frame"]
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder; --pattern names the files of a folder")
    files: dict[tuple[int, ...], Path] = {}
    others: list[str] = []
    for path in sorted(folder.glob("/".join("*" for _ in PurePosixPath(pattern).parts))):
        if not path.is_file() or path.name.startswith("."):
            continue
        name = path.relative_to(folder).as_posix()
        match = expression.fullmatch(name)
        if match is None:
            others.append(name)
            continue
        place = tuple(int(match[field]) for field in fields)
        if place in files:
            raise InputError(f"{path}: is of the same view as {files[place].name}")
        files[place] = path
    if not files:
        hint = f"its files are named like {visible(others[0])}" if others else "there are no files"
        raise InputError(f"{folder}: no file fits the pattern {visible(pattern)}; {hint}")
    if others:
        note(f"not used: {listed_names(others)}, since --pattern does not fit")
    numbers: list[Sequence[int]] = [sorted({*column}) for column in zip(*files, strict=True)]
    for axis in range(len(names)):  # whereas numbers of frames may have gaps
        numbers[axis] = range(numbers[axis][0], numbers[axis][-1] + 1)
    if names == ["index"] and grid is not None:  # the last views may be missing
        first, end = numbers[0][0], numbers[0][-1] + 1
        numbers[0] = range(first, max(end, first + math.prod(grid)))
    if math.prod(axis[-1] - axis[0] + 1 for axis in numbers[: len(names)]) > MOST_VIEWS:
        ends = " and ".join(f"{name} {r[0]} to {r[-1]}" for name, r in zip(names, numbers, strict=False))
        raise InputError(f"{folder}: {ends} are too far apart for a grid of at most {MOST_VIEWS} views")
    if names == ["index"]:
        table = order.table_of(folder, len(numbers[0]), grid)
    else:
        table = len(numbers[0]), len(numbers[1])
        if grid is not None and table != (grid[::-1] if order.swap_axes else grid):
            raise InputError(
                f"{folder}: {pattern} gives {table[0]} rows and {table[1]} columns, not those of --grid"
            )
    missing = [place for place in product(*numbers) if place not in files]
    if missing:
        first = ", ".join(f"{name} {number}" for name, number in zip(fields, missing[0], strict=True))
        size = times([*map(len, numbers)])
        raise InputError(f"{folder}: {len(missing)} of {size} files missing, first {first}")
    paths = np.array([files[place] for place in sorted(files)], object)
    return order.arrange(paths.reshape(*table, *map(len, numbers[len(names) :])))


def _expression(pattern: str) -> tuple[re.Pattern[str], list[str]]:
    """The regular expression of file names, and the numbers in them: row and col, or index; maybe frame."""
    fields = sorted(FIELD.findall(pattern), key=("row", "col", "index", "frame").index)
    names = [name for name in fields if name != "frame"]
    is_known = names in (["index"], ["row", "col"]) and fields.count("frame") < 2
    if not is_known or {*FIELD.sub("", pattern)} & {*"{}"}:
        raise InputError(
            f'pattern: expected {{row}} and {{col}}, or {{index}}, as in "{{col}}_{{row}}.png" or '
            f'"view{{index:03d}}_*.png"; got {pattern!r}'
        )
    escaped = re.escape(pattern).replace(r"\*", "[^/]*")
    number = r"(?P<\1>[+-]?[0-9]+)"
    expression = re.compile(re.sub(r"\\\{([a-z]+).*?\\\}", number, escaped), re.IGNORECASE)
    return expression, fields
