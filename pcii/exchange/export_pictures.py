"""Pictures of 8 bits of all views, and the folder of pictures and poses for nerfstudio and its kin.

    images/03_04.png   8-bit RGB of the camera of row 3, column 4
    depth/03_04.npy    its planar depth in mm, float32, 0 where nothing is hit; if the dataset has view_z_mm
    transforms.json    intrinsics and poses: see `pcii.transforms`

nerfstudio multiplies depths by 0.001, leaves out those that are 0, and takes them along the camera's axis
(nerfstudio_dataparser.py, data_utils.py and losses.py of release 1.1). PNG would hold whole mm.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pcii.base.plain_text import visible
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.figures.pictures import to_srgb8
from pcii.io.dataset import Dataset
from pcii.pictures.written_pixels import write_png
from pcii.sections.demosaicing import demosaic
from pcii.store.safe_files import json_bytes
from pcii.transforms.camera_poses import depths_ahead_mm
from pcii.transforms.transforms_file import DEPTH_UNIT, DEPTH_UNIT_M, TRANSFORMS
from pcii.transforms.written_members import frames_of, intrinsics_of

WHITE_QUANTILE = 0.999
"""Share of the values of the middle view that are at most white. A larger one makes pictures darker."""


@dataclass(frozen=True)
class ViewPictures:
    """The pictures of all views, with one white, and what their numbers are."""

    view: Callable[[int, int], np.ndarray]
    """The picture of camera (k, l), uint8 (H, W, 3)."""
    quantity: Literal["radiance", "photons"]
    """Radiance is encoded as sRGB; photons are proportional to the numbers."""
    white: float
    """Radiance or photons of the number 255; of radiance it is a value of the middle view, float32."""
    unit: str
    meaning: str
    """What the numbers are, as the end of a sentence."""


def pictures_of(dataset: Dataset) -> ViewPictures:
    """Pictures of a dataset's radiance, whose mosaics are demosaiced, or else of its photons, in grey.

    Raises `InputError` for a dataset with neither.
    """
    return _photon_pictures(dataset) if dataset.views is None else _radiance_pictures(dataset, dataset.views)


def _radiance_pictures(dataset: Dataset, views: Views) -> ViewPictures:
    grid, cfa = dataset.grid, views.cfa
    unit = visible(str(dataset.manifest.get("radiance_unit", "radiance")))

    def colours(k: int, l: int) -> np.ndarray:
        image = views.view(k, l)
        return image if cfa is None else demosaic(image[..., 0], cfa=cfa)

    middle = colours(grid.rows // 2, grid.cols // 2)
    white = float(np.float32(np.quantile(middle, WHITE_QUANTILE, method="lower")))
    white = white if white > 0 else 1.0
    mosaic = "" if cfa is None else f"; the {cfa} mosaic is demosaiced by the method of Laroche and Prescott"
    return ViewPictures(
        view=lambda k, l: to_srgb8(colours(k, l), white),
        quantity="radiance",
        white=white,
        unit=unit,
        meaning=f"radiance, encoded as sRGB: 255 is {white:.6g} ({unit}) or more{mosaic}",
    )


def _photon_pictures(dataset: Dataset) -> ViewPictures:
    counts = dataset.counts
    white = max(int(counts.events.n.max(initial=0)), 1)
    mosaic = "" if counts.cfa is None else f"; each pixel of the {counts.cfa} mosaic has one colour"
    return ViewPictures(
        view=lambda k, l: np.repeat(photon_numbers(counts.view(k, l), white)[..., None], 3, axis=2),
        quantity="photons",
        white=float(white),
        unit="photons",
        meaning=f"photon counts in grey, not gamma-encoded: 255 is {white} photons in the pixel{mosaic}",
    )


def photon_numbers(counts: np.ndarray, white: float) -> np.ndarray:
    """Numbers, uint8, of counts up to `white` photons; up to 255 photons each count has its own number."""
    return np.round(255 / white * counts).astype(np.uint8)


def view_name(grid: CameraGrid, k: int, l: int) -> str:
    """Row and column of a camera, "03_04", with as many digits as make the names sort."""
    digits = max(2, len(str(max(grid.rows, grid.cols) - 1)))
    return f"{k:0{digits}d}_{l:0{digits}d}"


def write_nerfstudio(dataset: Dataset, folder: Path) -> None:
    """Write pictures, poses and, where the dataset has them, the depths of all views."""
    grid = dataset.grid
    pictures = pictures_of(dataset)
    depths_mm = depths_ahead_mm(dataset)
    frames = []
    (folder / "images").mkdir()
    if depths_mm is not None:
        (folder / "depth").mkdir()
    for (k, l), pose in zip(np.ndindex(grid.rows, grid.cols), frames_of(dataset), strict=True):
        name = view_name(grid, k, l)
        frame = {"file_path": f"images/{name}.png"}
        write_png(folder / frame["file_path"], pictures.view(k, l))
        if depths_mm is not None:
            frame["depth_file_path"] = f"depth/{name}.npy"
            depth_mm = np.where(np.isfinite(depths_mm[k, l]), depths_mm[k, l], np.float32(0))
            np.save(folder / frame["depth_file_path"], depth_mm)
        frames.append(frame | pose)
    pixels = {"c": 3, "quantity": pictures.quantity, "unit": pictures.unit, "white": pictures.white}
    if pictures.quantity == "photons":
        pixels["cfa"] = dataset.cfa
    if depths_mm is not None:
        pixels[DEPTH_UNIT] = DEPTH_UNIT_M
    document = intrinsics_of(dataset) | pixels | {"frames": frames}
    (folder / TRANSFORMS).write_bytes(json_bytes(document))
