"""Elemental images from pictures: a folder with one file a view, or a TIFF file with one page a view."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.images import Views
from pcii.importing.camera_order import AS_STORED, Optics, ViewOrder
from pcii.importing.file_patterns import files_by_camera, square_of
from pcii.importing.light_encoding import Encoding, check_encoding, to_radiance
from pcii.pictures.picture_files import Picture, decode, kind_of, picture_of

LARGEST_BYTES = 1 << 33
"""Most memory of all views together, 8 GiB."""
VIEWS = ("PNG", "JPEG", "TIFF", "EXR")
"""Kinds of pictures of views."""


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
) -> Views:
    """Radiance of the pictures of a folder whose names fit a pattern such as "{col}_{row}.png".

    Names hold {row} and {col}, or {index}, which counts along the rows of a `grid` (K, L); without `grid` it
    is square. Without a pattern `source` is a TIFF file, whose pages are counted like {index}. Pictures are
    PNG, JPEG, TIFF or EXR, of up to 16 bits or of floats, grey or RGB, and all of one kind. Whole numbers are
    sRGB and floats are linear, unless `encoding` says otherwise. `cfa` declares that grey pictures are Bayer
    mosaics. Raises `InputError`, naming a file, for what does not fit.
    """
    check_encoding(encoding)
    path = Path(source)
    if pattern is None:
        first, shape, pages = pages_of(path, grid, order)
        views = ((camera, first, pixels) for camera, pixels in pages)
    else:
        pictures = headers_of(order.arranged(files_by_camera(path, pattern, grid)))
        first, shape = pictures[0, 0], pictures.shape
        views = ((camera, picture, next(decode(picture))) for camera, picture in np.ndenumerate(pictures))
    check_size(path, (*shape, *first.shape))
    radiance = np.empty((*shape, *first.shape), np.float32)
    for done, (camera, picture, pixels) in enumerate(views, start=1):
        radiance[camera] = radiance_of(picture, pixels, encoding)
        report("pictures", done, math.prod(shape))
    return Views(radiance, optics.grid(radiance.shape), cfa)


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
    rows, cols = grid or square_of(path, picture.pages)
    if rows * cols != picture.pages:
        raise InputError(f"{path}: has {picture.pages} pages, where --grid is of {rows} x {cols} views")
    numbers = order.arranged(np.arange(picture.pages).reshape(rows, cols))
    K, L = numbers.shape
    cameras = (divmod(int(number), L) for number in np.argsort(numbers, axis=None))
    return picture, (K, L), zip(cameras, decode(picture), strict=True)


def headers_of(files: np.ndarray, *, pages: bool = False) -> np.ndarray:
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
    return pictures


def radiance_of(picture: Picture, pixels: np.ndarray, encoding: Encoding | None) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of a picture's pixels."""
    if picture.dtype == np.bool_:
        raise InputError(f"{picture.path}: has one bit per pixel, which is a photon count; use --counts")
    try:
        return to_radiance(pixels, encoding, picture.most)
    except InputError as fault:
        raise InputError(f"{picture.path}: {fault}") from None


def check_size(path: Path, shape: Sequence[int]) -> None:
    """Raise `InputError` if float32 views of a shape need more memory than is allowed."""
    needed = 4 * int(np.prod(shape, dtype=object))
    if needed > LARGEST_BYTES:
        raise InputError(
            f"{path}: views of {' x '.join(map(str, shape))} need {needed / 2**30:.1f} GiB, and at most "
            f"{LARGEST_BYTES / 2**30:g} are allowed; make the pictures smaller or leave views out"
        )
