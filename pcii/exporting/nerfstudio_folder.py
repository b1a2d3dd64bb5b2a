"""Pictures with the poses of their cameras, as nerfstudio and its kin read them.

    images/03_04.png   8-bit RGB of the camera of row 3, column 4
    depth/03_04.npy    its planar depth in mm, float32, 0 where nothing is hit; if the dataset has view_z_mm
    transforms.json    intrinsics and poses: see `written_poses`

nerfstudio multiplies depths by 0.001, leaves out those that are 0, and takes them along the camera's axis
(nerfstudio_dataparser.py, data_utils.py and losses.py of release 1.1). PNG would hold whole mm.
"""

from pathlib import Path

import numpy as np

from pcii.exchange.written_pixels import write_png
from pcii.exchange.written_poses import (
    DEPTH_UNIT,
    DEPTH_UNIT_M,
    TRANSFORMS,
    depths_ahead_mm,
    frames_of,
    intrinsics_of,
)
from pcii.exporting.view_names import row_and_column
from pcii.exporting.view_pictures import pictures_of
from pcii.io.dataset import Dataset
from pcii.store.safe_files import json_bytes


def write_nerfstudio(dataset: Dataset, folder: Path) -> None:
    """Write pictures, poses and, where the dataset has them, the depths of all views."""
    grid = dataset.grid
    pictures = pictures_of(dataset)
    depths_mm = depths_ahead_mm(dataset)
    frames = []
    (folder / "images").mkdir()
    if depths_mm is not None:
        (folder / "depth").mkdir()
    for (k, l), members in zip(np.ndindex(grid.rows, grid.cols), frames_of(dataset), strict=True):
        name = row_and_column(grid, k, l)
        frame = {"file_path": f"images/{name}.png"}
        write_png(folder / frame["file_path"], pictures.view(k, l))
        if depths_mm is not None:
            frame["depth_file_path"] = f"depth/{name}.npy"
            known = np.where(np.isfinite(depths_mm[k, l]), depths_mm[k, l], np.float32(0))
            np.save(folder / frame["depth_file_path"], known)
        frames.append(frame | members)
    told = {"c": 3, "quantity": pictures.quantity, "unit": pictures.unit, "white": pictures.white}
    if pictures.quantity == "photons":
        told["cfa"] = dataset.cfa
    if depths_mm is not None:
        told[DEPTH_UNIT] = DEPTH_UNIT_M
    document = intrinsics_of(dataset) | told | {"frames": frames}
    (folder / TRANSFORMS).write_bytes(json_bytes(document))
