"""One picture file to an array: PNG, JPEG, TIFF and EXR, of up to 16 bits or of floats, with limits.

Files may be damaged or hostile: size and layout are read from the header, and checked, before any pixel is
decoded.
"""

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
LONGEST_START = max(map(len, KINDS))
ALPHA = "has an alpha channel that is not opaque everywhere; save it without transparency"
UPRIGHT = 1
"""The value of an orientation tag (TIFF 6.0, tag 274; EXIF) for pictures that are not to be turned."""
DAMAGED = "damaged or cut off, its pixels cannot be decoded"


@dataclass(frozen=True)
class Picture:
    """What the header of a file says: shape (H, W, C) without alpha, dtype, and the number of pages (frames).

    `bits`, if given, are fewer than the dtype has; `orientation` is UPRIGHT as far as the header tells.
    """

    path: Path
    kind: str
    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    pages: int = 1
    bits: int | None = None
    alpha: bool = False
    orientation: int = UPRIGHT

    def layout(self) -> str:
        """Shape and type in words, by which pictures of a grid are compared."""
        height, width, channels = self.shape
        kind = self.dtype if self.bits is None else f"{self.bits} bits"
        pages = f", {self.pages} pages" if self.pages > 1 else ""
        return f"{height} x {width} px, {channels} channels of {kind}{pages}"

    @property
    def most(self) -> int:
        """The number of full light, and of an opaque pixel."""
        if self.bits is not None:
            return (1 << self.bits) - 1
        return np.iinfo(self.dtype).max if self.dtype.kind == "u" else 1


