"""Picture files as arrays: PNG, JPEG, TIFF, OpenEXR and PFM, and the light that their numbers stand for.

Pillow, tifffile and OpenEXR read them, within their own limits of size.
"""

import logging
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pcii.base import InputError, srgb_to_linear, visible

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
OTHER_FILES = {
    b"version https://git-lfs": "is a pointer of Git LFS and not the file itself; run git lfs pull",
    b"SIMPLE  =": "is a FITS file, which is not read; save its array as .npy, TIFF or HDF5",
}
"""Starts of files that people give for pictures or arrays, and what is said of them."""
PILLOW_MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I;16", "F")
TIFF_KINDS = ("MINISBLACK", "RGB", "CFA", "YCBCR")
LIGHT_TYPES = ("uint8", "uint16", "float16", "float32", "float64")
TIFF_TYPES = (*LIGHT_TYPES, "bool", "uint32", "int16", "int32")
SRGB_GAMMA = 0.45455
"""What a PNG file of sRGB may state as its gamma."""
SRGB_PRIMARIES = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""Chromaticities (x, y) of red, green, blue and white, as an EXR file may state them."""
PNG_PRIMARIES = (*SRGB_PRIMARIES[6:], *SRGB_PRIMARIES[:6])
"""The same of a PNG file, where white comes first."""
LARGEST_ENCODED = 2.0
"""Largest encoded float that is taken: white is 1, and sharpened pictures exceed it a little. Numbers of 8
bits or more, which are refused, reach far more: any limit from 1.5 to 100 decides alike."""
UPRIGHT = 1
"""The value of an orientation tag (TIFF 6.0, tag 274; EXIF) for pictures that are not to be turned."""
Encoding = Literal["srgb", "linear"] | float
"""How numbers stand for light: "srgb", "linear", or the exponent of a gamma, such as 2.2."""


@dataclass(frozen=True, eq=False)
class Picture:
    """What is in a file: `pixels` (pages, H, W, C), the last channel opacity if `alpha`.

    `bits`, if not None, are fewer than the type of the pixels has. `unused` names what else is in the file.
    """

    path: Path
    pixels: np.ndarray
    alpha: bool = False
    bits: int | None = None
    orientation: int = UPRIGHT
    unused: str = ""

    @property
    def pages(self) -> int:
        """The number of pages, or frames."""
        return self.pixels.shape[0]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Height, width and channels without alpha."""
        _, height, width, channels = self.pixels.shape
        return height, width, channels - self.alpha

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the pixels."""
        return self.pixels.dtype

    @property
    def most(self) -> int:
        """The number of full light, and of an opaque pixel."""
        if self.bits is not None:
            return (1 << self.bits) - 1
        return np.iinfo(self.dtype).max if self.dtype.kind == "u" else 1

    def layout(self) -> str:
        """Shape and type in words, by which pictures of a grid are compared."""
        height, width, channels = self.shape
        kind = self.dtype if self.bits is None else f"{self.bits} bits"
        pages = f", {self.pages} pages" if self.pages > 1 else ""
        return f"{height} x {width} px, {channels} channels of {kind}{pages}"


def kind_of(path: Path) -> str | None:
    """PNG, JPEG, TIFF, EXR or PFM, by the first bytes of a file; None for any other."""
    with path.open("rb") as file:
        head = file.read(max(map(len, STARTS)))
    return next((kind for start, kind in STARTS.items() if head.startswith(start)), None)


def name_other_file(path: Path) -> None:
    """Raise `InputError` for a file whose start says that it is of a kind that is not read."""
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(max(map(len, OTHER_FILES)))
        for start, sentence in OTHER_FILES.items():
            if head.startswith(start):
                raise InputError(f"{path}: {sentence}")


def picture_of(path: Path, kinds: Sequence[str]) -> Picture:
    """The picture in a file of one of these kinds; raises `InputError`, naming the file, if it has none.

    Pictures have one or three channels beside alpha.
    """
    readers = {"TIFF": _read_tiff, "EXR": _read_exr}
    name_other_file(path)
    try:
        kind = kind_of(path)
        if kind is None or kind not in kinds:
            names = " or ".join(filter(None, [", ".join(kinds[:-1]), kinds[-1]]))
            raise InputError(f"not a{'n' * names.startswith('E')} {names} picture")
        picture = readers.get(kind, _read_pillow)(path)
        if picture.shape[2] not in (1, 3):
            raise InputError(f"has {picture.shape[2]} channels; expected 1 or 3")
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}") from None
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except MemoryError:
        raise
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: damaged or cut off, it cannot be read ({visible(str(fault))})") from None
    return picture


def decode(picture: Picture) -> Iterator[np.ndarray]:
    """Pixels (H, W, C) of each page of a picture, without alpha.

    Raises `InputError`, naming the file, for pixels that are not opaque, or have to be turned.
    """
    pixels = picture.pixels
    if picture.alpha:
        if not (pixels[..., -1] == picture.most).all():
            raise InputError(
                f"{picture.path}: has an alpha channel that is not opaque everywhere; save it without"
            )
        pixels = pixels[..., :-1]
    if picture.orientation != UPRIGHT:
        raise InputError(
            f"{picture.path}: has to be turned (EXIF orientation {picture.orientation}); save it upright"
        )
    yield from pixels


def radiance_of(picture: Picture, pixels: np.ndarray, encoding: Encoding | None) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of a picture's pixels."""
    if picture.dtype.name not in LIGHT_TYPES:
        raise InputError(f"{picture.path}: {picture.dtype} is no type of light; photon counts need --counts")
    try:
        return to_radiance(pixels, encoding, picture.most)
    except InputError as fault:
        raise InputError(f"{picture.path}: {fault}") from None


