"""Elemental images from pictures: a folder with one file a view, or a TIFF file with one page a view.

A pattern names the files: {row} and {col}, or {index} that counts along the rows, and * for any text.
"""

import math
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.exchange.pixel_files import (
    LARGEST_BYTES,
    Encoding,
    Picture,
    check_encoding,
    decode,
    kind_of,
    picture_of,
    radiance_of,
)
from pcii.types.bayer import mosaic
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views

VIEWS = ("PNG", "JPEG", "TIFF", "EXR")
"""Kinds of pictures of views."""
EXAMPLES = '"{col}_{row}.png", "view{index:03d}.png" or "out_{row}_{col}_*.png"'
FIELD = re.compile(r"\{(row|col|index)(?::((?:0[1-9])?d?))?\}")
MOST_VIEWS = 100_000
MOST_NAMED = 3
"""Largest number of files that a sentence names."""
Tell = Callable[[str], None]
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
        if self.pixel_mm is not None:
            return self.pixel_mm
        side = self.sensor_mm
        if isinstance(side, bool) or not isinstance(side, int | float) or not 0 < side < np.inf:
            raise InputError(f"sensor_mm: expected a finite length above 0 mm, got {side!r}")
        return side / width

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
        if grid is None and rows * cols != count:
            raise InputError(f"{source}: {count} views are no square grid; say how many with --grid")
        if rows * cols != count:
            raise InputError(f"{source}: has {count} views, where --grid is of {rows} x {cols}")
        return (cols, rows) if self.swap_axes else (rows, cols)


AS_STORED = ViewOrder()
"""Rows from the top, columns from the left."""


def is_picture(path: Path) -> bool:
    """Whether this is a file that begins like a picture of views."""
    return path.is_file() and kind_of(path) in VIEWS


