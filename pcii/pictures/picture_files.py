"""One picture file to an array: PNG, JPEG, TIFF, EXR and PFM, of up to 16 bits or of floats, with limits.

Files may be damaged or hostile: size and layout are read from the header, and checked, before any pixel is
decoded.
"""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.pictures.exr_files import exr_header, exr_pixels
from pcii.pictures.tiff_pages import decode_tiff, tiff_header

MOST_PIXELS = 1 << 27
"""Most pixels of a picture, 134 million; larger ones are refused before they are decoded."""
UNPACKED_BYTES, MOST_GROWTH = 1 << 29, 32
"""Most memory for what a compressed file holds: 512 MiB, or so many times its own size if that is more.
Zeros may unpack to a thousand times their size; pictures and photons of that size are at most 10 times."""
STARTS = {
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"II*\0": "TIFF",
    b"MM\0*": "TIFF",
    b"II+\0": "TIFF",
    b"MM\0+": "TIFF",
    b"\x76\x2f\x31\x01": "EXR",
    b"Pf": "PFM",
}
LONGEST_START = max(map(len, STARTS))
PILLOW_MODES = {
    "1": (1, bool),
    "L": (1, np.uint8),
    "LA": (1, np.uint8),
    "P": (3, np.uint8),
    "RGB": (3, np.uint8),
    "RGBA": (3, np.uint8),
    "I;16": (1, np.uint16),
    "F": (1, np.float32),
}
"""Channels without alpha, and type."""
UPRIGHT = 1
"""The value of an orientation tag (TIFF 6.0, tag 274; EXIF) for pictures that are not to be turned."""
DAMAGED = "damaged or cut off, its pixels cannot be decoded"


@dataclass(frozen=True)
class Picture:
    """What the header of a file says: shape (H, W, C) without alpha, dtype, and the number of pages (frames).

    `bits`, if given, are fewer than the dtype has; `orientation` is UPRIGHT as far as the header tells.
    `stored` channels are decoded, those included that are left out.
    """

    path: Path
    kind: str
    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    pages: int = 1
    bits: int | None = None
    alpha: bool = False
    orientation: int = UPRIGHT
    stored: int = 0

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


def kind_of(path: Path) -> str | None:
    """PNG, JPEG, TIFF, EXR or PFM, by the first bytes of a file; None for any other."""
    with path.open("rb") as file:
        head = file.read(LONGEST_START)
    return next((kind for start, kind in STARTS.items() if head.startswith(start)), None)


def picture_of(path: Path, kinds: Sequence[str], most_pixels: int = MOST_PIXELS) -> Picture:
    """The header of a picture file; raises `InputError`, naming it, for what is not to be decoded.

    That is any other kind than `kinds`, more than one or three channels beside alpha, and too many pixels.
    """
    try:
        kind = kind_of(path)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
    if kind is None or kind not in kinds:
        names = " or ".join(filter(None, [", ".join(kinds[:-1]), kinds[-1]]))
        raise InputError(f"{path}: not a{'n' * names.startswith('E')} {names} picture")
    try:
        read = {"TIFF": tiff_header, "EXR": exr_header}.get(kind, partial(_pillow_header, kind))
        picture = Picture(path, kind, **read(path))
        height, width, channels = picture.shape
        if min(picture.shape) < 1 or height * width > most_pixels:
            raise InputError(f"{height} x {width} px, and at most {most_pixels} pixels are decoded")
        if channels not in (1, 3):
            raise InputError(f"has {channels} channels; expected 1 or 3")
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}") from None
    except MemoryError:
        raise
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: its header cannot be read ({visible(str(fault))})") from None
    stored = max(picture.stored, channels + picture.alpha)
    unpacked = height * width * stored * picture.dtype.itemsize
    check_unpacked(path, unpacked, path.stat().st_size, "make the picture smaller")
    return picture


