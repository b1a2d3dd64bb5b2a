"""The types as datasets of xarray: named axes, coordinates with units, the camera grid as attributes."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.errors import InputError
from pcii.core.array_labels import MAP_AXES, Label
from pcii.core.bayer import COLOURS
from pcii.core.camera_grid import CameraGrid

if TYPE_CHECKING:
    import xarray

INDEX_MEANINGS = {
    "camera_row": "row of the camera, from the top",
    "camera_col": "column of the camera, from the left",
    "row": "centre of the pixel, from the top",
    "col": "centre of the pixel, from the left",
}
MONOCHROME = "none"
"""What the attribute `cfa` says of a monochrome sensor; attributes in files cannot be None."""


def labelled_dataset(
    arrays: Mapping[str, np.ndarray],
    labels: Mapping[str, Label],
    *,
    grid: CameraGrid | None = None,
    cfa: str | None = None,
    planes_mm: np.ndarray | None = None,
    subpixel: int = 1,
) -> "xarray.Dataset":
    """A dataset of these arrays; `labels` has one for each.

    Cameras, rows and columns are numbered from 0, pixels (of which a view's are divided into `subpixel`) by
    their centres in px of a view; planes are found by their depths in mm, `.sel(plane=540)`. With a grid each
    camera has its position `camera_x_mm`, `camera_y_mm`, and the fields of the grid and `cfa` are attributes.
    Raises `InputError` if xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise InputError("to_xarray: needs the package xarray: pip install xarray") from None
    variables = {
        name: (labels[name].dims, array, dict(labels[name].conventional)) for name, array in arrays.items()
    }
    sizes: dict[str, int] = {}
    for dims, array, _ in variables.values():
        sizes |= zip(dims, array.shape, strict=True)
    coordinates: dict[str, Any] = {}
    for dim in (dim for dim in INDEX_MEANINGS if dim in sizes):
        index, is_pixel = np.arange(sizes[dim]), dim in MAP_AXES
        values = (index + 0.5) / subpixel - 0.5 if is_pixel and subpixel > 1 else index
        attributes = {"units": "px" if is_pixel else "1", "long_name": INDEX_MEANINGS[dim]}
        coordinates[dim] = (dim, values, attributes)
    if sizes.get("channel", 0) == len(COLOURS):
        coordinates["channel"] = ("channel", list(COLOURS), {"long_name": "colour"})
    if "axis" in sizes:
        coordinates["axis"] = ("axis", list("XYZ"), {"long_name": "right, down, forward"})
    if planes_mm is not None:
        attributes = {"units": "mm", "long_name": "planar depth of the plane"}
        coordinates |= dict.fromkeys(("plane", "z_mm"), ("plane", planes_mm, attributes))
    if grid is not None and "camera_row" in sizes:
        for name, dim, cameras, pitch_mm in (
            ("camera_x_mm", "camera_col", grid.cols, grid.pitch_mm[0]),
            ("camera_y_mm", "camera_row", grid.rows, grid.pitch_mm[1]),
        ):
            centred = np.arange(cameras) - (cameras - 1) / 2
            attributes = {"units": "mm", "long_name": "position of the camera"}
            coordinates[name] = (dim, centred * pitch_mm, attributes)
    return xarray.Dataset(variables, coordinates, _attributes(grid, cfa))


def _attributes(grid: CameraGrid | None, cfa: str | None) -> dict[str, Any]:
    if grid is None:
        return {}
    fields = {name: list(x) if isinstance(x, tuple) else x for name, x in asdict(grid).items()}
    return {"cfa": cfa or MONOCHROME, **fields}
