"""Elemental images from pictures and arrays: a file a view, a page a view, a picture of a lens array."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from pcii.base import InputError, Report, silent, srgb_to_linear, times
from pcii.exchange.number_files import VIEWS, Picture, decode, listed_names, open_array, picture_of
from pcii.exchange.stated_images import (
    AS_STORED,
    Note,
    Optics,
    ViewOrder,
    ViewTable,
    files_by_camera,
    picture_of_views,
    warn,
)
from pcii.types import CameraGrid, Truth, Views, mosaic

LIGHT_TYPES = ("uint8", "uint16", "float16", "float32", "float64")
Encoding = Literal["srgb", "linear"] | float
"""How numbers stand for light: "srgb", "linear", or the exponent of a gamma, such as 2.2."""
LARGEST_ENCODED = 2.0
"""Largest encoded float that is taken: white is 1, and sharpened pictures exceed it a little. Numbers of 8
bits or more, which are refused, reach far more: any limit from 1.5 to 100 decides alike."""


def import_images(
    source: str | Path | np.ndarray,
    pattern: str | None,
    optics: Optics | CameraGrid,
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
    `grid` it is square. Without a pattern `source` is a TIFF file, whose pages are counted like {index}. An
    array (K, L) of `Path` names the file of each view; a `CameraGrid` states the size of views too. Pictures
    are PNG, JPEG, TIFF or EXR, of up to 16 bits or of floats, grey or RGB, and all of one kind. Whole numbers
    are sRGB and floats are linear, unless `encoding` says otherwise. `cfa` is a Bayer pattern, of which grey
    pictures are mosaics. `note` takes the names of files that do not fit the pattern, and what else is in
    pictures. Raises `InputError`, naming a file, for what does not fit.
    """
    if isinstance(source, np.ndarray):
        if not all(isinstance(path, Path) for path in source.flat):
            raise InputError(
                f"source: expected an array (K, L) of Path, got {source.dtype} {source.shape}; arrays of "
                "numbers are for import_arrays"
            )
        files = source
    elif pattern is None:
        picture, pages = picture_of_views(Path(source), note), ViewTable(grid=grid, order=order, axes="NHWC")
        return _views_of(pages.by_camera(_radiance_of(picture, encoding), str(source)), optics, cfa)
    else:
        files = files_by_camera(Path(source), pattern, ViewTable(grid=grid, order=order), note)
    if files.ndim > 2:
        raise InputError("pattern: {frame} is for frames of photon counts; give --counts too")
    radiance, first = np.empty(0), None
    unused: list[str] = []
    for done, (camera, path) in enumerate(np.ndenumerate(files), start=1):
        picture = picture_of(path, VIEWS)
        if picture.pages > 1:
            raise InputError(f"{path}: has {picture.pages} pages; frames of photon counts need --counts")
        if first is None:
            first = path.name, picture.layout()
            radiance = np.empty((*files.shape, *picture.shape), np.float32)
        if picture.layout() != first[1]:
            raise InputError(f"{path}: {picture.layout()}, where {first[0]} has {first[1]}")
        if isinstance(optics, CameraGrid) and picture.shape[:2] != optics.shape_HW:
            sizes = times(picture.shape[:2]), times(optics.shape_HW)
            raise InputError(f"{path}: is {sizes[0]} px, and {sizes[1]} are stated, rows x columns")
        unused += [f"{picture.unused} in {path.name}"] if picture.unused else []
        radiance[camera] = _radiance_of(picture, encoding)[0]
        report("pictures", done, files.size)
    if unused:
        note(f"not used: {listed_names(unused)}")
    return _views_of(radiance, optics, cfa)


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
    return _views_of(_to_radiance(name, np.asarray(views), encoding), optics, cfa)


@dataclass(frozen=True, eq=False)
class KnownViews:
    """Views of which their files say more: depths of the virtual centre, and their range."""

    views: Views
    truth: Truth | None = None
    z_range_mm: tuple[float, float] | None = None


def _views_of(radiance: np.ndarray, cameras: Optics | CameraGrid, cfa: str | None) -> Views:
    """Views as a sensor with the Bayer pattern `cfa` records them.

    Of RGB each pixel keeps the colour of its filter; radiance of one channel is taken for mosaics.
    """
    if cfa is not None and radiance.shape[4] == 3:
        radiance = mosaic(radiance, cfa)[..., None]
    return Views(radiance, cameras.grid(radiance.shape) if isinstance(cameras, Optics) else cameras, cfa)


def _radiance_of(picture: Picture, encoding: Encoding | None) -> np.ndarray:
    """Linear radiance (pages, H, W, C), float32, of a picture."""
    if picture.dtype.name not in LIGHT_TYPES:
        raise InputError(f"{picture.path}: {picture.dtype} is no type of light; photon counts need --counts")
    return _to_radiance(str(picture.path), decode(picture), encoding, picture.most)


