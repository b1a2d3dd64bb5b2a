"""Picture files as arrays: PNG, JPEG, TIFF, OpenEXR and PFM, and the light that their numbers stand for.

Pillow, tifffile and OpenEXR read them. The header is read first, so that size and layout are known before
any pixel is decoded.
"""

import logging
import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.srgb import srgb_to_linear

MOST_PIXELS = 1 << 27
"""Most pixels of a picture, 134 million; larger ones are refused before they are decoded."""
LARGEST_BYTES = 1 << 33
"""Most memory of all views together, and of all pages of a file: 8 GiB."""
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
TIFF_TYPES = ("bool", "uint8", "uint16", "float16", "float32", "float64")
UPRIGHT = 1
"""The value of an orientation tag (TIFF 6.0, tag 274; EXIF) for pictures that are not to be turned."""
DAMAGED = "damaged or cut off, its pixels cannot be decoded"
Encoding = Literal["srgb", "linear"] | float
"""How numbers stand for light: "srgb", "linear", or the exponent of a gamma, such as 2.2."""
GAMMAS = (0.1, 10.0)


@dataclass(frozen=True)
class Picture:
    """What the header of a file says: shape (H, W, C) without alpha, dtype, and the number of pages (frames).

    `bits`, if not None, are fewer than the dtype has. `orientation` is UPRIGHT as far as the header says.
    `unused` names what else is in the file and is not decoded.
    """

    path: Path
    kind: str
    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    pages: int = 1
    bits: int | None = None
    alpha: bool = False
    orientation: int = UPRIGHT
    unused: str = ""

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
    """The header of a picture file; raises `InputError`, naming the file, for what cannot be used.

    That is any other kind than `kinds`, other than one or three channels beside alpha, and too many pixels.
    """
    headers = {"TIFF": _tiff_header, "EXR": _exr_header}
    try:
        kind = kind_of(path)
        if kind is None or kind not in kinds:
            names = " or ".join(filter(None, [", ".join(kinds[:-1]), kinds[-1]]))
            raise InputError(f"not a{'n' * names.startswith('E')} {names} picture")
        picture = Picture(path, kind, **headers.get(kind, _pillow_header)(path))
        height, width, channels = picture.shape
        if height * width > most_pixels:
            raise InputError(f"{height} x {width} px, and at most {most_pixels} pixels are decoded")
        if channels not in (1, 3):
            raise InputError(f"has {channels} channels; expected 1 or 3")
        if picture.pages * math.prod(picture.shape) * picture.dtype.itemsize > LARGEST_BYTES:
            raise InputError(f"{picture.layout()} are more than {LARGEST_BYTES >> 30} GiB")
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}") from None
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except MemoryError:
        raise
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: its header cannot be read ({visible(str(fault))})") from None
    return picture


def decode(picture: Picture, *, turn: bool | None = False, alpha: bool = False) -> Iterator[np.ndarray]:
    """Pixels (H, W, C) of each page of a picture, as they are in the file, without alpha.

    Raises `InputError`, naming the file, if they cannot be decoded, are not as the header says, are not
    opaque, or have to be turned and may not be: with `turn` they are returned upright, with `turn` None as
    they are stored, and with `alpha` with that as a further channel if the file has it.
    """
    path, (height, width, channels) = picture.path, picture.shape
    decoders = {"TIFF": _tiff_pixels, "EXR": _exr_pixels}
    try:
        pages, orientation = decoders.get(picture.kind, _pillow_pixels)(picture)
        pages = pages.reshape(picture.pages, height, width, channels + picture.alpha)
    except MemoryError:
        raise
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: {DAMAGED} ({visible(str(fault))})") from None
    if picture.alpha and not alpha and not (pages[..., -1] == picture.most).all():
        raise InputError(
            f"{path}: has an alpha channel that is not opaque everywhere; save it without transparency"
        )
    if orientation != UPRIGHT and turn is False:
        raise InputError(
            f"{path}: says that it has to be turned (EXIF orientation {orientation}); save it upright"
        )
    for pixels in pages:
        yield _turned(pixels if alpha else pixels[..., :channels], orientation if turn else UPRIGHT)


def check_encoding(encoding: Any) -> None:
    """Raise `InputError` unless this is an `Encoding`, or None for the usual one."""
    if encoding is None or encoding in ("srgb", "linear"):
        return
    is_number = isinstance(encoding, int | float) and not isinstance(encoding, bool)
    if not (is_number and GAMMAS[0] <= float(encoding) <= GAMMAS[1]):
        ends = f"{GAMMAS[0]:g} to {GAMMAS[1]:g}"
        raise InputError(f"encoding: expected srgb, linear, or a gamma from {ends}, got {encoding!r}")


