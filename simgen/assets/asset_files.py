"""Files that a scene brings along, as plain arrays that are checked once, before the renderer sees them."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from pcii.base.errors import InputError
from pcii.base.srgb import srgb_to_linear
from pcii.exchange.pixel_files import decode, kind_of, picture_of
from simgen.assets.mesh_files import read_mesh
from simgen.assets.triangles import Triangles
from simgen.base.asset_names import EnvironmentName, ImageName, MeshName, asset, named_files

LARGEST_TOTAL_BYTES = 1 << 30
MOST_TEXTURE_PIXELS = 1 << 26


@dataclass(frozen=True)
class Assets:
    """The files of one scene, by the names that the scene gives them."""

    images: dict[str, np.ndarray] = field(default_factory=dict)
    environments: dict[str, np.ndarray] = field(default_factory=dict)
    meshes: dict[str, Triangles] = field(default_factory=dict)

    def image(self, name: str) -> np.ndarray:
        """A texture as linear RGB, (H, W, 3) float32 from 0 to 1."""
        pixels = self.images[name]
        largest = np.iinfo(pixels.dtype).max
        return srgb_to_linear(np.arange(largest + 1) / largest).astype(np.float32)[pixels]

    def stored(self, name: str) -> np.ndarray:
        """What an image holds, without the sRGB curve: (H, W, 3) float32 from 0 to 1."""
        pixels = self.images[name]
        return pixels / np.float32(np.iinfo(pixels.dtype).max)

    def numbers(self, name: str, where: str) -> np.ndarray:
        """What a grey image holds, (H, W, 1) float32 from 0 to 1.

        `InputError`, beginning with `where`, if it is coloured.
        """
        pixels = self.stored(name)
        if (pixels != pixels[..., :1]).any():
            raise InputError(
                f"{where}: {name!r} is coloured; save the one channel that is meant as a grey image"
            )
        return pixels[..., :1]

    def environment(self, name: str) -> np.ndarray:
        """Light from all around as linear RGB, (H, W, 3) float32, finite and not negative."""
        return self.environments[name]

    def mesh(self, name: str) -> Triangles:
        """A mesh in the file's own unit."""
        return self.meshes[name]


def read_assets(scene: BaseModel, folder: Path) -> Assets:
    """Decode every file that a scene names. Raises `InputError` for the first that cannot be used."""
    assets = Assets()
    total = 0
    wanted = {(type(name), str(name)): asset(folder, name, where) for where, name in named_files(scene)}
    for (kind, name), path in wanted.items():
        if kind is MeshName:
            mesh = assets.meshes[name] = read_mesh(path)
            total += mesh.positions.nbytes + mesh.faces.nbytes
        elif kind is ImageName:
            total += assets.images.setdefault(name, read_texture(path)).nbytes
        elif kind is EnvironmentName:
            total += assets.environments.setdefault(name, read_environment(path)).nbytes
        if total > LARGEST_TOTAL_BYTES:
            raise InputError(
                f"{path}: with this file the scene's files take more than {LARGEST_TOTAL_BYTES} bytes"
            )
    return assets


def read_texture(path: Path, *, alpha: bool = False, as_stored: bool = False) -> np.ndarray:
    """A PNG, JPEG or TIFF file as sRGB (H, W, 3), uint8 or uint16, upright as its EXIF entry says.

    With `as_stored` that entry is ignored, as glTF allows and Blender does.

    `InputError` for a file that is no single RGB, grey or palette picture, or is not opaque; with `alpha`
    that is a fourth channel if the file has it.
    """
    picture = picture_of(path, ("PNG", "JPEG", "TIFF"), MOST_TEXTURE_PIXELS)
    if picture.pages != 1:
        raise InputError(f"{path}: holds {picture.pages} pictures; give a file with one")
    if picture.dtype.kind == "f":
        raise InputError(f"{path}: a picture of {picture.dtype}; save it as RGB or grey with 8 or 16 bits")
    (pixels,) = decode(picture, turn=None if as_stored else True, alpha=alpha)
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