def _to_radiance(
    name: str, numbers: np.ndarray, encoding: Encoding | None, most: int | None = None
) -> np.ndarray:
    """Linear radiance, float32, of whole numbers, of 1 at `most` (of their type), or of floats.

    Without an encoding whole numbers are sRGB, as in nearly all picture files, and floats are linear. Raises
    `InputError`, naming the file `name`, for an encoding or numbers that cannot be.

    >>> _to_radiance("a.npy", np.array([0, 128, 255], np.uint8), None).astype(float).round(3).tolist()
    [0.0, 0.216, 1.0]
    >>> _to_radiance("a.npy", np.array([0, 128, 255], np.uint8), "linear").astype(float).round(3).tolist()
    [0.0, 0.502, 1.0]
    """
    is_whole = numbers.dtype.kind == "u"
    if encoding is None:
        encoding = "srgb" if is_whole else "linear"
    is_gamma = isinstance(encoding, int | float) and 0.1 <= encoding <= 10
    if not is_gamma and encoding not in ("srgb", "linear"):
        expected = "srgb, linear, or a gamma from 0.1 to 10"
        raise InputError(f"{name}: encoding: expected {expected}, got {encoding!r}")
    full = most or (np.iinfo(numbers.dtype).max if is_whole else 1)
    if encoding == "srgb" and is_whole:  # few values are many pixels
        return srgb_to_linear(np.arange(full + 1) / full).astype(np.float32)[numbers]
    share = numbers / np.float32(full) if is_whole else numbers
    least, top = share.min(), share.max()
    if not np.isfinite([least, top]).all():
        raise InputError(f"{name}: holds NaN or infinity; radiance is finite")
    if encoding != "linear" and not 0 <= least <= top <= LARGEST_ENCODED:
        raise InputError(
            f"{name}: holds numbers from {least:g} to {top:g}; encoded light is from 0 to 1, which is white: "
            "divide by the number of white"
        )
    with np.errstate(over="ignore"):
        if encoding == "srgb":
            share = srgb_to_linear(share)
        elif encoding != "linear":
            share = (share if is_whole else share.astype(np.float64)) ** encoding
        linear = share.astype(np.float32)
    if not np.isfinite(linear).all():
        raise InputError(f"{name}: holds light that is too bright for float32")
    return linear


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
    picture = picture_of_views(Path(path), note, has_pages=False)
    height, width, channels = picture.shape
    optics = replace(optics, pixel_mm=optics.pixel_of(width), sensor_mm=None)
    across = _starts(lenses.cols, lenses.pitch_px[0], lenses.offset_px[0], width, "wide", path)
    down = _starts(lenses.rows, lenses.pitch_px[1], lenses.offset_px[1], height, "high", path)
    beyond = [
        int((size - starts[-1]) / pitch) - 1
        for size, starts, pitch in zip((width, height), (across, down), lenses.pitch_px, strict=True)
    ]
    if max(beyond) > 0:
        note(f"not used: room for {beyond[0]} more columns and {beyond[1]} more rows of lens images")
    starts_evenly = not (np.concatenate([across, down]) % 2).any()
    if cfa is not None and channels == 1 and (lenses.inverted or not starts_evenly):
        raise InputError(
            f"{path}: is a mosaic, whose pattern lens images break that are turned or do not begin at even "
            "pixels; give the picture in colours"
        )
    whole = _radiance_of(picture, encoding)[0]
    rows = _cut(whole, down, math.floor(lenses.pitch_px[1]), 0)
    views = _cut(rows, across, math.floor(lenses.pitch_px[0]), 2).swapaxes(1, 2)  # (K, h, L, w, C) before
    if lenses.inverted:
        views = views[:, :, ::-1, ::-1]
    return _views_of(np.ascontiguousarray(order.arrange(views)), optics, cfa)


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
    picture = picture_of_views(Path(path), note, has_pages=False)
    (height, width, channels), (rows, cols) = picture.shape, interlaced
    if min(rows, cols) < 1 or height % rows or width % cols:
        raise InputError(
            f"{path}: {height} x {width} px are no whole blocks of --interlaced {rows} {cols}, rows x columns"
        )
    if cfa is not None and channels == 1:
        raise InputError(f"{path}: is a mosaic, whose pattern interlaced views break; give it in colours")
    blocks = _radiance_of(picture, encoding).reshape(height // rows, rows, width // cols, cols, channels)
    return _views_of(np.ascontiguousarray(order.arrange(blocks.transpose(1, 3, 0, 2, 4))), optics, cfa)


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