def radiance_of(picture: Picture, pixels: np.ndarray, encoding: Encoding | None) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of a picture's pixels."""
    if picture.dtype == np.bool_:
        raise InputError(f"{picture.path}: has one bit per pixel, which is a photon count; use --counts")
    try:
        return to_radiance(pixels, encoding, picture.most)
    except InputError as fault:
        raise InputError(f"{picture.path}: {fault}") from None


def to_radiance(numbers: np.ndarray, encoding: Encoding | None, most: int | None = None) -> np.ndarray:
    """Linear radiance, float32, of whole numbers (of 1 at `most`) or of floats.

    `most` is by default the largest number of the type. Without an encoding whole numbers are sRGB, as in
    nearly all picture files, and floats are linear. Raises `InputError` for numbers that are NaN or infinite,
    for encoded ones below 0, and for light that is too bright for float32.

    >>> to_radiance(np.array([0, 128, 255], np.uint8), None).astype(float).round(3).tolist()
    [0.0, 0.216, 1.0]
    >>> to_radiance(np.array([0, 128, 255], np.uint8), "linear").astype(float).round(3).tolist()
    [0.0, 0.502, 1.0]
    """
    is_whole = numbers.dtype.kind == "u"
    if not is_whole and not np.isfinite(numbers).all():
        raise InputError("holds NaN or infinity; radiance is finite")
    if encoding is None:
        encoding = "srgb" if is_whole else "linear"
    full = most or (np.iinfo(numbers.dtype).max if is_whole else 1)
    if encoding == "srgb" and is_whole:  # few values are many pixels
        return srgb_to_linear(np.arange(full + 1) / full).astype(np.float32)[numbers]
    share = numbers / np.float32(full) if is_whole else numbers
    if encoding != "linear" and not is_whole and share.size and share.min() < 0:
        raise InputError("holds numbers below 0, which no encoded light has")
    with np.errstate(over="ignore"):
        if encoding == "srgb":
            share = srgb_to_linear(share)
        elif encoding != "linear":
            share = (share if is_whole else share.astype(np.float64)) ** encoding
        linear = share.astype(np.float32)
    if not np.isfinite(linear).all():
        raise InputError("holds light that is too bright for float32")
    return linear


def _opened(path: Path) -> Any:
    """The file as Pillow opens it, within Pillow's limit of size."""
    from PIL import Image

    return Image.open(path, formats=("PNG", "JPEG", "PPM"))


def _pillow_header(path: Path) -> dict[str, Any]:
    with warnings.catch_warnings(action="ignore"), _opened(path) as image:
        count = getattr(image, "n_frames", 1)
        # A telephone's JPEG may hold a preview or a map of brightness behind its picture.
        if count != 1 and image.format != "MPO":
            raise InputError(f"holds {count} pictures; give a file with one")
        if image.mode not in PILLOW_MODES:
            raise InputError(f"a {image.mode} picture; save it as RGB or grey")
        channels, dtype = PILLOW_MODES[image.mode]
        further = f"{count - 1} more pictures in the file" if count != 1 else ""
        unused = further or _profile(image.info.get("icc_profile"))
        header: dict[str, Any] = {"alpha": image.has_transparency_data, "unused": unused}
        if image.format == "PNG":  # of 16 bits Pillow keeps 8, and takes grey with alpha for colours
            stored = str(image.tile[0].args)
            channels = 1 if stored[0] in "L1I" else channels
            dtype = np.uint16 if stored.endswith("16B") else dtype
            header["bits"] = int(stored[2:]) if stored in ("L;2", "L;4") else None
        return header | {"shape": (image.height, image.width, channels), "dtype": np.dtype(dtype)}


def _pillow_pixels(picture: Picture) -> tuple[np.ndarray, int]:
    with warnings.catch_warnings(action="ignore"), _opened(picture.path) as image:
        image.load()  # PNG may tell its orientation after its pixels
        orientation = image.getexif().get(0x0112, UPRIGHT)
        if picture.kind == "PNG" and picture.dtype == np.uint16:
            import imagecodecs

            return imagecodecs.png_decode(picture.path.read_bytes()), orientation
        if picture.alpha or image.mode == "P":
            image = image.convert(("RGB" if picture.shape[2] == 3 else "L") + "A" * picture.alpha)
        pixels = np.array(image)  # numbers of fewer bits than 8 as shares of 255
        return pixels if picture.bits is None else pixels // np.uint8(255 // picture.most), orientation


