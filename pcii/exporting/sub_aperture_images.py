"""Sub-aperture images: a PNG for each view, named by row and column of its camera, and the cameras as JSON.

    counts/03_04.png    photons of each pixel: the number itself, 8 bits if that is enough, else 16
    radiance/03_04.png  radiance, 16 bits: 65535 is `full_scale` of camera.json
    .../camera.json     the grid, and what the numbers of the images mean

Images of a Bayer sensor stay mosaics, in grey.
"""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.exchange.written_pixels import write_png
from pcii.exporting.view_names import row_and_column
from pcii.io.dataset import Dataset
from pcii.store.safe_files import json_bytes

CAMERA = "camera.json"
MOST = {8: 255, 16: 65535}


def write_sub_aperture_images(dataset: Dataset, folder: Path) -> None:
    """Write a folder of counts, of radiance, or both, whichever the dataset has."""
    if not dataset.has_counts and dataset.views is None:
        raise InputError(f"{dataset.path}: has neither counts nor radiance, so there are no images to export")
    if dataset.has_counts:
        _write_counts(dataset.counts, dataset.path, folder / "counts")
    if dataset.views is not None:
        unit = str(dataset.manifest.get("radiance_unit", "1"))
        _write_radiance(dataset.views, unit, dataset.path, folder / "radiance")


def _write_counts(counts: PhotonCounts, path: Path, folder: Path) -> None:
    most = int(counts.events.n.max(initial=0))
    bits = next((bits for bits, limit in MOST.items() if most <= limit), None)
    if bits is None:
        raise InputError(
            f"{path}: a pixel has {most} photons, and PNG holds at most {MOST[16]}; export events or exr"
        )
    meaning = {
        "quantity": "photons",
        "unit": "photons",
        "full_scale": MOST[bits],
        "bits": bits,
        "frames": counts.readout.frames,
        "bits_per_frame": counts.readout.bits,
    }
    dtype = np.uint8 if bits == 8 else np.uint16
    folder.mkdir()
    for k, l in np.ndindex(counts.grid.rows, counts.grid.cols):
        write_png(folder / f"{row_and_column(counts.grid, k, l)}.png", counts.view(k, l).astype(dtype))
    _write_camera(counts.grid, counts.cfa, meaning, folder)


def _write_radiance(views: Views, unit: str, path: Path, folder: Path) -> None:
    cameras = list(np.ndindex(views.grid.rows, views.grid.cols))
    ends = [(float(image.min()), float(image.max())) for image in (views.view(k, l) for k, l in cameras)]
    darkest, brightest = min(low for low, _ in ends), max(high for _, high in ends)
    if darkest < 0:
        raise InputError(
            f"{path}: radiance goes down to {darkest:.3g}, and PNG holds nothing below 0; export exr"
        )
    full_scale = brightest if brightest > 0 else 1.0
    folder.mkdir()
    for k, l in cameras:
        share = views.view(k, l).astype(np.float64) / full_scale
        image = np.round(MOST[16] * share).astype(np.uint16)
        write_png(
            folder / f"{row_and_column(views.grid, k, l)}.png",
            image[..., 0] if image.shape[2] == 1 else image,
        )
    meaning = {"quantity": "radiance", "unit": unit, "full_scale": full_scale, "bits": 16}
    _write_camera(views.grid, views.cfa, meaning, folder)


def _write_camera(grid: CameraGrid, cfa: str | None, meaning: Mapping[str, Any], folder: Path) -> None:
    document = {
        "images": "ROW_COLUMN.png, camera rows from the top, columns from the left, both from 0",
        **meaning,
        "encoding": "linear: value = number / (2^bits - 1) * full_scale",
        "cfa": cfa,
        **asdict(grid),
        "optical_axis_px": [(grid.width - 1) / 2, (grid.height - 1) / 2],
        "geometry": (
            "Parallel pinhole cameras in a plane, on a grid centred at X = Y = 0; pairs are (x, y), X to the "
            "right, Y down, lengths in mm. optical_axis_px is (column, row) with pixel centres at whole "
            "numbers; in camera (row k, column l) it lies further right by (l - (cols-1)/2) shear_px x and "
            "further down by (k - (rows-1)/2) shear_px y. A point at depth z moves left by "
            "focal_mm pitch_mm x / (z pixel_mm) - shear_px x pixels from a camera to the next on its right."
        ),
    }
    (folder / CAMERA).write_bytes(json_bytes(document))
