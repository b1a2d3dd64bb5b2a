"""What every stored array is: the names of its axes, its meaning and its unit."""

from dataclasses import dataclass


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
PHOTON_TRUTH_LABELS = {
    "object_id": Label(
        ("photon",),
        "key of the manifest's objects that the photon's path hit first; 0 for the "
        "backdrop, -1 for a count without a photon",
    ),
    "z_mm": Label(("photon",), "planar depth of the first hit; +inf for none", "mm"),
}
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
