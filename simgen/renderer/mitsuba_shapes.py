"""Shapes as Mitsuba's: its own sphere and rectangle, and meshes built in memory, never from a file."""

from dataclasses import replace
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import Assets
from simgen.assets.cutouts import cut_out
from simgen.assets.triangles import Triangles, globe, triangles_of
from simgen.renderer.world_frame import WorldFrame
from simgen.spec.materials import Material
from simgen.spec.scene import SceneObject
from simgen.spec.shapes import Card, Mesh, Shape, Sphere

SMALL_BALL_SHARE = 0.02
"""A ball that shines is a mesh if its radius is a smaller share of the farthest distance in the scene.
Mitsuba aims at its own sphere through a solid angle that loses its digits in single precision: at a radius
of 0.01 of the distance the light is right to 4e-4, at 0.001 to 3e-2."""
BALL_MESH_ROWS = 32
LEAST_BALL_MESH_ROWS = 6
STEPS_PER_EDGE = 100
"""Edges of such a mesh take at least this many steps of single precision, so that its area is right to 1e-4;
the coarsest mesh may take as few as eight."""


def pose_of(mi: Any, thing: SceneObject) -> Any:
    """From the shape's own axes to the world's."""
    T = mi.ScalarTransform4f
    pose = T().translate(list(thing.position_mm))
    for axis, degrees in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), thing.rotation_deg[::-1], strict=True):
        pose = pose @ T().rotate(list(axis), degrees)
    return pose


def placed(mi: Any, frame: WorldFrame, pose: Any) -> Any:
    """A pose in the world as one in the renderer's axes."""
    return pose if frame.is_world else mi.ScalarTransform4f(frame.matrix) @ pose


def placed_shape(
    mi: Any,
    thing: SceneObject,
    assets: Assets,
    surface: Any,
    emitter: dict[str, Any] | None,
    reach_mm: float,
    frame: WorldFrame,
) -> Any:
    """The Mitsuba shape (or the plugin that makes it) of an object with a Mitsuba surface and emitter.

    No two things of the scene are farther from each other than `reach_mm`. Raises `InputError` for a ball
    that shines and is smaller than single precision can tell where it stands.
    """
    T, pose, shape = mi.ScalarTransform4f, placed(mi, frame, pose_of(mi, thing)), thing.shape
    plain = {"bsdf": surface} | ({} if emitter is None else {"emitter": mi.load_dict(emitter)})
    matrix = np.array(pose.matrix, dtype=np.float64)
    if thing.material.opacity is None:
        if (
            isinstance(shape, Sphere)
            and emitter is not None
            and shape.radius_mm < SMALL_BALL_SHARE * reach_mm
        ):
            return _mesh(mi, _small_ball(shape.radius_mm, matrix[:3, 3] / frame.unit), matrix, plain)
        if isinstance(shape, Sphere):
            return {"type": "sphere", "to_world": pose @ globe_pose(mi) @ T().scale(shape.radius_mm)} | plain
        if isinstance(shape, Card):
            to_world = pose @ card_pose(mi, shape.width_mm, shape.height_mm)
            return {"type": "rectangle", "to_world": to_world} | plain
    return _mesh(mi, solid_parts(shape, thing.material, assets), matrix, plain)


def _small_ball(radius_mm: float, position_mm: np.ndarray) -> Triangles:
    """A ball of the sphere's area at this position, as fine as single precision allows."""
    step_mm = float(np.spacing(np.float32(np.abs(position_mm).max() + radius_mm)))
    rows = int(np.pi * radius_mm / (STEPS_PER_EDGE * step_mm))
    if np.pi * radius_mm < 8 * LEAST_BALL_MESH_ROWS * step_mm:
        least_mm = 8 * LEAST_BALL_MESH_ROWS * step_mm / np.pi
        raise InputError(
            f"shape.radius_mm: {radius_mm:g} is too small to shine at {np.linalg.norm(position_mm):.4g} mm "
            f"from the cameras; it must be at least {least_mm:.2g}"
        )
    ball = globe(radius_mm, min(max(rows, LEAST_BALL_MESH_ROWS), BALL_MESH_ROWS))
    corner = ball.positions.astype(np.float64)[ball.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    share = np.linalg.norm(across, axis=1).sum() / 2 / (4 * np.pi * radius_mm**2)
    return replace(ball, positions=(ball.positions / np.sqrt(share)).astype(np.float32))


def solid_parts(shape: Shape, material: Material, assets: Assets) -> Triangles:
    """Where a shape of this material is, as triangles in mm; all of it without an opacity.

    Raises `InputError` for an opacity that cannot be laid on the shape or leaves nothing of it.
    """
    triangles = triangles_of(shape, assets.meshes)
    if material.opacity is None:
        return triangles
    where = "material.opacity"
    if isinstance(shape, Sphere):
        raise InputError(f"{where}: it cannot be laid on a sphere; give a mesh")
    check_texcoords(where, "leave it out", shape, assets)
    try:
        left = cut_out(triangles, assets.numbers(material.opacity, where)[..., 0], tiled=material.tiled)
    except ValueError as fault:
        raise InputError(f"{where}: {fault}") from None
    if left is None:
        raise InputError(f"{where}: leaves nothing of the surface")
    return left


def check_texcoords(where: str, instead: str, shape: Shape, assets: Assets) -> None:
    """`InputError` for a picture on a mesh that does not say where it lies."""
    if isinstance(shape, Mesh) and assets.meshes[shape.file].texcoords is None:
        raise InputError(
            f"{where}: it cannot be laid on {shape.file!r}, which has no texture coordinates; "
            f"add them to the file, or {instead}"
        )


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


def _mesh(mi: Any, triangles: Triangles, matrix: np.ndarray, parts: dict[str, Any]) -> Any:
    properties = mi.Properties()
    for name, plugin in parts.items():
        properties[name] = plugin
    # The renderer aims at lamps as if their faces were flat; with smoothed normals it would be off.
    normals = None if "emitter" in parts else triangles.normals
    mesh = mi.Mesh(
        "mesh",
        len(triangles.positions),
        len(triangles.faces),
        props=properties,
        has_vertex_normals=normals is not None,
        has_vertex_texcoords=triangles.texcoords is not None,
    )
    values = mi.traverse(mesh)
    positions = triangles.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    values["vertex_positions"] = positions.astype(np.float32).ravel()
    values["faces"] = triangles.faces.astype(np.uint32).ravel()
    if normals is not None:
        values["vertex_normals"] = (normals @ matrix[:3, :3].T).astype(np.float32).ravel()
    if triangles.texcoords is not None:  # Mitsuba's v runs down a picture
        values["vertex_texcoords"] = (triangles.texcoords * [1, -1] + [0, 1]).astype(np.float32).ravel()
    values.update()
    return mesh
