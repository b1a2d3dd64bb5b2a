"""One OpenEXR file: a part for each view with its radiance and photons, and one with the truth.

    k03_l04         channels R, G, B, or Y for a mosaic (radiance, float32), and photons (uint32)
    virtual_centre  channels Z (planar depth in mm, float32, infinity for none) and objectId (uint32)

Each part says in `comments` what the grid is, the suggested depths and the photon budget, as JSON, and in
`worldToCamera` where its camera is.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from pcii.exporting.view_names import number_width
from pcii.io.dataset import Dataset

FILE = "views.exr"
CENTRE = "virtual_centre"
MOST_PHOTONS = (1 << 32) - 1
REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities of R, G, B and white of linear sRGB."""


def write_exr_parts(dataset: Dataset, folder: Path) -> None:
    """Write `views.exr`; it is assembled in memory, 4 bytes a channel of each pixel."""
    import OpenEXR

    if not dataset.has_counts and dataset.views is None and dataset.truth is None:
        raise InputError(f"{dataset.path}: has no counts, radiance or truth, so there is nothing to export")
    grid = dataset.grid
    if dataset.has_counts and dataset.counts.events.n.max(initial=0) > MOST_PHOTONS:
        raise InputError(
            f"{dataset.path}: a pixel has more than the {MOST_PHOTONS} photons that EXR holds; export events"
        )
    if dataset.truth is not None and not np.array_equal(dataset.truth.z_mm, np.float32(dataset.truth.z_mm)):
        raise InputError(
            f"{dataset.path}: its true depths have more digits than the float32 of EXR; export events"
        )
    comments = _comments(dataset)
    parts = []
    rows, cols = number_width(grid.rows, 2), number_width(grid.cols, 2)
    for k, l in np.ndindex(grid.rows, grid.cols):
        channels = _channels(dataset, k, l)
        if channels:
            header = _header(comments, _world_to_camera(grid, k, l))
            parts.append(OpenEXR.Part(header, channels, name=f"k{k:0{rows}d}_l{l:0{cols}d}"))
    if dataset.truth is not None:
        truth = dataset.truth
        channels = {"Z": _plane(truth.z_mm, np.float32), "objectId": _plane(truth.object_id, np.uint32)}
        parts.append(OpenEXR.Part(_header(comments, np.eye(4, dtype=np.float32)), channels, name=CENTRE))
    with OpenEXR.File(parts) as file:
        file.write(str(folder / FILE))


def _channels(dataset: Dataset, k: int, l: int) -> dict[str, np.ndarray]:
    channels = {}
    if dataset.views is not None:
        image = dataset.views.view(k, l)
        names = "Y" if image.shape[2] == 1 else "RGB"
        channels = {name: _plane(image[..., c], np.float32) for c, name in enumerate(names)}
    if dataset.has_counts:
        channels["photons"] = _plane(dataset.counts.view(k, l), np.uint32)
    return channels


def _plane(values: np.ndarray, dtype: type) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=dtype)


def _header(comments: str, world_to_camera: np.ndarray) -> dict[str, Any]:
    import OpenEXR

    return {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": REC_709,
        "comments": comments,
        "worldToCamera": world_to_camera,
    }


def _world_to_camera(grid: CameraGrid, k: int, l: int) -> np.ndarray:
    """(4, 4) float32 for row vectors, as OpenEXR has it: (X, Y, Z, 1) M is the point in the camera's axes."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[3, 0] = -(l - (grid.cols - 1) / 2) * grid.pitch_mm[0]
    matrix[3, 1] = -(k - (grid.rows - 1) / 2) * grid.pitch_mm[1]
    return matrix


def _comments(dataset: Dataset) -> str:
    """What the file holds, as JSON."""
    document = {
        "title": dataset.manifest.get("title") or dataset.name,
        "grid": asdict(dataset.grid),
        "cfa": dataset.cfa,
        **(asdict(dataset.counts.readout) if dataset.has_counts else {}),
        "radiance_unit": dataset.manifest.get("radiance_unit"),
        "analysis": {name: dataset.analysis.get(name) for name in ("z_mm", "z_range_mm")},
        "photon_budget": dataset.photon_budget,
        "objects": dict(dataset.manifest.get("objects", {})),
        "axes": "X right, Y down, Z forward, mm; Z is planar depth from the plane of the cameras",
    }
    return json.dumps(document)