def to_radiance(numbers: np.ndarray, encoding: Encoding | None, most: int | None = None) -> np.ndarray:
    """Linear radiance, float32, of whole numbers (of 1 at `most`) or of floats.

    `most` is by default the largest number of the type. Without an encoding whole numbers are sRGB, as in
    nearly all picture files, and floats are linear. Raises `InputError` for an encoding that is none, for
    numbers that are NaN or infinite, for encoded ones below 0, and for light that is too bright for float32.

    >>> to_radiance(np.array([0, 128, 255], np.uint8), None).astype(float).round(3).tolist()
    [0.0, 0.216, 1.0]
    >>> to_radiance(np.array([0, 128, 255], np.uint8), "linear").astype(float).round(3).tolist()
    [0.0, 0.502, 1.0]
    """
    is_number = isinstance(encoding, int | float) and 0.1 <= encoding <= 10
    if encoding not in (None, "srgb", "linear") and not is_number:
        raise InputError(f"encoding: expected srgb, linear, or a gamma from 0.1 to 10, got {encoding!r}")
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
    if encoding != "linear" and not is_whole and share.size and share.max() > LARGEST_ENCODED:
        raise InputError(
            f"holds numbers up to {share.max():g}; encoded light is 1 at white: divide by its number"
        )
    with np.errstate(over="ignore"):
        if encoding == "srgb":
            share = srgb_to_linear(share)
        elif encoding != "linear":
            share = (share if is_whole else share.astype(np.float64)) ** encoding
        linear = share.astype(np.float32)
    if not np.isfinite(linear).all():
        raise InputError("holds light that is too bright for float32")
    return linear


def _read_pillow(path: Path) -> Picture:
    from PIL import Image

    warning_off = warnings.catch_warnings(action="ignore")
    with warning_off, Image.open(path, formats=("PNG", "JPEG", "PPM")) as image:
        stored = str(image.tile[0].args) if image.format == "PNG" else ""
        if image.mode not in PILLOW_MODES or stored in ("L;2", "L;4"):
            raise InputError(f"a picture of the kind {stored or image.mode}; save it as RGB or 8-bit grey")
        count, alpha = getattr(image, "n_frames", 1), image.has_transparency_data
        if count != 1 and image.format != "MPO":  # a telephone's JPEG may have a preview
            raise InputError(f"holds {count} pictures; give a file with one")
        unused = f"{count - 1} more pictures" if count != 1 else _profile(image.info.get("icc_profile"))
        gamma = image.info.get("gamma", SRGB_GAMMA)
        primaries = image.info.get("chromaticity", PNG_PRIMARIES)
        if "srgb" not in image.info and not unused:
            if abs(gamma - SRGB_GAMMA) > 0.01:
                unused = f"the gamma of {gamma:g}"
            elif not np.allclose(primaries, PNG_PRIMARIES, atol=1e-3):
                unused = "the chromaticities"
        image.load()  # a PNG may have its orientation after its pixels
        orientation = image.getexif().get(0x0112, UPRIGHT)
        if stored.endswith("16B"):  # of which Pillow keeps 8 bits
            import imagecodecs

            pixels = imagecodecs.png_decode(path.read_bytes())
        elif alpha or image.mode == "P":
            kind = "L" if image.mode.startswith("L") else "RGB"
            pixels = np.array(image.convert(kind + "A" * alpha))
        else:
            pixels = np.array(image)
        if image.format == "PPM":  # a PFM file, whose numbers are multiplied by its scale
            pixels = pixels * np.float32(image.info["scale"])
    pixels = pixels.reshape(1, *pixels.shape[:2], -1)
    return Picture(path, pixels, alpha, None, orientation, unused)


