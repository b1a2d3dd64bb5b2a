"""One picture file to an array: PNG, JPEG, TIFF and EXR, of 8 or 16 bits or of floats, with limits.

Files may be damaged or hostile: size and layout are read from the header, and checked, before any pixel is
decoded.
"""

import math
import struct
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.importing.tiff_pages import decode_tiff, tiff_header
from pcii.io.dataset_layout import read_exr

MOST_PIXELS = 1 << 27
"""Most pixels of a picture, 134 million; larger ones are refused before they are decoded."""
UNPACKED_BYTES, MOST_GROWTH = 1 << 29, 32
"""Most memory for what a compressed file holds: 512 MiB, or so many times its own size if that is more.
Zeros may unpack to a thousand times their size; pictures and photons of that size are at most 10 times."""
KINDS = {
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"II*\0": "TIFF",
    b"MM\0*": "TIFF",
    b"II+\0": "TIFF",
    b"MM\0+": "TIFF",
    b"\x76\x2f\x31\x01": "EXR",
}
ALPHA = "has an alpha channel; save it without transparency"
DAMAGED = "damaged or cut off, its pixels cannot be decoded"


@dataclass(frozen=True)
class Picture:
    """What the header of a file says: shape (H, W, C), dtype, and the number of pages (frames)."""

    path: Path
    kind: str
    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    pages: int = 1

    def layout(self) -> str:
        """Shape and type in words, by which pictures of a grid are compared."""
        height, width, channels = self.shape
        return f"{width} x {height} px, {channels} channels of {self.dtype}"


def picture_of(path: Path) -> Picture:
    """The header of a picture file; raises `InputError`, naming it, for one that cannot be imported."""
    try:
        with path.open("rb") as file:
            head = file.read(64)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
    kind = next((name for start, name in KINDS.items() if head.startswith(start)), None)
    if kind is None:
        raise InputError(f"{path}: not a PNG, JPEG, TIFF or EXR picture")
    try:
        header = {"PNG": _png_header, "JPEG": _jpeg_header, "TIFF": tiff_header, "EXR": _exr_header}[kind]
        shape, dtype, pages = header(path)
        if min(shape) < 1 or shape[0] * shape[1] > MOST_PIXELS:
            raise InputError(f"{shape[1]} x {shape[0]} px, and at most {MOST_PIXELS} pixels are decoded")
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}") from None
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: its header cannot be read ({visible(str(fault))})") from None
    picture = Picture(path, kind, shape, np.dtype(dtype), pages)
    unpacked = math.prod(shape) * picture.dtype.itemsize
    check_unpacked(path, unpacked, path.stat().st_size, "make the picture smaller")
    return picture


def decode(picture: Picture) -> Iterator[np.ndarray]:
    """Pixels (H, W, C) of each page of a picture, as they are in the file.

    Raises `InputError`, naming the file, if they cannot be decoded or are not as the header says.
    """
    path = picture.path
    pages = {"PNG": _png, "JPEG": _pillow, "TIFF": decode_tiff, "EXR": _exr}[picture.kind](path)
    while True:
        try:
            pixels = next(pages, None)
        except MemoryError:
            raise
        except Exception as fault:  # decoders raise various exceptions for damaged content
            raise InputError(f"{path}: {DAMAGED} ({visible(str(fault))})") from None
        if pixels is None:
            return
        pixels = pixels.reshape(*pixels.shape[:2], -1)
        if pixels.shape != picture.shape or pixels.dtype != picture.dtype:
            raise InputError(f"{path}: {DAMAGED} (its content is not as its header says)")
        yield pixels


def check_unpacked(path: Path, unpacked: int, packed: int, instead: str) -> None:
    """Raise `InputError` if a file of `packed` bytes asks for too many, with what to do instead."""
    most = max(UNPACKED_BYTES, MOST_GROWTH * packed)
    if unpacked > most:
        raise InputError(
            f"{path}: {packed / 2**20:.1f} MiB that unpack to {unpacked / 2**20:.0f} MiB of memory, and at "
            f"most {most / 2**20:.0f} are allowed; {instead}"
        )


def _png_header(path: Path) -> tuple[tuple[int, int, int], Any, int]:
    """From the IHDR chunk (PNG specification, section 11.2.1), which is always the first."""
    with path.open("rb") as file:
        head = file.read(33)
    length, name, width, height, bits, colour = struct.unpack(">I4sIIBB", head[8:26])
    if (length, name) != (13, b"IHDR"):
        raise InputError("damaged, a PNG file has to begin with its header")
    if colour == 3:
        raise InputError("has a palette; save it in true colour or grey")
    if colour in (4, 6):
        raise InputError(ALPHA)
    if colour not in (0, 2) or bits not in (1, 8, 16) or (bits == 1 and colour == 2):
        raise InputError(f"a PNG picture of {bits} bits and colour type {colour}; save it in 8 or 16 bits")
    return (height, width, 3 if colour == 2 else 1), {1: bool, 8: np.uint8, 16: np.uint16}[bits], 1


def _jpeg_header(path: Path) -> tuple[tuple[int, int, int], Any, int]:
    from PIL import Image

    with _quietly(), Image.open(path, formats=("JPEG",)) as image:
        if image.mode not in ("L", "RGB"):
            raise InputError(f"a {image.mode} picture; save it as RGB or grey")
        turned = image.getexif().get(0x0112, 1)
        if turned != 1:
            raise InputError(f"says that it has to be turned (EXIF orientation {turned}); save it upright")
        return (image.height, image.width, len(image.getbands())), np.uint8, 1


def _exr_header(path: Path) -> tuple[tuple[int, int, int], Any, int]:
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, header_only=True) as file:
        header = file.header()
        names = sorted(channel.name for channel in header["channels"])
        data, display = (
            [tuple(map(int, corner)) for corner in header[name]] for name in ("dataWindow", "displayWindow")
        )
    if names not in (["Y"], ["B", "G", "R"]):
        if "A" in names:
            raise InputError(ALPHA)
        raise InputError(f"has the channels {', '.join(names)}; expected R, G, B or Y")
    if data != display:
        raise InputError("its data window is not its display window; save the whole picture")
    (left, top), (right, bottom) = data
    return (bottom - top + 1, right - left + 1, len(names)), np.float32, 1


def _png(path: Path) -> Iterator[np.ndarray]:
    with path.open("rb") as file:
        bits = file.read(25)[24]
    if bits != 16:
        yield from _pillow(path)
        return
    import imagecodecs  # Pillow reduces 16-bit colour to 8 bits

    yield imagecodecs.png_decode(path.read_bytes())


def _pillow(path: Path) -> Iterator[np.ndarray]:
    from PIL import Image

    with _quietly(), Image.open(path, formats=("PNG", "JPEG")) as image:
        yield np.array(image)


def _exr(path: Path) -> Iterator[np.ndarray]:
    yield read_exr(path).astype(np.float32, copy=False)


def _quietly() -> warnings.catch_warnings:
    """Without warnings about large pictures, which have a limit here."""
    return warnings.catch_warnings(action="ignore")
