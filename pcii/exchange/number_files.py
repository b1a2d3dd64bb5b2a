"""Numbers in files: pictures (PNG, JPEG, TIFF, OpenEXR, PFM) and arrays (NumPy, MATLAB, HDF5).

Pillow, tifffile and OpenEXR read pictures, within their own limits of size. A .npy file is mapped into
memory, and read piece by piece; of other files an array is read whole, and a key names one of several.
"""

import logging
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, times, visible

LARGEST_BYTES = 1 << 33
"""Most memory of all pages of a TIFF file, and of the array of an HDF5 file: 8 GiB."""
STARTS = {
    "PNG": b"\x89PNG\r\n\x1a\n",
    "JPEG": b"\xff\xd8\xff",
    "TIFF": (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
    "EXR": b"\x76\x2f\x31\x01",
    "PFM": b"Pf",
}
GIT_LFS_START = b"version https://git-lfs"
VIEWS = ("PNG", "JPEG", "TIFF", "EXR")
"""Kinds of pictures of views."""
EXACT = ("PNG", "TIFF", "EXR")
"""Kinds of pictures that keep photon counts."""
PILLOW_MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I;16", "F")
TIFF_KINDS = ("MINISBLACK", "RGB", "CFA", "YCBCR")
TIFF_TYPES = ("bool", "uint8", "uint16", "uint32", "int16", "int32", "float16", "float32", "float64")
SRGB_GAMMA = 0.45455
"""What a PNG file of sRGB may state as its gamma."""
SRGB_PRIMARIES = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""Chromaticities (x, y) of red, green, blue and white, as files may state them. White is first in PNG."""
UPRIGHT = 1
"""The value of an orientation tag (TIFF 6.0, tag 274; EXIF) for pictures that are not to be turned."""
HDF5_START = b"\x89HDF\r\n\x1a\n"
MATLAB_HEAD_BYTES = 512
"""What MATLAB writes before the HDF5 content of a .mat file of version 7.3."""
LEAST_AXES = 3
"""Views have at least as many axes: the only such array of a file is read without a key."""
MOST_NAMED = 6
"""Largest number of arrays that a sentence names."""
FORMATS_EXTRA = 'pip install "photon-integral-imaging[formats]"'


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
    head = _head_of(path)
    return next((kind for kind, starts in STARTS.items() if head.startswith(starts)), None)


def _head_of(path: Path) -> bytes:
    """The first bytes of a file; `InputError` if it cannot be read, and for a pointer of Git LFS."""
    try:
        with path.open("rb") as file:
            head = file.read(MATLAB_HEAD_BYTES + len(HDF5_START))
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
    if head.startswith(GIT_LFS_START):
        raise InputError(f"{path}: is a pointer of Git LFS and not the file itself; run git lfs pull")
    return head


def picture_of(path: Path, kinds: Sequence[str]) -> Picture:
    """The picture in a file of one of these kinds; raises `InputError`, naming the file, if it has none.

    Pictures have one or three channels beside alpha.
    """
    kind = kind_of(path)
    if kind is None or kind not in kinds:
        names = " or ".join(filter(None, [", ".join(kinds[:-1]), kinds[-1]]))
        raise InputError(f"{path}: not a{'n' * names.startswith('E')} {names} picture")
    try:
        picture = {"TIFF": _read_tiff, "EXR": _read_exr}.get(kind, _read_pillow)(path)
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}") from None
    except MemoryError:
        raise
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: damaged or cut off, it cannot be read ({visible(str(fault))})") from None
    if picture.shape[2] not in (1, 3):
        raise InputError(f"{path}: has {picture.shape[2]} channels; expected 1 or 3")
    return picture


def decode(picture: Picture) -> np.ndarray:
    """Pixels (pages, H, W, C) of a picture, without alpha.

    Raises `InputError`, naming the file, for pixels that are not opaque, or have to be turned.
    """
    if picture.alpha and not (picture.pixels[..., -1] == picture.most).all():
        raise InputError(
            f"{picture.path}: has an alpha channel that is not opaque everywhere; save it without"
        )
    if picture.orientation != UPRIGHT:
        raise InputError(
            f"{picture.path}: has to be turned (EXIF orientation {picture.orientation}); save it upright"
        )
    return picture.pixels[..., : picture.shape[2]]


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
        if "srgb" not in image.info and not unused:
            gamma, primaries = image.info.get("gamma", SRGB_GAMMA), image.info.get("chromaticity")
            if abs(gamma - SRGB_GAMMA) > 0.01:
                unused = f"the gamma of {gamma:g}"
            elif primaries is not None:
                unused = _primaries(np.roll(primaries, -2))
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
            sizes = " and ".join(sorted({times(one.shape) for one in series})[:3])
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


def _primaries(stated: Any) -> str:
    """What is said of chromaticities: nothing of those of sRGB."""
    return "" if np.allclose(stated, SRGB_PRIMARIES, atol=1e-3) else "the chromaticities"


def _raw_tags(tags: Any) -> Iterator[str]:
    """What is said of the tags of raw pictures (TIFF/EP, DNG) in a TIFF file."""
    if 33422 in tags:
        cells = "".join("RGB"[colour] if colour < 3 else "?" for colour in tags[33422].value)
        yield f"the Bayer pattern {cells} (--cfa {cells})"
    if 50714 in tags or 50717 in tags:
        yield "the levels of black and white"


def _read_exr(path: Path) -> Picture:
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True) as file:
        if len(file.parts) != 1:
            raise InputError(f"has {len(file.parts)} parts; save each as a picture of its own")
        header, channels = file.parts[0].header, file.parts[0].channels
        if not np.array_equal(header["dataWindow"], header["displayWindow"]):
            raise InputError("its data window is not its display window; save the whole picture")
        colours = "RGB" if {*"RGB"} <= {*channels} else "Y"
        if not {*colours} <= {*channels}:
            names = ", ".join(sorted(channels))[:60]
            raise InputError(f"has the channels {names}; expected R, G and B, or Y")
        alpha, others = "A" in channels, sorted({*channels} - {*colours, "A"})
        planes = [np.float32(channels[name].pixels) for name in colours + "A" * alpha]
        aspect = header.get("pixelAspectRatio", 1.0)
        unused = [
            f"the channels {', '.join(others)}"[:80] if others else "",
            _primaries(header.get("chromaticities", SRGB_PRIMARIES)),
            "" if aspect == 1 else f"the pixel aspect ratio of {aspect:g}",
        ]
    pixels = np.stack(planes, axis=-1)[None]
    return Picture(path, pixels, alpha, unused=" and ".join(filter(None, unused)))


def open_array(path: Path, key: str | None = None) -> np.ndarray:
    """The array of a .npy file, mapped into memory, or in memory that of a .npz, .mat or HDF5 file.

    `key` names one of several; it is not needed if one alone has at least three axes. Axes are in the order
    that the writing program shows: of .mat files that of MATLAB. Raises `InputError`, naming the file, for
    what is no array, for a key that it lacks, and for one that memory does not hold.
    """
    head = _head_of(path)
    try:
        if HDF5_START in (head[: len(HDF5_START)], head[MATLAB_HEAD_BYTES:]):
            numbers = _read_hdf5(path, key, is_turned=head.startswith(b"MATLAB"))
        elif head.startswith(b"MATLAB 5.0") or path.suffix.lower() == ".mat":
            numbers = _read_matlab(path, key)
        elif zipfile.is_zipfile(path):
            numbers = _read_archive(path, key)
        elif key is not None:
            raise InputError(f"{path}: --key is for .npz, .mat and HDF5 files, and this has one array")
        else:
            numbers = np.load(path, mmap_mode="r", allow_pickle=False)
    except InputError:
        raise
    except MemoryError:
        raise InputError(f"{path}: its array is larger than the memory; save it as .npy") from None
    except Exception:  # damaged content raises various exceptions
        raise InputError(
            f"{path}: not an array of numbers in a .npy file, as numpy.save writes it, nor in a .npz, .mat "
            "or HDF5 file"
        ) from None
    return numbers


def _read_archive(path: Path, key: str | None) -> np.ndarray:
    """An array of a .npz file, in which objects may be beside it."""
    arrays: dict[str, np.ndarray] = {}
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            with suppress(ValueError):  # of objects, which are not read
                arrays[name] = archive[name]
    return arrays[_chosen(path, key, {name: array.shape for name, array in arrays.items()})]


def _read_matlab(path: Path, key: str | None) -> np.ndarray:
    """An array of a .mat file of version 4 to 7.2, with its axes as MATLAB shows them."""
    from scipy.io import loadmat, whosmat

    shapes = {name: shape for name, shape, kind in whosmat(path) if kind not in ("char", "cell", "struct")}
    name = _chosen(path, key, shapes)
    return np.asarray(loadmat(path, variable_names=[name])[name])


def _read_hdf5(path: Path, key: str | None, is_turned: bool) -> np.ndarray:
    """An array of an HDF5 file; MATLAB stores axes from the last to the first, and these are turned back."""
    try:
        import h5py
    except ModuleNotFoundError:
        raise InputError(f"{path}: is an HDF5 file, which h5py reads; install it: {FORMATS_EXTRA}") from None
    shapes: dict[str, tuple[int, ...]] = {}
    with h5py.File(path, "r") as file:

        def note(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "biufc" and not name.startswith("#"):
                shapes[name] = item.shape[::-1] if is_turned else item.shape

        file.visititems(note)
        stored: Any = file[_chosen(path, key, shapes)]
        if stored.nbytes > LARGEST_BYTES:
            raise InputError(f"{path}: its array is more than {LARGEST_BYTES >> 30} GiB; save it as .npy")
        numbers = stored[()]
    return numbers.T if is_turned else numbers


def _chosen(path: Path, key: str | None, shapes: dict[str, tuple[int, ...]]) -> str:
    """The key of the array to read; `InputError`, naming those that there are, if it is not clear which."""
    large = [name for name, shape in shapes.items() if len(shape) >= LEAST_AXES]
    wanted = key.strip("/") if key is not None else large[0] if len(large) == 1 else ""
    if wanted in shapes:
        return wanted
    if not shapes:
        raise InputError(f"{path}: holds no array of numbers")
    names = listed_names([f"{name} {times(shape)}" for name, shape in shapes.items()], most=MOST_NAMED)
    which = "say which with --key" if key is None else f"and no {visible(key)}; correct --key"
    raise InputError(f"{path}: holds {names}; {which}")


def listed_names(names: Sequence[str], most: int = 3) -> str:
    """The first names of files, and how many more there are.

    >>> listed_names(["a.png", "b.png", "c.png", "d.png", "e.png"])
    'a.png, b.png, c.png and 2 more'
    """
    more = len(names) - most
    return visible(", ".join(names[:most])) + (f" and {more} more" if more > 0 else "")