def is_picture(path: Path) -> bool:
    """Whether this is a file that begins like a picture."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _kind(file.read(LONGEST_START)) is not None


def picture_of(path: Path) -> Picture:
    """The header of a picture file; raises `InputError`, naming it, for one that cannot be imported."""
    try:
        with path.open("rb") as file:
            kind = _kind(file.read(LONGEST_START))
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
    if kind is None:
        raise InputError(f"{path}: not a PNG, JPEG, TIFF or EXR picture")
    try:
        header = {"PNG": _png_header, "JPEG": _jpeg_header, "TIFF": tiff_header, "EXR": _exr_header}[kind]
        picture = Picture(path, kind, **header(path))
        height, width, channels = picture.shape
        if min(picture.shape) < 1 or height * width > MOST_PIXELS:
            raise InputError(f"{height} x {width} px, and at most {MOST_PIXELS} pixels are decoded")
        if channels not in (1, 3):
            raise InputError(f"has {channels} channels; expected 1 or 3")
        _check_upright(picture.orientation)
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}") from None
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: its header cannot be read ({visible(str(fault))})") from None
    unpacked = height * width * (channels + picture.alpha) * picture.dtype.itemsize
    check_unpacked(path, unpacked, path.stat().st_size, "make the picture smaller")
    return picture


def decode(picture: Picture) -> Iterator[np.ndarray]:
    """Pixels (H, W, C) of each page of a picture, as they are in the file, without alpha.

    Raises `InputError`, naming the file, if they cannot be decoded, are not as the header says, are not
    opaque or have to be turned.
    """
    path = picture.path
    height, width, channels = picture.shape
    pages = {"PNG": _png, "JPEG": _pillow, "TIFF": decode_tiff, "EXR": _exr}[picture.kind](path)
    while True:
        try:
            pixels = next(pages, None)
        except MemoryError:
            raise
        except InputError as fault:
            raise InputError(f"{path}: {fault}") from None
        except Exception as fault:  # decoders raise various exceptions for damaged content
            raise InputError(f"{path}: {DAMAGED} ({visible(str(fault))})") from None
        if pixels is None:
            return
        pixels = pixels.reshape(*pixels.shape[:2], -1)
        if pixels.shape != (height, width, channels + picture.alpha) or pixels.dtype != picture.dtype:
            raise InputError(f"{path}: {DAMAGED} (its content is not as its header says)")
        if picture.alpha and not (pixels[..., -1] == picture.most).all():
            raise InputError(f"{path}: {ALPHA}")
        yield pixels[..., :channels]


def check_unpacked(path: Path, unpacked: int, packed: int, instead: str) -> None:
    """Raise `InputError` if a file of `packed` bytes asks for too many, with what to do instead."""
    most = max(UNPACKED_BYTES, MOST_GROWTH * packed)
    if unpacked > most:
        raise InputError(
            f"{path}: {packed / 2**20:.1f} MiB that unpack to {unpacked / 2**20:.0f} MiB of memory, and at "
            f"most {most / 2**20:.0f} are allowed; {instead}"
        )


def _kind(head: bytes) -> str | None:
    return next((name for start, name in KINDS.items() if head.startswith(start)), None)


def _png_header(path: Path) -> dict[str, Any]:
    """From the IHDR chunk (PNG specification, section 11.2.1), which is always the first."""
    with path.open("rb") as file:
        head = file.read(33)
    length, name, width, height, bits, colour = struct.unpack(">I4sIIBB", head[8:26])
    if (length, name) != (13, b"IHDR"):
        raise InputError("damaged, a PNG file has to begin with its header")
    if colour == 3:
        raise InputError("has a palette; save it in true colour or grey")
    if colour not in (0, 2, 4, 6) or bits not in (1, 8, 16) or (bits == 1 and colour != 0):
        raise InputError(f"a PNG picture of {bits} bits and colour type {colour}; save it in 8 or 16 bits")
    shape = height, width, 3 if colour in (2, 6) else 1
    dtype = np.dtype({1: bool, 8: np.uint8, 16: np.uint16}[bits])
    return {"shape": shape, "dtype": dtype, "alpha": colour in (4, 6)}


def _jpeg_header(path: Path) -> dict[str, Any]:
    from PIL import Image

    with _quietly(), Image.open(path, formats=("JPEG",)) as image:
        if image.mode not in ("L", "RGB"):
            raise InputError(f"a {image.mode} picture; save it as RGB or grey")
        return {"shape": (image.height, image.width, len(image.getbands())), "dtype": np.dtype(np.uint8)}


def _exr_header(path: Path) -> dict[str, Any]:
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, header_only=True) as file:
        header, parts = file.header(), len(file.parts)
        names = {channel.name for channel in header["channels"]}
        data, display = (
            [tuple(map(int, corner)) for corner in header[name]] for name in ("dataWindow", "displayWindow")
        )
    if parts != 1:
        raise InputError(f"has {parts} parts; save each as a picture of its own")
    if names - {"A"} not in ({"Y"}, {"R", "G", "B"}):
        raise InputError(f"has the channels {', '.join(sorted(names))}; expected R, G, B or Y")
    if data != display:
        raise InputError("its data window is not its display window; save the whole picture")
    (left, top), (right, bottom) = data
    shape = bottom - top + 1, right - left + 1, len(names - {"A"})
    return {"shape": shape, "dtype": np.dtype(np.float32), "alpha": "A" in names}


def _check_upright(orientation: int) -> None:
    if orientation != UPRIGHT:
        raise InputError(f"says that it has to be turned (EXIF orientation {orientation}); save it upright")


def _png(path: Path) -> Iterator[np.ndarray]:
    with path.open("rb") as file:
        bits = file.read(25)[24]
    (pixels,) = _pillow(path)
    if bits == 16:
        import imagecodecs  # Pillow reduces 16-bit colour to 8 bits

        pixels = imagecodecs.png_decode(path.read_bytes())
    yield pixels


def _pillow(path: Path) -> Iterator[np.ndarray]:
    from PIL import Image

    with _quietly(), Image.open(path, formats=("PNG", "JPEG")) as image:
        image.load()  # PNG may tell its orientation after its pixels
        _check_upright(image.getexif().get(0x0112, UPRIGHT))
        yield np.array(image)


def _exr(path: Path) -> Iterator[np.ndarray]:
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True) as file:
        channels = file.channels()
        yield np.stack([np.float32(channels[name].pixels) for name in "YRGBA" if name in channels], axis=-1)


def _quietly() -> warnings.catch_warnings:
    """Without warnings about large pictures, which have a limit here."""
    return warnings.catch_warnings(action="ignore")