def _tiff_header(path: Path) -> dict[str, Any]:
    from tifffile import COMPRESSION, PHOTOMETRIC, TiffFile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # faults are raised, not logged
    with TiffFile(path) as file:
        series: list[Any] = list(file.series)
        if len({(_frame_axes(one), one.dtype) for one in series}) != 1:
            sizes = " and ".join(sorted({" x ".join(map(str, one.shape)) for one in series})[:3])
            raise InputError(f"holds pictures of different sizes or types ({sizes}); save those of one kind")
        page: Any = series[0].keyframe
        known = {PHOTOMETRIC.MINISBLACK, PHOTOMETRIC.MINISWHITE, PHOTOMETRIC.RGB, PHOTOMETRIC.CFA}
        # Decoded to RGB with the rest of JPEG.
        is_jpeg = page.photometric == PHOTOMETRIC.YCBCR and page.compression == COMPRESSION.JPEG
        if page.photometric not in known and not is_jpeg:
            name = getattr(page.photometric, "name", page.photometric)
            raise InputError(f"a TIFF picture of the kind {name}; save it as RGB or grey")
        if str(page.dtype) not in TIFF_TYPES:
            raise InputError(f"has pixels of the type {page.dtype}; save it in 8 or 16 bits, or as float32")
        dtype, alpha = np.dtype(page.dtype), len(page.extrasamples) == 1
        height, width, samples = _frame_axes(series[0])
        numbers = sum(math.prod(one.shape) for one in series)
        if "C" in series[0].axes and len({*series[0].axes} - {*"YXS"}) > 1:  # alone it is that of frames
            raise InputError(f"has the axes {series[0].axes}, frames of several channels C; save one channel")
        fewer = dtype.kind == "u" and page.bitspersample < 8 * dtype.itemsize
        return {
            "shape": (height, width, samples - alpha),
            "dtype": dtype,
            "pages": numbers // (height * width * samples),
            "bits": page.bitspersample if fewer else None,
            "alpha": alpha,
            "orientation": page.tags.valueof(274, default=UPRIGHT),
            "unused": _profile(page.tags.valueof(34675)),
        }


def _profile(content: bytes | None) -> str:
    """What is said of an ICC profile: nothing of that of sRGB."""
    return "" if not content or b"sRGB" in content.replace(b"\0", b"") else "the colour profile"


def _frame_axes(series: Any) -> tuple[int, int, int]:
    """Height, width and samples of a frame of a series of TIFF pages."""
    sizes = dict(zip(series.axes, series.shape, strict=True))
    return sizes["Y"], sizes["X"], sizes.get("S", 1)


def _tiff_pixels(picture: Picture) -> tuple[np.ndarray, int]:
    """All frames: also of a file with one header for many, as ImageJ writes large stacks."""
    from tifffile import PHOTOMETRIC, TiffFile

    parts = []
    with TiffFile(picture.path) as file:
        for series in file.series:
            pixels = np.asarray(series.asarray(maxworkers=1))
            samples_last = np.moveaxis(pixels, series.axes.index("S"), -1) if "S" in series.axes else pixels
            if series.keyframe.photometric == PHOTOMETRIC.MINISWHITE:
                samples_last = (picture.most - samples_last).astype(pixels.dtype)
            parts.append(samples_last.reshape(-1, *picture.shape[:2], picture.shape[2] + picture.alpha))
    return np.concatenate(parts) if len(parts) > 1 else parts[0], picture.orientation


def _exr_header(path: Path) -> dict[str, Any]:
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True, header_only=True) as file:
        headers = [dict(part.header) for part in file.parts]  # gone when the file is closed
    if len(headers) != 1:
        raise InputError(f"has {len(headers)} parts; save each as a picture of its own")
    header = headers[0]
    if header.get("type", OpenEXR.scanlineimage) not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise InputError("is a deep picture; save a flat one")
    names = sorted(channel.name for channel in header["channels"])
    colours = "RGB" if {*"RGB"} <= {*names} else "Y" if "Y" in names else ""
    if not colours:
        raise InputError(f"has the channels {', '.join(names)[:60]}; expected R, G and B, or Y")
    window, display = (np.ravel(header[name]).tolist() for name in ("dataWindow", "displayWindow"))
    if window != display:
        raise InputError("its data window is not its display window; save the whole picture")
    left, top, right, bottom = map(int, window)
    others = [name for name in names if name not in {*colours, "A"}]
    return {
        "shape": (bottom - top + 1, right - left + 1, len(colours)),
        "dtype": np.dtype(np.float32),
        "alpha": "A" in names,
        "unused": f"the channels {', '.join(others)}"[:80] if others else "",
    }


def _exr_pixels(picture: Picture) -> tuple[np.ndarray, int]:
    import OpenEXR

    names = ("RGB" if picture.shape[2] == 3 else "Y") + "A" * picture.alpha
    with picture.path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True) as file:
        channels = file.parts[0].channels
        return np.stack([np.float32(channels[name].pixels) for name in names], axis=-1), UPRIGHT


def _turned(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Pixels of a file upright: from 5 on its rows are columns; then either may run backwards."""
    if 5 <= orientation <= 8:
        pixels = pixels.swapaxes(0, 1)
    up, left = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    return pixels[:: -1 if up else 1, :: -1 if left else 1]