def decode(picture: Picture, *, turn: bool | None = False, alpha: bool = False) -> Iterator[np.ndarray]:
    """Pixels (H, W, C) of each page of a picture, as they are in the file, without alpha.

    Raises `InputError`, naming the file, if they cannot be decoded, are not as the header says, are not
    opaque, or have to be turned and may not be: with `turn` they are returned upright, with `turn` None as
    they are stored, and with `alpha` with that as a further channel if the file has it.
    """
    path = picture.path
    height, width, channels = picture.shape
    pages = _pages(picture)
    while True:
        try:
            pixels, orientation = next(pages, (None, UPRIGHT))
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
        if picture.alpha and not alpha and not (pixels[..., -1] == picture.most).all():
            raise InputError(
                f"{path}: has an alpha channel that is not opaque everywhere; save it without transparency"
            )
        if turn is None:
            orientation = UPRIGHT
        if orientation != UPRIGHT and not turn:
            raise InputError(
                f"{path}: says that it has to be turned (EXIF orientation {orientation}); save it upright"
            )
        yield _turned(pixels if alpha else pixels[..., :channels], orientation)


def check_unpacked(path: Path, unpacked: int, packed: int, instead: str) -> None:
    """Raise `InputError` if a file of `packed` bytes asks for too many, with what to do instead."""
    most = max(UNPACKED_BYTES, MOST_GROWTH * packed)
    if unpacked > most:
        raise InputError(
            f"{path}: {packed / 2**20:.1f} MiB that unpack to {unpacked / 2**20:.0f} MiB of memory, and at "
            f"most {most / 2**20:.0f} are allowed; {instead}"
        )


def _pages(picture: Picture) -> Iterator[tuple[np.ndarray, int]]:
    """Pixels of each page, with alpha if there is, and the orientation that the file tells."""
    if picture.kind == "TIFF":
        for pixels in decode_tiff(picture.path, picture.most):
            yield pixels, picture.orientation
    elif picture.kind == "EXR":
        yield exr_pixels(picture.path), UPRIGHT
    else:
        yield _pillow(picture)


def _opened(kind: str, path: Path) -> Any:
    """The file as Pillow opens it: by the plug-in of its kind, whose limits of size are above ours."""
    from PIL import JpegImagePlugin, PngImagePlugin, PpmImagePlugin

    plugins = {
        "PNG": PngImagePlugin.PngImageFile,
        "JPEG": JpegImagePlugin.JpegImageFile,
        "PFM": PpmImagePlugin.PpmImageFile,
    }
    return plugins[kind](path)


def _pillow_header(kind: str, path: Path) -> dict[str, Any]:
    with warnings.catch_warnings(action="ignore"), _opened(kind, path) as image:
        if getattr(image, "n_frames", 1) != 1:
            raise InputError(f"holds {image.n_frames} pictures; give a file with one")
        if image.mode not in PILLOW_MODES:
            raise InputError(f"a {image.mode} picture; save it as RGB or grey")
        channels, dtype = PILLOW_MODES[image.mode]
        header = {"alpha": image.has_transparency_data}
        if kind == "PNG":  # of 16 bits Pillow keeps 8, and takes grey with alpha for colours
            with path.open("rb") as file:
                bits, colour_type = file.read(26)[24:]  # IHDR: PNG specification, section 11.2.1
            channels = 1 if colour_type in (0, 4) else 3
            dtype = np.uint16 if bits == 16 else dtype
            header["bits"] = bits if bits in (2, 4) and channels == 1 else None
        return header | {"shape": (image.height, image.width, channels), "dtype": np.dtype(dtype)}


def _pillow(picture: Picture) -> tuple[np.ndarray, int]:
    with warnings.catch_warnings(action="ignore"), _opened(picture.kind, picture.path) as image:
        image.load()  # PNG may tell its orientation after its pixels
        orientation = image.getexif().get(0x0112, UPRIGHT)
        if picture.kind == "PNG" and picture.dtype == np.uint16:
            import imagecodecs

            return imagecodecs.png_decode(picture.path.read_bytes()), orientation
        if picture.alpha or image.mode == "P":
            image = image.convert(("RGB" if picture.shape[2] == 3 else "L") + "A" * picture.alpha)
        pixels = np.array(image)  # fewer bits than 8 as shares of 255
        return pixels if picture.bits is None else pixels // np.uint8(255 // picture.most), orientation


def _turned(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Pixels of a file upright: from 5 on its rows are columns; then either may run backwards."""
    if 5 <= orientation <= 8:
        pixels = pixels.swapaxes(0, 1)
    up, left = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    return pixels[:: -1 if up else 1, :: -1 if left else 1]
