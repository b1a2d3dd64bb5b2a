"""Shapes as Mitsuba's plugins."""

from pathlib import Path
from typing import Any

from pcii.errors import InputError
from simgen.assets import asset
from simgen.scene import SceneObject
from simgen.shapes import Card, Mesh, Shape, Sphere


def pose_of(mi: Any, thing: SceneObject) -> Any:
    """From the shape's own axes to the world's."""
    T = mi.ScalarTransform4f
    pose = T().translate(list(thing.position_mm))
    for axis, degrees in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), thing.rotation_deg[::-1], strict=True):
        pose = pose @ T().rotate(list(axis), degrees)
    return pose


def shape_plugin(mi: Any, shape: Shape, pose: Any, folder: Path) -> dict[str, Any]:
    """The Mitsuba shape of an object that stands in this pose."""
    T = mi.ScalarTransform4f
    match shape:
        case Sphere():
            return {"type": "sphere", "to_world": pose @ T().scale(shape.radius_mm)}
        case Card():
            to_world = pose @ card_pose(mi, shape.width_mm, shape.height_mm)
            return {"type": "rectangle", "to_world": to_world}
        case Mesh():
            path = asset(folder, shape.file, "shape.file")
            if path.suffix.lower() != ".ply":
                raise InputError(f"{path}: a mesh must be a .ply file")
            return {"type": "ply", "filename": str(path), "to_world": pose @ T().scale(shape.scale)}


def card_pose(mi: Any, width_mm: float, height_mm: float) -> Any:
    """Mitsuba's rectangle (2 x 2, normal +Z, v upwards) as a card that faces the cameras (-Z).

    Turning about X by 180 degrees brings the normal to -Z and the texture upright: its top row
    lies at -Y, which is up.
    """
    T = mi.ScalarTransform4f
    return T().rotate([1, 0, 0], 180) @ T().scale([width_mm / 2, height_mm / 2, 1])
