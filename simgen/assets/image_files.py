"""Pictures of strangers: textures as 8 or 16 bit sRGB, environments as linear radiance."""

from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.pictures.picture_files import decode, kind_of, picture_of

MOST_TEXTURE_PIXELS = 1 << 26


def read_texture(path: Path, *, alpha: bool = False) -> np.ndarray:
    """A PNG, JPEG or TIFF file as sRGB (H, W, 3), uint8 or uint16, upright as its EXIF entry says.

    `InputError` for a file that is no single RGB, grey or palette picture, or is not opaque; with `alpha`
    that is a fourth channel if the file has it.
    """
    picture = picture_of(path, ("PNG", "JPEG", "TIFF"), MOST_TEXTURE_PIXELS)
    if picture.pages != 1:
        raise InputError(f"{path}: holds {picture.pages} pictures; give a file with one")
    if picture.dtype.kind == "f":
        raise InputError(f"{path}: a picture of {picture.dtype}; save it as RGB or grey with 8 or 16 bits")
    (pixels,) = decode(picture, turn=True, alpha=alpha)
    if picture.dtype == np.bool_ or picture.bits is not None:
        pixels = np.round(pixels * (65535 / picture.most)).astype(np.uint16)
    if picture.shape[2] == 1:
        pixels = np.concatenate([np.repeat(pixels[..., :1], 3, axis=2), pixels[..., 1:]], axis=2)
    return pixels


def read_environment(path: Path) -> np.ndarray:
    """An OpenEXR file with the channels R, G and B as linear radiance (H, W, 3) float32, row 0 uppermost.

    `InputError` for another kind of file, one that is too large, and for values that are negative or not
    finite.
    """
    if kind_of(path) != "EXR":
        raise InputError(f"{path}: not an OpenEXR picture; convert it to OpenEXR (.exr)")
    picture = picture_of(path, ("EXR",))
    height, width, channels = picture.shape
    if channels != 3:
        raise InputError(f"{path}: this file has the channel Y; R, G and B are needed")
    if width != 2 * height:
        raise InputError(
            f"{path}: this file is {height} x {width} pixels; what shines from all around is twice as wide "
            "as high"
        )
    (radiance,) = decode(picture)
    sound = np.isfinite(radiance) & (radiance >= 0)
    if not sound.all():
        i, j, c = np.argwhere(~sound)[0]
        raise InputError(
            f"{path}: has the value {radiance[i, j, c]:g} at row {i}, column {j}; "
            "radiance is finite and not negative"
        )
    return radiance
