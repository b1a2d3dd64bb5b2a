"""Elemental images in NumPy arrays and files: (K, L, H, W) or (K, L, H, W, C)."""

import math
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.core.images import Views
from pcii.importing.camera_order import AS_STORED, Optics, ViewOrder
from pcii.importing.image_folders import check_size
from pcii.importing.light_encoding import Encoding, check_encoding, to_radiance
from pcii.pictures.array_headers import read_array_header
from pcii.pictures.picture_files import check_unpacked


def import_arrays(
    source: str | Path | np.ndarray,
    optics: Optics,
    *,
    array: str | None = None,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
) -> Views:
    """Radiance of an array (K, L, H, W) or (K, L, H, W, C), C = 1 or 3, or of a .npy or .npz file of one.

    `array` names one of several arrays of an .npz file. Floats are linear, unless `encoding` says otherwise;
    whole numbers need it: they may be sRGB of pictures or linear values of a sensor, which the file does not
    tell. `cfa` declares Bayer mosaics. Raises `InputError` for what does not fit.
    """
    check_encoding(encoding)
    numbers, name = opened_array(source, array)
    if numbers.ndim == 4:
        numbers = numbers[..., None]
    if numbers.ndim != 5 or 0 in numbers.shape or numbers.shape[4] not in (1, 3):
        raise InputError(f"{name}: expected (K, L, H, W) or (K, L, H, W, 1 or 3), got {numbers.shape}")
    if numbers.dtype.kind != "f" and numbers.dtype.newbyteorder("=") not in (np.uint8, np.uint16):
        raise InputError(f"{name}: expected float, uint8 or uint16, got {numbers.dtype}")
    if numbers.dtype.kind == "u" and encoding is None:
        raise InputError(
            f"{name}: {numbers.dtype} may be sRGB of pictures or linear values of a sensor; say which, with "
            "--srgb, --linear or --gamma (encoding)"
        )
    numbers = order.arranged(numbers)
    check_size(Path(name), numbers.shape)
    radiance = np.empty(numbers.shape, np.float32)
    for camera in np.ndindex(*numbers.shape[:2]):
        try:
            radiance[camera] = to_radiance(numbers[camera], encoding)
        except InputError as fault:
            raise InputError(f"{name}: view {camera} {fault}") from None
    return Views(radiance, optics.grid(radiance.shape), cfa)


def opened_array(source: str | Path | np.ndarray, array: str | None = None) -> tuple[np.ndarray, str]:
    """An array, read from a file if need be, and its name for messages; `InputError` if it is none."""
    if isinstance(source, np.ndarray):
        return source, "array"
    path = Path(source)
    try:
        if zipfile.is_zipfile(path):
            return _from_npz(path, array)
        if array is not None:
            raise InputError(f"{path}: has one array without a name; leave out --array")
        with path.open("rb") as file:
            read_array_header(file, path)
        numbers = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or visible(str(fault))})") from None
    except (InputError, MemoryError):
        raise
    except Exception as fault:  # readers raise various exceptions for damaged content
        raise InputError(f"{path}: not a NumPy array ({visible(str(fault))})") from None
    return numbers, str(path)


def _from_npz(path: Path, array: str | None) -> tuple[np.ndarray, str]:
    with zipfile.ZipFile(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        if array is None and len(names) != 1:
            raise InputError(f"{path}: has {len(names)} arrays; name one by --array: {', '.join(names[:9])}")
        chosen = array or names[0]
        if chosen not in names:
            raise InputError(f"{path}: has no array {chosen!r}; there are {', '.join(names[:9])}")
        check_archive(path, archive, [archive.namelist()[names.index(chosen)]])
    with np.load(path, allow_pickle=False) as loaded:
        return loaded[chosen], f"{path}: {chosen}"


def check_archive(path: Path, archive: zipfile.ZipFile, members: Iterable[str], beside: int = 0) -> None:
    """Raise `InputError` if arrays of an .npz file need too much memory, with `beside` bytes for others."""
    unpacked, packed = beside, 0
    for member in members:
        with archive.open(member) as file:
            header = read_array_header(file, path)
            unpacked += math.prod(header.shape) * max(header.dtype.itemsize, 4)  # as float32 at least
        packed += archive.getinfo(member).compress_size
    check_unpacked(path, unpacked, packed, "save a .npy file, which is read piece by piece")
