"""Elemental images from pictures: a file a view, a TIFF file with a page a view, a picture of a lens array.

A pattern names the files: {row} and {col}, or {index} that counts along the rows, and * for any text. Of
photon counts {frame} too, if each file holds one frame.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np

from pcii.base import InputError, Report, silent, visible
from pcii.exchange.pixel_files import Encoding, Picture, decode, kind_of, picture_of, radiance_of
from pcii.exchange.stated_cameras import AS_STORED, Note, Optics, ViewOrder, warn
from pcii.types import CameraGrid, Truth, Views, mosaic

VIEWS = ("PNG", "JPEG", "TIFF", "EXR")
"""Kinds of pictures of views."""
FIELD = re.compile(r"\{(row|col|index|frame)(?::((?:0[1-9])?d?))?\}")
MOST_VIEWS = 100_000
MOST_NAMED = 3
"""Largest number of files that a sentence names."""


def is_picture(path: Path) -> bool:
    """Whether a file begins like a picture of views."""
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
    note: Note = warn,
) -> Views:
    """Radiance of the pictures of a folder whose names fit a pattern such as "{col}_{row}.png".

    Names hold {row} and {col}, or {index}, which counts along the rows of cameras of a `grid` (K, L); without
    `grid` it is square. Without a pattern `source` is a TIFF file, whose pages are counted like {index}.
    Pictures are PNG, JPEG, TIFF or EXR, of up to 16 bits or of floats, grey or RGB, and all of one kind.
    Whole numbers are sRGB and floats are linear, unless `encoding` says otherwise. `cfa` is a Bayer pattern,
    of which grey pictures are mosaics. `note` takes the names of files that do not fit the pattern. Raises
    `InputError`, naming a file, for what does not fit.
    """
    path = Path(source)
    if pattern is None:
        radiance = radiance_of(*pages_of(path, grid, order, note), encoding)
    else:
        files = order.arrange(files_by_camera(path, pattern, grid, order, note))
        if isinstance(files[0, 0], tuple):
            raise InputError("pattern: {frame} is for frames of photon counts; give --counts too")
        radiance = radiance_of_files(files, encoding, report, note)
    return views_of(radiance, optics, cfa)


@dataclass(frozen=True, eq=False)
class KnownViews:
    """Views of which their files say more: depths of the virtual centre, and their range."""

    views: Views
    truth: Truth | None = None
    z_range_mm: tuple[float, float] | None = None


def radiance_of_files(files: np.ndarray, encoding: Encoding | None, report: Report, note: Note) -> np.ndarray:
    """Radiance (K, L, H, W, C) of pictures of one size and type, whose files are (K, L).

    `note` takes what else is in them. Raises `InputError`, naming the file, if one differs.
    """
    radiance, first, unused = np.empty(0), None, []
    for done, (camera, path) in enumerate(np.ndenumerate(files), start=1):
        picture = picture_of(path, VIEWS)
        if picture.pages > 1:
            raise InputError(f"{path}: has {picture.pages} pages; frames of photon counts need --counts")
        if first is None:
            first = path.name, picture.layout()
            radiance = np.empty((*files.shape, *picture.shape), np.float32)
        if picture.layout() != first[1]:
            raise InputError(f"{path}: {picture.layout()}, where {first[0]} has {first[1]}")
        unused.append((path, picture.unused))
        radiance[camera] = radiance_of(picture, next(decode(picture)), encoding)
        report("pictures", done, files.size)
    _tell_unused(unused, note)
    return radiance


def views_of(radiance: np.ndarray, cameras: Optics | CameraGrid, cfa: str | None) -> Views:
    """Views as a sensor with the Bayer pattern `cfa` records them.

    Of RGB each pixel keeps the colour of its filter; radiance of one channel is taken for mosaics.
    """
    if cfa is not None and radiance.shape[4] == 3:
        radiance = mosaic(radiance, cfa)[..., None]
    return Views(radiance, cameras.grid(radiance.shape) if isinstance(cameras, Optics) else cameras, cfa)


def pages_of(
    path: Path, grid: tuple[int, int] | None, order: ViewOrder, note: Note
) -> tuple[Picture, np.ndarray]:
    """A picture that has a page for each view, and the pixels (K, L, H, W, C) of its pages.

    Pages are counted along the rows of `grid`, by default a square one. Raises `InputError` for another
    number of pages.
    """
    picture = picture_of(path, VIEWS)
    if picture.pages == 1:
        raise InputError(
            f"{path}: is one picture; of a lens array it needs --lens-array, as one of several views its "
            "folder and --pattern"
        )
    _tell_unused([(path, picture.unused)], note)
    pixels = np.stack([*decode(picture)])
    table = order.table_of(path, picture.pages, grid)
    return picture, order.arrange(pixels.reshape(*table, *pixels.shape[1:]))


def _tell_unused(contents: Sequence[tuple[Path, str]], note: Note) -> None:
    """Name what is not used of the content of files."""
    names = [f"{content} in {path.name}" for path, content in contents if content]
    if names:
        note(f"not used: {listed_names(names)}")


def files_by_camera(
    folder: Path, pattern: str, grid: tuple[int, int] | None, order: ViewOrder, note: Note
) -> np.ndarray:
    """Paths (A, B), object, of the files in `folder` that fit the pattern, in the order of their numbers.

    With {frame} each is a tuple of paths, those of the frames of a view.
    Axes are {row} and {col}; the numbers of {index} count along the table in which the `order` stores a
    `grid`. Numbers may begin anywhere and have a sign; endings in capitals fit too. Raises `InputError` for a
    pattern that is none, for files that are missing and for two of one view; `note` takes the names of other
    files.
    """
    expression, names = _expression(pattern)
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of pictures")
    files: dict[tuple[int, ...], dict[int, Path]] = {}
    others: list[str] = []
    for path in sorted(folder.glob("/".join("*" for _ in PurePosixPath(pattern).parts))):
        name = path.relative_to(folder).as_posix()
        match = expression.fullmatch(name)
        if match is None or not path.is_file() or path.name.startswith("."):
            others += [name] if path.is_file() and not path.name.startswith(".") else []
            continue
        view = tuple(int(match[name]) for name in names)
        frame = int(match["frame"]) if "frame" in expression.groupindex else 0
        if frame in (of_view := files.setdefault(view, {})):
            raise InputError(f"{path}: is of the same view as {of_view[frame].name}")
        of_view[frame] = path
    if not files:
        hint = f"its files are named like {visible(others[0])}" if others else "there are no files"
        raise InputError(f"{folder}: no file fits the pattern {visible(pattern)}; {hint}")
    if others:
        note(f"not used: {listed_names(others)}, since --pattern does not fit")
    numbers = np.array([*files])
    first, last = numbers.min(axis=0).tolist(), numbers.max(axis=0).tolist()
    size = tuple(end - begin + 1 for begin, end in zip(first, last, strict=True))
    if math.prod(size) > MOST_VIEWS:
        raise InputError(f"{folder}: numbers from {first} to {last} are too far apart for a grid of views")
    if len(names) == 1:
        size = (max(size[0], math.prod(grid or ())),)
        table = order.table_of(folder, size[0], grid)
    else:
        table = size[0], size[1]
        stored = grid[::-1] if grid is not None and order.swap_axes else grid
        if stored not in (None, table):
            raise InputError(
                f"{folder}: {pattern} gives {table[0]} rows and {table[1]} columns, not those of --grid"
            )
    count = math.prod(table) - len(files)
    if count:
        views = (tuple(a + b for a, b in zip(first, step, strict=True)) for step in np.ndindex(*size))
        view = next(view for view in views if view not in files)
        numbers_of = ", ".join(f"{name} {number}" for name, number in zip(names, view, strict=True))
        raise InputError(f"{folder}: {count} of {table[0]} x {table[1]} views missing, first {numbers_of}")
    frames = set().union(*files.values())
    for view, of_view in files.items():
        if lacking := frames.difference(of_view):
            where = ", ".join(f"{name} {number}" for name, number in zip(names, view, strict=True))
            raise InputError(f"{folder}: frame {min(lacking)} of the view {where} is missing; others have it")
    paths = np.empty(len(files), dtype=object)
    for place, view in enumerate(sorted(files)):
        ordered = tuple(files[view][frame] for frame in sorted(files[view]))
        paths[place] = ordered if "frame" in expression.groupindex else ordered[0]
    return paths.reshape(table)


def listed_names(names: Sequence[str]) -> str:
    """The first names of files, and how many more there are.

    >>> listed_names(["a.png", "b.png", "c.png", "d.png", "e.png"])
    'a.png, b.png, c.png and 2 more'
    """
    more = len(names) - MOST_NAMED
    return visible(", ".join(names[:MOST_NAMED])) + (f" and {more} more" if more > 0 else "")


def _expression(pattern: str) -> tuple[re.Pattern[str], tuple[str, ...]]:
    """The regular expression of file names, and the names of the numbers of a view: row and col, or index."""
    fields = [match[1] for match in FIELD.finditer(str(pattern))]
    names = tuple(sorted((name for name in fields if name != "frame"), reverse=True))
    steps = PurePosixPath(str(pattern)).parts
    strange = not steps or str(pattern).startswith("/") or ".." in steps or "\0" in str(pattern)
    strange |= fields.count("frame") > 1
    if strange or names not in (("index",), ("row", "col")) or {*FIELD.sub("", pattern)} & {*"{}"}:
        raise InputError(
            f'pattern: expected {{row}} and {{col}}, or {{index}}, as in "{{col}}_{{row}}.png" or '
            f'"view{{index:03d}}_*.png"; got {pattern!r}'
        )
    parts = re.split(r"(\{[^{}]*\}|\*)", pattern)
    for number, part in enumerate(parts):
        field = FIELD.fullmatch(part)
        plain = "[^/]*" if part == "*" else re.escape(part)
        parts[number] = plain if field is None else f"(?P<{field[1]}>[+-]?[0-9]+)"
    return re.compile("".join(parts), re.IGNORECASE), names


@dataclass(frozen=True, kw_only=True)
class LensArray:
    """Where the images of `rows` x `cols` lenses are in a picture.

    They repeat every `pitch_px` (x, y), which need not be whole; `offset_px` (x, y) is the left upper corner
    of the first. `inverted`: each is upside down, as a lens projects it on a sensor, and is turned by 180
    degrees. Raises `InputError` for no lenses, and for a pitch below 1 px.
    """

    rows: int
    cols: int
    pitch_px: tuple[float, float]
    offset_px: tuple[float, float] = (0.0, 0.0)
    inverted: bool = False

    def __post_init__(self) -> None:
        numbers = (*self.pitch_px, *self.offset_px)
        if min(self.rows, self.cols, *self.pitch_px) < 1 or not all(map(math.isfinite, numbers)):
            raise InputError(
                "rows, cols, pitch_px, offset_px: expected at least one lens, and 1 px from lens to lens, "
                f"got {self.rows} x {self.cols}, {self.pitch_px} and {self.offset_px}"
            )


def import_lens_array(
    path: str | Path,
    lenses: LensArray,
    optics: Optics,
    *,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    note: Note = warn,
) -> Views:
    """Radiance of the elemental images of a picture of a lens array, cut apart.

    Images are cut around the centre of each lens, floor(pitch) pixels wide and high; where they do not begin
    at whole pixels they are interpolated, so that no depth is lost to rounding. `optics` are of one lens: its
    focal length (or gap), the distance between lenses as `pitch_mm`, and pixels of the picture; `sensor_mm`
    is the width of the whole picture. `cfa` is a Bayer pattern, of which a grey picture is a mosaic. Raises
    `InputError` for lenses that are not within the picture, and for a mosaic that cutting or turning breaks.
    """
    picture = _single_picture(Path(path), note)
    height, width, channels = picture.shape
    optics = replace(optics, pixel_mm=optics.pixel_of(width), sensor_mm=None)
    across = _starts(lenses.cols, lenses.pitch_px[0], lenses.offset_px[0], width, "wide", path)
    down = _starts(lenses.rows, lenses.pitch_px[1], lenses.offset_px[1], height, "high", path)
    size = math.floor(lenses.pitch_px[1]), math.floor(lenses.pitch_px[0])
    beyond = [
        int((width - across[-1]) / lenses.pitch_px[0]) - 1,
        int((height - down[-1]) / lenses.pitch_px[1]) - 1,
    ]
    if max(beyond) > 0:
        note(f"not used: room for {beyond[0]} more columns and {beyond[1]} more rows of lens images")
    starts_evenly = not (np.concatenate([across, down]) % 2).any()
    if cfa is not None and channels == 1 and (lenses.inverted or not starts_evenly):
        raise InputError(
            f"{path}: is a mosaic, whose pattern lens images break that are turned or do not begin at even "
            "pixels; give the picture in colours"
        )
    whole = radiance_of(picture, next(decode(picture)), encoding)
    views = _cut(_cut(whole, down, size[0], 0), across, size[1], 2).swapaxes(1, 2)  # (K, h, L, w, C) before
    if lenses.inverted:
        views = views[:, :, ::-1, ::-1]
    return views_of(np.ascontiguousarray(order.arrange(views)), optics, cfa)


def _single_picture(path: Path, note: Note) -> Picture:
    """The picture of a file that holds one; `note` takes what else is in it."""
    picture = picture_of(path, VIEWS)
    if picture.pages > 1:
        raise InputError(f"{path}: has {picture.pages} pages; expected one picture")
    _tell_unused([(path, picture.unused)], note)
    return picture


def import_interlaced(
    path: str | Path,
    interlaced: tuple[int, int],
    optics: Optics,
    *,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    note: Note = warn,
) -> Views:
    """Radiance of a picture that has a pixel of each view in every block of `interlaced` (K, L) pixels.

    So light field cameras store what is under each micro lens, and archives their views (ESLF). `optics` are
    those of views; `sensor_mm` is the width of the whole picture. Raises `InputError` for a picture of no
    whole number of blocks, and for a mosaic.
    """
    picture = _single_picture(Path(path), note)
    (height, width, channels), (rows, cols) = picture.shape, interlaced
    if min(rows, cols) < 1 or height % rows or width % cols:
        raise InputError(
            f"{path}: {height} x {width} px are no whole blocks of --interlaced {rows} {cols}, rows x columns"
        )
    if cfa is not None and channels == 1:
        raise InputError(f"{path}: is a mosaic, whose pattern interlaced views break; give it in colours")
    whole = radiance_of(picture, next(decode(picture)), encoding)
    blocks = whole.reshape(height // rows, rows, width // cols, cols, channels)
    return views_of(np.ascontiguousarray(order.arrange(blocks.transpose(1, 3, 0, 2, 4))), optics, cfa)


def _starts(count: int, pitch: float, offset: float, size: int, how: str, path: str | Path) -> np.ndarray:
    """Where the images of the lenses of an axis begin, (count,), in px."""
    first = offset + (pitch - math.floor(pitch)) / 2
    end = first + pitch * (count - 1) + math.floor(pitch)
    if first < 0 or end > size + 1e-6:
        raise InputError(
            f"{path}: {count} lenses of {pitch:g} px from {offset:g} px on reach to {end:g}, and the picture "
            f"is {size} px {how}"
        )
    return first + pitch * np.arange(count)


def _cut(picture: np.ndarray, starts: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Pieces of an axis that begin at `starts`, by linear interpolation: the axis becomes (count, size)."""
    at = starts[:, None] + np.arange(size)
    floor = np.minimum(np.floor(at + 1e-9).astype(int), picture.shape[axis] - 1)
    share = np.clip(at - floor, 0, 1).astype(np.float32)
    share = share.reshape(*share.shape, *[1] * (picture.ndim - axis - 1))
    above = np.minimum(floor + 1, picture.shape[axis] - 1)
    return picture.take(floor, axis) * (1 - share) + picture.take(above, axis) * share
