"""Pictures of strangers: textures as 8 or 16 bit sRGB, environments as linear radiance."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

LARGEST_TEXTURE_PIXELS = 1 << 26
LARGEST_ENVIRONMENT_BYTES = 1 << 29
_MAGICS = {b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"II*\0": "TIFF", b"MM\0*": "TIFF"}
_EXR_MAGIC = b"\x76\x2f\x31\x01"
_MODES = {"1", "L", "P", "RGB", "LA", "PA", "RGBA", "I;16", "I;16L", "I;16B", "I;16N"}
# Pillow unpacks 16 bit colour to the upper byte alone; read in the other byte order, to the lower.
_OTHER_ORDER = {"16B": "16L", "16L": "16B", "16N": "16B" if np.little_endian else "16L"}


def read_texture(data: bytes) -> np.ndarray:
    """A PNG, JPEG or TIFF file as sRGB (H, W, 3), uint8 or uint16, upright as its EXIF entry says.

    Its size is checked before it is decoded. `ValueError` with the end of a sentence for a file that
    is no opaque RGB, grey or palette picture.
    """
    kind = next((kind for magic, kind in _MAGICS.items() if data.startswith(magic)), None)
    if kind is None:
        raise ValueError("is not a PNG, JPEG or TIFF picture")
    upper = _decoded(data, kind, lambda image: None)
    if upper.dtype != np.uint8 or not _is_deep(data, kind):
        return upper
    lower = _decoded(data, kind, _swap_bytes)
    return upper.astype(np.uint16) << 8 | lower


def read_environment(path: Path) -> np.ndarray:
    """An OpenEXR file with the channels R, G and B as linear radiance (H, W, 3) float32, row 0 uppermost.

    `ValueError` with the end of a sentence for another kind of file, one that is too large, and for
    values that are negative or not finite.
    """
    import OpenEXR

    with path.open("rb") as file:
        magic = file.read(10)
    if magic.startswith(b"#?RADIANCE") or magic.startswith(b"#?RGBE"):
        raise ValueError("is a Radiance picture, which is not read; convert it to OpenEXR (.exr)")
    if not magic.startswith(_EXR_MAGIC):
        raise ValueError("is not an OpenEXR picture")
    with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
        if len(file.parts) != 1:
            raise ValueError(f"has {len(file.parts)} parts; give a picture of one")
        header = dict(file.header())
    if header.get("type", OpenEXR.scanlineimage) not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise ValueError("is a deep picture; give a flat one")
    (left, top), (right, bottom) = (corner.astype(np.int64) for corner in header["dataWindow"])
    width, height = int(right - left + 1), int(bottom - top + 1)
    channels = {channel.name: channel for channel in header["channels"]}
    if not {"R", "G", "B"} <= channels.keys():
        raise ValueError(f"has the channels {', '.join(sorted(channels))[:60]}; R, G and B are needed")
    if any(channel.xSampling != 1 or channel.ySampling != 1 for channel in channels.values()):
        raise ValueError("has channels of different sizes")
    if min(width, height) < 1 or width * height * len(channels) * 4 > LARGEST_ENVIRONMENT_BYTES:
        raise ValueError(
            f"is {height} x {width} pixels of {len(channels)} channels, "
            f"more than {LARGEST_ENVIRONMENT_BYTES} bytes"
        )
    if width != 2 * height:
        raise ValueError(
            f"is {height} x {width} pixels; what shines from all around is twice as wide as high"
        )
    with OpenEXR.File(str(path), separate_channels=True) as file:
        planes = file.channels()
        radiance = np.stack([planes[name].pixels for name in "RGB"], axis=-1).astype(np.float32)
    if radiance.shape != (height, width, 3):
        raise ValueError("has channels of different sizes")
    sound = np.isfinite(radiance) & (radiance >= 0)
    if not sound.all():
        i, j, c = np.argwhere(~sound)[0]
        raise ValueError(
            f"has the value {radiance[i, j, c]:g} at row {i}, column {j}; radiance is finite and not negative"
        )
    return radiance


def _opened(data: bytes, kind: str) -> Any:
    from PIL import Image, JpegImagePlugin, PngImagePlugin, TiffImagePlugin

    Image.MAX_IMAGE_PIXELS = None  # our own limit is tighter, and no warning but an error
    plugin = {
        "PNG": PngImagePlugin.PngImageFile,
        "JPEG": JpegImagePlugin.JpegImageFile,
        "TIFF": TiffImagePlugin.TiffImageFile,
    }[kind]
    image = plugin(io.BytesIO(data))
    if image.width * image.height > LARGEST_TEXTURE_PIXELS:
        raise ValueError(
            f"is {image.height} x {image.width} pixels, more than a texture may have "
            f"({LARGEST_TEXTURE_PIXELS})"
        )
    frames = getattr(image, "n_frames", 1)
    if frames != 1:
        raise ValueError(f"holds {frames} pictures; give a file with one")
    if image.mode not in _MODES:
        raise ValueError(f"is a picture in mode {image.mode}; save it as RGB or grey with 8 or 16 bits")
    return image


def _decoded(data: bytes, kind: str, prepare: Callable[[Any], None]) -> np.ndarray:
    from PIL import ImageOps

    with _opened(data, kind) as image:
        prepare(image)
        image.load()
        upright = ImageOps.exif_transpose(image)
    if upright.has_transparency_data and np.asarray(upright.convert("RGBA"))[..., 3].min() < 255:
        raise ValueError("is transparent in places; flatten it on a background")
    if upright.mode.startswith("I;16"):
        grey = np.asarray(upright).astype(np.uint16)
        return np.repeat(grey[..., None], 3, axis=2)
    return np.asarray(upright.convert("RGB"))


def _is_deep(data: bytes, kind: str) -> bool:
    """Whether colours have 16 bits, of which Pillow keeps 8."""
    with _opened(data, kind) as image:
        return any(_depth(_rawmode(tile)) in _OTHER_ORDER for tile in image.tile)


def _swap_bytes(image: Any) -> None:
    tiles = []
    for tile in image.tile:
        raw = _rawmode(tile)
        depth = _depth(raw)
        if depth not in _OTHER_ORDER:
            raise ValueError("mixes numbers of bits")
        swapped = raw.removesuffix(depth) + _OTHER_ORDER[depth]
        args = swapped if isinstance(tile.args, str) else (swapped, *tile.args[1:])
        tiles.append(tile._replace(args=args))
    image.tile = tiles


def _rawmode(tile: Any) -> str:
    args = tile.args if isinstance(tile.args, str) else tile.args[0]
    return args if isinstance(args, str) else ""


def _depth(rawmode: str) -> str:
    return rawmode.rpartition(";")[2]
