"""What every array is: the names of its axes, its meaning and its unit, in files and in xarray alike."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import COLOURS
from pcii.core.camera_grid import CameraGrid

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Label:
    """Description stored with an array: the names of its axes, its meaning, its unit ("1" for none)."""

    dims: tuple[str, ...]
    meaning: str
    unit: str = "1"

    @property
    def conventional(self) -> dict[str, str]:
        """Unit and meaning by the names of the CF conventions, which xarray and its plots use."""
        return {"units": self.unit, "long_name": self.meaning}


VIEW_AXES = ("camera_row", "camera_col", "row", "col")
CAMERA_AXES = VIEW_AXES[:2]
MAP_AXES = VIEW_AXES[2:]

COUNTS_LABELS = {
    "k": Label(("event",), "row of the camera, from the top"),
    "l": Label(("event",), "column of the camera, from the left"),
    "i": Label(("event",), "row of the pixel, from the top"),
    "j": Label(("event",), "column of the pixel, from the left"),
    "n": Label(("event",), "photons that the pixel counted", "photons"),
    "dense": Label(VIEW_AXES, "photons that each pixel counted", "photons"),
    "frame": Label(("photon",), "frame, from 0, that counted it; in the order of the events"),
}
VIEWS_LABELS = {"radiance": Label((*VIEW_AXES, "channel"), "linear radiance")}
PHOTON_TRUTH_LABELS = {
    "object_id": Label(
        ("photon",),
        "key of the manifest's objects that the photon's path hit first; 0 for the "
        "backdrop, -1 for a count without a photon",
    ),
    "z_mm": Label(("photon",), "planar depth of the first hit; +inf for none", "mm"),
}
PHOTON_ORIGIN_LABELS = {
    f"photon_{name}": replace(label, dims=("photon",))
    for name, label in (COUNTS_LABELS | PHOTON_TRUTH_LABELS).items()
    if name not in ("n", "dense", "frame")
}
"""Of each photon of the truth, where it was counted and where it is from."""
_MAPS = {
    "z_mm": Label(MAP_AXES, "planar depth; +inf where nothing is hit", "mm"),
    "object_id": Label(
        MAP_AXES, "key of the manifest's objects; 0 for the backdrop and where nothing is hit"
    ),
    "normal": Label(
        (*MAP_AXES, "axis"),
        "unit normal of the surface in world axes (X right, Y down, Z forward), towards the camera; "
        "0 where nothing is hit",
    ),
    "coverage": Label(
        MAP_AXES, "share of the pixel's square that belongs to the object (or to none) that its centre hits"
    ),
}
TRUTH_LABELS = {
    **_MAPS,
    **{
        f"view_{name}": Label((*CAMERA_AXES, *label.dims), f"of every camera: {label.meaning}", label.unit)
        for name, label in _MAPS.items()
    },
    "in_focus": Label(
        ("plane", *MAP_AXES), "blur half-extent of at most 1 px at each depth of in_focus_z_mm"
    ),
    "visible_views": Label(MAP_AXES, "cameras that see the point; 0 where nothing is hit", "cameras"),
    "camera_position_mm": Label((*CAMERA_AXES, "axis"), "where the cameras really are", "mm"),
    "camera_rotation": Label(
        (*CAMERA_AXES, "axis", "direction"), "its columns are the cameras' right, down and forward directions"
    ),
}
PLANE_AXES = ("plane", *MAP_AXES)
_Z_MM = Label(("plane",), "planar depth of each section", "mm")
SECTIONS_LABELS = {
    "z_mm": _Z_MM,
    "counts": Label((*PLANE_AXES, "channel"), "sum of the samples that meet at each voxel", "photons"),
    "coverage": Label((*PLANE_AXES, "channel"), "how many samples that was", "samples"),
    "estimate": Label((*PLANE_AXES, "channel"), "mean of the samples", "photons"),
    "variance": Label((*PLANE_AXES, "channel"), "variance of the samples", "photons^2"),
}
SEGMENTED_LABELS = {
    "z_mm": _Z_MM,
    "in_focus": Label(PLANE_AXES, "whether the voxel is in focus"),
    "photon_in_focus": Label(
        ("plane", "event"),
        "whether the photons of each event, in (k, l, i, j) order, come from what is in focus",
    ),
}
DEPTH_LABELS = {
    "z_mm": Label(MAP_AXES, "planar depth at the virtual centre; NaN where there is no answer", "mm"),
    "confidence": Label(MAP_AXES, "from 0 (no answer) to 1"),
}
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
