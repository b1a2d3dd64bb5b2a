"""Pictures with the poses of their cameras: transforms.json as nerfstudio and its kin write it.

What `simgen export --format nerfstudio` writes comes back with its grid, white and unit.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import Truth
from pcii.exchange.export_pictures import photon_numbers
from pcii.importing.array_files import opened_array
from pcii.importing.image_folders import check_size, headers_of, radiance_of
from pcii.importing.light_encoding import Encoding
from pcii.pictures.picture_files import Picture, decode, kind_of, picture_of
from pcii.transforms.film_sizes import FilmSize, camera_grid_of
from pcii.transforms.grid_of_poses import PoseGrid, find_grid
from pcii.transforms.parsed_members import Members
from pcii.transforms.transforms_file import (
    DEPTH_UNIT,
    DEPTH_UNIT_M,
    TRANSFORMS,
    TransformsFile,
)

DEPTH_KINDS = ("PNG", "TIFF")
"""Kinds of pictures of depths: whole numbers of a unit."""
MOST_EXACT = 255
"""Largest count of which pictures of 8 bits keep every one."""
BRIGHTEST = 1e30
"""Radiance of white lies within this and its inverse, which float32 holds with all digits."""


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """Radiance or, of exported photons, counts; what is known of depths; and what is to be said."""

    images: Views | PhotonCounts
    view_z_mm: np.ndarray | None
    """Planar depth of every view (K, L, H, W) float32, +inf where nothing is hit."""
    truth: Truth | None
    """Depth of the middle view, which is the virtual centre of an odd grid."""
    radiance_unit: str | None
    notes: list[str]


def transforms_in(source: Path) -> Path | None:
    """The file to read if `source` is a .json file or a folder with a transforms.json, else None."""
    if source.suffix == ".json" and source.is_file():
        return source
    return source / TRANSFORMS if (source / TRANSFORMS).is_file() else None


def import_posed_pictures(
    file: TransformsFile,
    *,
    film: FilmSize | None = None,
    encoding: Encoding | None = None,
    report: Report = silent,
) -> PosedPictures:
    """Views, cameras and depths of a transforms.json, whose poses are of one plane grid of parallel cameras.

    Of a stranger's file only the ratio of focal length and pixel size is known: `film` tells one of them.
    Whole numbers are sRGB and floats are linear, unless `encoding` says otherwise. Raises `InputError`,
    naming file and member, frame or picture, for what is missing, wrong, or no such grid.
    """
    if file.stack_path is not None:
        raise InputError(
            f"{file.path}: file_path: has the pictures of all frames in one file; expected a file_path in "
            "each frame"
        )
    found = find_grid(file)
    grid, notes = camera_grid_of(file, found, film)
    pictures = headers_of(_files(file, found, file.file_paths))
    first: Picture = pictures[0, 0]
    if first.shape[:2] != (file.height, file.width):
        raise InputError(
            f"{first.path}: is {first.shape[0]} x {first.shape[1]} px, where {file.path.name} says "
            f"{file.height} x {file.width}, rows x columns"
        )
    check_size(file.path, (*pictures.shape, *first.shape))
    light = _Light.of(file, encoding)
    numbers = np.empty((*pictures.shape, *first.shape), np.float32)
    for done, (camera, picture) in enumerate(np.ndenumerate(pictures), start=1):
        numbers[camera] = radiance_of(picture, next(decode(picture)), light.encoding)
        report("pictures", done, pictures.size)
    images, of_light = light.images(numbers, grid)
    depths, of_depth = _depths(file, found)
    truth = None
    if depths is not None and grid.rows % 2 and grid.cols % 2:
        middle = depths[grid.rows // 2, grid.cols // 2]
        truth = Truth(middle, np.zeros(middle.shape, np.int16), {})
    return PosedPictures(images, depths, truth, light.unit, [*notes, *of_light, *of_depth])


def _files(file: TransformsFile, found: PoseGrid, paths: tuple[str | None, ...]) -> np.ndarray:
    """Paths (K, L), object, of the files of each camera."""
    files = np.empty(found.numbers.shape, object)
    for camera, number in np.ndenumerate(found.numbers):
        files[camera] = file.path.parent / str(paths[number])
    return files


@dataclass(frozen=True)
class _Light:
    """What the numbers of pictures are."""

    file: Path
    encoding: Encoding | None
    is_photons: bool = False
    white: float = 1.0
    unit: str | None = None
    cfa: str | None = None

    @classmethod
    def of(cls, file: TransformsFile, encoding: Encoding | None) -> "_Light":
        """That of an export if the file says it, else as strangers' pictures are."""
        told = Members(file.path, "", file.document)
        if "quantity" not in told.values or "white" not in told.values:
            return cls(file.path, encoding)
        quantity, unit, cfa = (told.values.get(name) for name in ("quantity", "unit", "cfa"))
        if quantity not in ("radiance", "photons"):
            raise told.fault("quantity", "expected radiance or photons")
        if encoding is not None:
            raise told.fault("quantity", "tells what numbers are; leave out --linear, --srgb and --gamma")
        if unit is not None and not isinstance(unit, str):
            raise told.fault("unit", "expected text")
        if cfa is not None and not isinstance(cfa, str):
            raise told.fault("cfa", "expected a Bayer pattern such as GRBG")
        white = told.above_zero("white", BRIGHTEST)
        if quantity == "photons":
            return cls(file.path, "linear", True, white, None, cfa)
        return cls(file.path, "srgb", False, white, unit)

    def images(self, shares: np.ndarray, grid: CameraGrid) -> tuple[Views | PhotonCounts, list[str]]:
        """What pictures (K, L, H, W, C) of shares of white show, and what is to be said of it."""
        if not self.is_photons:
            return Views(self._of_white(shares), grid), []
        try:
            if (
                self.white <= MOST_EXACT
                and self.white.is_integer()
                and 0 <= shares.min() <= shares.max() <= 1
            ):
                counts = np.rint(shares[..., 0] * self.white).astype(np.uint8)
                if (photon_numbers(counts, self.white) == np.rint(shares[..., 0] * 255)).all():
                    return PhotonCounts.from_dense(counts, grid, cfa=self.cfa), []
            views = Views(self._of_white(shares[..., :1]), grid, self.cfa)
        except InputError as fault:
            raise InputError(f"{self.file}: {fault}") from None
        return views, ["pictures of 8 bits do not keep every photon: they are taken for radiance"]

    def _of_white(self, shares: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore"):  # whoever saves the views refuses infinity
            return shares * np.float32(self.white)


def _depths(file: TransformsFile, found: PoseGrid) -> tuple[np.ndarray | None, list[str]]:
    """Depth of every view in mm, and what is to be said of it."""
    without = [number for number, path in enumerate(file.depth_paths) if path is None]
    if len(without) == len(file.depth_paths):
        return None, []
    if without:
        return None, [f"without true depth: {file.frame_name(without[0])} has no depth_file_path"]
    told = Members(file.path, "", file.document)
    unit_mm = 1000 * (told.above_zero(DEPTH_UNIT) if told.has(DEPTH_UNIT) else DEPTH_UNIT_M)
    depths = np.empty((*found.numbers.shape, file.height, file.width), np.float32)
    for camera, path in np.ndenumerate(_files(file, found, file.depth_paths)):
        numbers = _depth_numbers(path)
        if numbers is None:
            return None, [f"without true depth: {visible(path.name)} is no .npy, PNG or TIFF of one channel"]
        if numbers.shape != depths.shape[2:]:
            raise InputError(
                f"{path}: expected {file.height} x {file.width} numbers, as the pictures have, got "
                f"{' x '.join(map(str, numbers.shape))}"
            )
        with np.errstate(over="ignore"):
            z_mm = numbers.astype(np.float32) * np.float32(unit_mm)
        if not (z_mm >= 0).all():
            raise InputError(f"{path}: holds NaN or depths below 0")
        depths[camera] = np.where(z_mm == 0, np.float32(np.inf), z_mm)
    return depths, [f"with the true depth of every view, in units of {unit_mm:g} mm, 0 where nothing is hit"]


def _depth_numbers(path: Path) -> np.ndarray | None:
    """Numbers (H, W) of a file of depth; None for a kind of file that has no unit that is agreed on."""
    if path.suffix == ".npy":
        numbers: Any = opened_array(path)[0]
        return numbers if numbers.dtype.kind in "fu" else None
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if kind_of(path) not in DEPTH_KINDS:
        return None
    picture = picture_of(path, DEPTH_KINDS)
    return next(decode(picture))[..., 0] if picture.shape[2] == 1 else None
