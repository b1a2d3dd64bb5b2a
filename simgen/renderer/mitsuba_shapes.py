"""Shapes as Mitsuba's: its own sphere and rectangle, and meshes built in memory, never from a file."""

from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import Assets
from simgen.assets.solids import box, cylinder
from simgen.assets.triangles import Triangles
from simgen.base.strict_models import LARGEST_MM
from simgen.spec.scene import SceneObject
from simgen.spec.shapes import Box, Card, Cylinder, Mesh, Shape, Sphere

SMALLEST_MM = 1e-3


def pose_of(mi: Any, thing: SceneObject) -> Any:
    """From the shape's own axes to the world's."""
    T = mi.ScalarTransform4f
    pose = T().translate(list(thing.position_mm))
    for axis, degrees in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), thing.rotation_deg[::-1], strict=True):
        pose = pose @ T().rotate(list(axis), degrees)
    return pose


def placed_shape(mi: Any, shape: Shape, pose: Any, assets: Assets, surface: dict[str, Any]) -> Any:
    """The Mitsuba shape (or the plugin that makes it) of an object in this pose with this surface."""
    T = mi.ScalarTransform4f
    match shape:
        case Sphere():
            to_world = pose @ globe_pose(mi) @ T().scale(shape.radius_mm)
            return {"type": "sphere", "to_world": to_world, "bsdf": surface}
        case Card():
            to_world = pose @ card_pose(mi, shape.width_mm, shape.height_mm)
            return {"type": "rectangle", "to_world": to_world, "bsdf": surface}
        case Box():
            triangles = box(shape.width_mm, shape.height_mm, shape.depth_mm)
            return _mesh(mi, triangles, 1.0, pose, surface)
        case Cylinder():
            return _mesh(mi, cylinder(shape.radius_mm, shape.length_mm), 1.0, pose, surface)
        case Mesh():
            triangles = assets.mesh(shape.file)
            _check_size(shape, triangles)
            return _mesh(mi, triangles, shape.scale, pose, surface)


def card_pose(mi: Any, width_mm: float, height_mm: float) -> Any:
    """Mitsuba's rectangle (2 x 2, normal +Z, v upwards) as a card that faces the cameras (-Z).

    Turning about X by 180 degrees brings the normal to -Z and the texture upright: its top row
    lies at -Y, which is up.
    """
    T = mi.ScalarTransform4f
    return T().rotate([1, 0, 0], 180) @ T().scale([width_mm / 2, height_mm / 2, 1])


def globe_pose(mi: Any) -> Any:
    """Mitsuba's sphere (first row of a texture about +Z, its middle column at -X) as a globe.

    The first row comes to -Y, which is up, and the middle to -Z, towards the cameras.
    """
    return mi.ScalarTransform4f([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])


def _check_size(shape: Mesh, triangles: Triangles) -> None:
    reach = float(np.abs(triangles.positions).max()) * shape.scale
    extent = float(np.ptp(triangles.positions, axis=0).max()) * shape.scale
    if not (extent >= SMALLEST_MM and reach <= LARGEST_MM):
        raise InputError(
            f"shape.scale: with {shape.scale:g} the mesh {shape.file!r} is {extent:g} mm large and reaches "
            f"{reach:g} mm from its origin; {SMALLEST_MM:g} to {LARGEST_MM:g} mm are allowed"
        )


def _mesh(mi: Any, triangles: Triangles, scale: float, pose: Any, surface: dict[str, Any]) -> Any:
    matrix = np.array(pose.matrix, dtype=np.float64)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(surface)
    mesh = mi.Mesh(
        "mesh",
        len(triangles.positions),
        len(triangles.faces),
        props=properties,
        has_vertex_normals=triangles.normals is not None,
        has_vertex_texcoords=triangles.texcoords is not None,
    )
    values = mi.traverse(mesh)
    positions = scale * triangles.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    values["vertex_positions"] = positions.astype(np.float32).ravel()
    values["faces"] = triangles.faces.astype(np.uint32).ravel()
    if triangles.normals is not None:
        values["vertex_normals"] = (triangles.normals @ matrix[:3, :3].T).astype(np.float32).ravel()
    if triangles.texcoords is not None:  # Mitsuba's v runs down a picture
        values["vertex_texcoords"] = (triangles.texcoords * [1, -1] + [0, 1]).astype(np.float32).ravel()
    values.update()
    return mesh
