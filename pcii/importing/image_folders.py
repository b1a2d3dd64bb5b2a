"""Elemental images from a folder of pictures, one file a view."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.images import Views
from pcii.importing.camera_order import AS_STORED, Optics, ViewOrder
from pcii.importing.file_patterns import files_by_camera
from pcii.importing.image_decoding import Picture, decode, picture_of
from pcii.importing.light_encoding import Encoding, check_encoding, to_radiance

LARGEST_BYTES = 1 << 33
"""Most memory of all views together, 8 GiB."""


def import_images(
    folder: str | Path,
    pattern: str,
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
    is square. Pictures are PNG, JPEG, TIFF or EXR, of up to 16 bits or of floats, grey or RGB, and all of one
    kind. Whole numbers are sRGB and floats are linear, unless `encoding` says otherwise. `cfa` declares that
    grey pictures are Bayer mosaics. Raises `InputError`, naming a file, for what does not fit.
    """
    check_encoding(encoding)
    files = order.arranged(files_by_camera(Path(folder), pattern, grid))
    pictures = headers_of(files)
    first: Picture = pictures[0, 0]
    check_size(Path(folder), (*files.shape, *first.shape))
    radiance = np.empty((*files.shape, *first.shape), np.float32)
    for done, (camera, picture) in enumerate(np.ndenumerate(pictures), start=1):
        radiance[camera] = radiance_of(picture, encoding)
        report("pictures", done, files.size)
    return Views(radiance, optics.grid(radiance.shape), cfa)


def headers_of(files: np.ndarray, *, pages: bool = False) -> np.ndarray:
    """Headers (K, L), object, of pictures of one size, type and number of pages; `InputError` if one differs.

    Pictures of several pages are refused unless `pages`.
    """
    pictures = np.empty(files.shape, dtype=object)
    for camera, path in np.ndenumerate(files):
        picture = picture_of(path)
        if picture.pages > 1 and not pages:
            raise InputError(f"{path}: has {picture.pages} pages; frames of photon counts need --counts")
        first = pictures.flat[0] or picture
        if picture.layout() != first.layout():
            raise InputError(f"{path}: {picture.layout()}, where {first.path.name} has {first.layout()}")
        pictures[camera] = picture
    return pictures


def radiance_of(picture: Picture, encoding: Encoding | None) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of a picture."""
    if picture.dtype == np.bool_:
        raise InputError(f"{picture.path}: has one bit per pixel, which is a photon count; use --counts")
    try:
        return to_radiance(next(decode(picture)), encoding, picture.most)
    except InputError as fault:
        prefix = "" if str(fault).startswith(str(picture.path)) else f"{picture.path}: "
        raise InputError(f"{prefix}{fault}") from None


def check_size(path: Path, shape: Sequence[int]) -> None:
    """Raise `InputError` if float32 views of a shape need more memory than is allowed."""
    needed = 4 * int(np.prod(shape, dtype=object))
    if needed > LARGEST_BYTES:
        raise InputError(
            f"{path}: views of {' x '.join(map(str, shape))} need {needed / 2**30:.1f} GiB, and at most "
            f"{LARGEST_BYTES / 2**30:g} are allowed; make the pictures smaller or leave views out"
        )