def _read_tiff(path: Path) -> Picture:
    """All frames: also of a file with one header for many, as ImageJ writes large stacks."""
    from tifffile import TiffFile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # faults are raised, not logged
    with TiffFile(path, _multifile=False) as file:  # other files of an OME set are other views
        series: list[Any] = list(file.series)
        page = series[0].keyframe
        height, width, samples = page.imagelength, page.imagewidth, page.samplesperpixel
        kind = getattr(page.photometric, "name", page.photometric)
        if kind not in TIFF_KINDS:
            raise InputError(f"a TIFF picture of the kind {kind}; save it as RGB or as grey whose 0 is black")
        if str(page.dtype) not in TIFF_TYPES:
            raise InputError(f"has pixels of the type {page.dtype}; save it in 8 or 16 bits, or as float32")
        calibration = file.imagej_metadata or {}
        if (calibration.get("c0", 0), calibration.get("c1", 1)) != (0, 1):
            raise InputError("has a calibration of ImageJ (c0, c1); change its type to 32 bits there first")
        if sum(one.nbytes for one in series) > LARGEST_BYTES:
            raise InputError(f"its pages are more than {LARGEST_BYTES >> 30} GiB")
        if len({(one.keyframe.shape, one.dtype) for one in series}) != 1:
            sizes = " and ".join(sorted({" x ".join(map(str, one.shape)) for one in series})[:3])
            raise InputError(f"holds pictures of different sizes or types ({sizes}); save those of one kind")
        parts = []
        for one in series:
            if "C" in one.axes and len({*one.axes} - {*"YXS"}) > 1:  # alone it is the axis of frames
                raise InputError(f"has the axes {one.axes}, frames of several channels C; save one channel")
            pixels = np.asarray(one.asarray(maxworkers=1))
            pixels = np.moveaxis(pixels, one.axes.index("S"), -1) if "S" in one.axes else pixels
            parts.append(pixels.reshape(-1, height, width, samples))
        fewer = page.dtype.kind == "u" and page.bitspersample < 8 * page.dtype.itemsize
        return Picture(
            path,
            np.concatenate(parts) if len(parts) > 1 else parts[0],
            alpha=len(page.extrasamples) == 1,
            bits=page.bitspersample if fewer else None,
            orientation=page.tags.valueof(274, default=UPRIGHT),
            unused=" and ".join(filter(None, [_profile(page.tags.valueof(34675)), *_raw_tags(page.tags)])),
        )


def _profile(content: bytes | None) -> str:
    """What is said of an ICC profile: nothing of that of sRGB, of which there are linear ones too."""
    text = (content or b"").replace(b"\0", b"")
    return "" if not text or (b"sRGB" in text and b"inear" not in text) else "the colour profile"


def _raw_tags(tags: Any) -> Iterator[str]:
    """What is said of the tags of raw pictures (TIFF/EP, DNG) in a TIFF file."""
    if 33422 in tags:
        cells = "".join("RGB"[colour] if colour < 3 else "?" for colour in tags[33422].value)
        yield f"the Bayer pattern {cells} (--cfa {cells})"
    if 50714 in tags or 50717 in tags:
        yield "the levels of black and white"


def _read_exr(path: Path) -> Picture:
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True, header_only=True) as file:
        if len(file.parts) != 1:
            raise InputError(f"has {len(file.parts)} parts; save each as a picture of its own")
        header = file.parts[0].header
        window, display = (np.ravel(header[name]).tolist() for name in ("dataWindow", "displayWindow"))
        primaries = header.get("chromaticities", SRGB_PRIMARIES)
        aspect = header.get("pixelAspectRatio", 1.0)
    if window != display:
        raise InputError("its data window is not its display window; save the whole picture")
    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True) as file:
        channels = file.parts[0].channels
        colours = "RGB" if {*"RGB"} <= {*channels} else "Y"
        if not {*colours} <= {*channels}:
            names = ", ".join(sorted(channels))[:60]
            raise InputError(f"has the channels {names}; expected R, G and B, or Y")
        alpha, others = "A" in channels, sorted({*channels} - {*colours, "A"})
        planes = [np.float32(channels[name].pixels) for name in colours + "A" * alpha]
    unused = f"the channels {', '.join(others)}"[:80] if others else ""
    unused_parts = [unused, "" if np.allclose(primaries, SRGB_PRIMARIES, atol=1e-3) else "the chromaticities"]
    unused_parts.append("" if aspect == 1 else f"the pixel aspect ratio of {aspect:g}")
    return Picture(
        path, np.stack(planes, axis=-1)[None], alpha, unused=" and ".join(filter(None, unused_parts))
    )