def import_images(
    source: str | Path,
    pattern: str | None,
    optics: Optics,
    *,
    grid: tuple[int, int] | None = None,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> Views:
    """Radiance of the pictures of a folder whose names fit a pattern such as "{col}_{row}.png".

    Names hold {row} and {col}, or {index}, which counts along the rows of cameras of a `grid` (K, L); without
    `grid` it is square. Without a pattern `source` is a TIFF file, whose pages are counted like {index}.
    Pictures are PNG, JPEG, TIFF or EXR, of up to 16 bits or of floats, grey or RGB, and all of one kind.
    Whole numbers are sRGB and floats are linear, unless `encoding` says otherwise. `cfa` is a Bayer pattern,
    of which grey pictures are mosaics. `tell` takes the names of files that do not fit the pattern. Raises
    `InputError`, naming a file, for what does not fit.
    """
    check_encoding(encoding)
    path = Path(source)
    if pattern is None:
        first, shape, pages = pages_of(path, grid, order)
        views = ((camera, first, pixels) for camera, pixels in pages)
    else:
        pictures = headers_of(order.arrange(files_by_camera(path, pattern, grid, order, tell)), tell=tell)
        first, shape = pictures[0, 0], pictures.shape
        views = ((camera, picture, next(decode(picture))) for camera, picture in np.ndenumerate(pictures))
    check_size(path, (*shape, *first.shape))
    radiance = np.empty((*shape, *first.shape), np.float32)
    for done, (camera, picture, pixels) in enumerate(views, start=1):
        radiance[camera] = radiance_of(picture, pixels, encoding)
        report("pictures", done, math.prod(shape))
    return views_of(radiance, optics.grid(radiance.shape), cfa)


def views_of(radiance: np.ndarray, grid: CameraGrid, cfa: str | None) -> Views:
    """Views as a sensor with the Bayer pattern `cfa` records them.

    Of RGB each pixel keeps the colour of its filter; radiance of one channel is taken for mosaics.
    """
    if cfa is not None and radiance.shape[4] == 3:
        radiance = mosaic(radiance, cfa)[..., None]
    return Views(radiance, grid, cfa)


def pages_of(
    path: Path, grid: tuple[int, int] | None, order: ViewOrder
) -> tuple[Picture, tuple[int, int], Iterator[tuple[tuple[int, int], np.ndarray]]]:
    """Header of a file that has a page for each view, its grid (K, L), and pixels (H, W, C) by camera (k, l).

    Pages are counted along the rows of `grid`, by default a square one. Raises `InputError` for another
    number of pages.
    """
    picture = picture_of(path, VIEWS)
    if picture.pages == 1:
        raise InputError(
            f"{path}: is one picture; of a lens array it needs --lens-array, as one of several views its "
            "folder and --pattern"
        )
    table = order.table_of(path, picture.pages, grid)
    numbers = order.arrange(np.arange(picture.pages).reshape(table))
    K, L = numbers.shape
    cameras = (divmod(int(number), L) for number in np.argsort(numbers, axis=None))
    return picture, (K, L), zip(cameras, decode(picture), strict=True)


def headers_of(files: np.ndarray, *, pages: bool = False, tell: Tell = warn) -> np.ndarray:
    """Headers (K, L), object, of pictures of one size, type and number of pages; `InputError` if one differs.

    Pictures of several pages are refused unless `pages`.
    """
    pictures = np.empty(files.shape, dtype=object)
    for camera, path in np.ndenumerate(files):
        picture = picture_of(path, VIEWS)
        if picture.pages > 1 and not pages:
            raise InputError(f"{path}: has {picture.pages} pages; frames of photon counts need --counts")
        first = pictures.flat[0] or picture
        if picture.layout() != first.layout():
            raise InputError(f"{path}: {picture.layout()}, where {first.path.name} has {first.layout()}")
        pictures[camera] = picture
    unused = [picture for picture in pictures.flat if picture.unused]
    if unused:
        tell(f"not used: {unused[0].unused} in {unused[0].path.name}{_more(len(unused) - 1)}")
    return pictures


def check_size(path: Path, shape: Sequence[int]) -> None:
    """Raise `InputError` if float32 views of a shape need more memory than is allowed."""
    needed = 4 * math.prod(shape)
    if needed > LARGEST_BYTES:
        raise InputError(
            f"{path}: views of {' x '.join(map(str, shape))} need {needed / 2**30:.1f} GiB, and at most "
            f"{LARGEST_BYTES / 2**30:g} are allowed; make the pictures smaller or leave views out"
        )


def files_by_camera(
    folder: Path, pattern: str, grid: tuple[int, int] | None, order: ViewOrder, tell: Tell
) -> np.ndarray:
    """Paths (A, B), object, of the files in `folder` that fit the pattern, in the order of their numbers.

    Axes are {row} and {col}; the numbers of {index} count along the table in which the `order` stores a
    `grid`. Numbers may begin anywhere and have a sign; endings in capitals fit too. Raises `InputError` for a
    pattern that is none, for files that are missing and for two of one view; `tell` takes the names of other
    files.
    """
    expression, names = _expression(pattern)
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of pictures")
    files: dict[tuple[int, ...], Path] = {}
    others: list[str] = []
    for path in sorted(folder.glob("/".join("*" for _ in PurePosixPath(pattern).parts))):
        name = path.relative_to(folder).as_posix()
        match = expression.fullmatch(name)
        if match is None or not path.is_file():
            others += [name] if path.is_file() and not path.name.startswith(".") else []
            continue
        view = tuple(int(match[name]) for name in names)
        if view in files:
            raise InputError(f"{path}: is of the same view as {files[view].name}")
        files[view] = path
    if not files:
        hint = f"its files are named like {visible(others[0])}" if others else "there are no files"
        raise InputError(f"{folder}: no file fits the pattern {visible(pattern)}; {hint}")
    if others:
        tell(f"not used: {listed_names(others)}, since --pattern does not fit")
    numbers = np.array([*files])
    first, last = numbers.min(axis=0).tolist(), numbers.max(axis=0).tolist()
    if min(last) < 0:
        raise InputError(
            f"{folder}: all numbers are below 0; write the hyphen into --pattern, as in -{{row}}"
        )
    size = tuple(end - begin + 1 for begin, end in zip(first, last, strict=True))
    if math.prod(size) > MOST_VIEWS:
        raise InputError(
            f"{folder}: the numbers in the files' names are of {' x '.join(map(str, size))} views"
        )
    if len(names) == 1:
        count = size[0] if grid is None else max(size[0], math.prod(grid))
        table = order.table_of(folder, count, grid)
    else:
        table = size[0], size[1]
        stored = grid[::-1] if grid is not None and order.swap_axes else grid
        if stored not in (None, table):
            raise InputError(
                f"{folder}: {pattern} gives {table[0]} rows and {table[1]} columns, not those of --grid"
            )
    views = [tuple(a + b for a, b in zip(first, step, strict=True)) for step in _steps(table, len(names))]
    missing = [_file_name(pattern, names, view) for view in views if view not in files]
    if missing:
        raise InputError(f"{folder}: missing of {table[0]} x {table[1]} views: {listed_names(missing)}")
    paths = np.empty(len(views), dtype=object)
    paths[:] = [files[view] for view in views]
    return paths.reshape(table)


def listed_names(names: Sequence[str]) -> str:
    """The first names of files, and how many more there are.

    >>> listed_names(["a.png", "b.png", "c.png", "d.png", "e.png"])
    'a.png, b.png, c.png and 2 more'
    """
    return visible(", ".join(names[:MOST_NAMED])) + _more(len(names) - MOST_NAMED)


def _more(count: int) -> str:
    return f" and {count} more" if count > 0 else ""


def _steps(table: tuple[int, int], axes: int) -> list[tuple[int, ...]]:
    return [(number,) for number in range(math.prod(table))] if axes == 1 else [*np.ndindex(*table)]


def _expression(pattern: str) -> tuple[re.Pattern[str], tuple[str, ...]]:
    """The regular expression of file names, and the names of its numbers: row and col, or index."""
    names = tuple(sorted((match[1] for match in FIELD.finditer(str(pattern))), reverse=True))
    steps = PurePosixPath(str(pattern)).parts
    strange = not steps or str(pattern).startswith("/") or ".." in steps or "\0" in str(pattern)
    if strange or names not in (("index",), ("row", "col")) or {*FIELD.sub("", pattern)} & {*"{}"}:
        raise InputError(
            f"pattern: expected {{row}} and {{col}}, or {{index}}, as in {EXAMPLES}; got {pattern!r}"
        )
    parts = re.split(r"(\{[^{}]*\}|\*)", pattern)
    for number, part in enumerate(parts):
        field = FIELD.fullmatch(part)
        plain = "[^/]*" if part == "*" else re.escape(part)
        parts[number] = plain if field is None else f"(?P<{field[1]}>[+-]?[0-9]+)"
    return re.compile("".join(parts), re.IGNORECASE), names


def _file_name(pattern: str, names: Sequence[str], view: Sequence[int]) -> str:
    """The name that a file of a view would have."""
    numbers = dict(zip(names, view, strict=True))
    return FIELD.sub(lambda field: format(numbers[field[1]], field[2] or ""), pattern)
