"""Where things stand in the renderer, and their shapes: Mitsuba's sphere and rectangle, or meshes.

A Mitsuba file that a scene refers to is rendered as it is: cameras, and what else stands in the scene, are
brought to its axes. To move the file's shapes would be wrong, since not all of Mitsuba's plugins are right in
every pose (in 3.9 a turned `sdfgrid` is cut off, and curves keep their radius when they are scaled).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import Assets
from simgen.assets.cutouts import cut_out
from simgen.assets.triangles import Triangles, globe, triangles_of
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
"""Steps of single precision that an edge of such a mesh takes at least, so that its area is right to 1e-4."""
LEAST_STEPS_PER_EDGE = 8
"""The same of the coarsest mesh; a smaller ball is refused."""


@dataclass(frozen=True, eq=False)
class WorldFrame:
    """The similarity from the world (X right, Y down, Z forward, mm) to the renderer's axes and unit.

    A point p_mm is at `unit` R p_mm + `origin`, with `rotation` R. The default is the world itself.
    """

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    unit: float = 1.0
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @cached_property
    def is_world(self) -> bool:
        """Whether nothing changes, so that numbers stay what they are to the last bit."""
        return bool(self.unit == 1 and (self.rotation == np.eye(3)).all() and not self.origin.any())

    def points(self, points_mm: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world in the renderer's axes and unit."""
        return points_mm if self.is_world else self.unit * points_mm @ self.rotation.T + self.origin

    def directions(self, directions: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the world in the renderer's axes."""
        return directions if self.is_world else directions @ self.rotation.T

    def points_mm(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the renderer in the world."""
        return points if self.is_world else (points - self.origin) @ self.rotation / self.unit

    def world_directions(self, directions: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the renderer in the world's axes."""
        return directions if self.is_world else directions @ self.rotation

    def z_mm(self, point: Any) -> Any:
        """Planar depth of the renderer's own points, as one of its arrays or as a number."""
        if self.is_world:
            return point.z
        x, y, z = (float(part) for part in self.rotation[:, 2] / self.unit)
        # The origin is subtracted first: far points are large numbers.
        a, b, c = (float(part) for part in self.origin)
        return x * (point.x - a) + y * (point.y - b) + z * (point.z - c)

    def rigid_pose(self, pose: np.ndarray) -> np.ndarray:
        """The pose (4, 4) of what has no size, from the world to the renderer's axes."""
        result = np.eye(4)
        result[:3, :3], result[:3, 3] = self.rotation @ pose[:3, :3], self.points(pose[:3, 3])
        return result

    def pose(self, mi: Any, pose: Any) -> Any:
        """A pose of Mitsuba's from the world to the renderer's axes and unit."""
        if self.is_world:
            return pose
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.unit * self.rotation, self.origin
        return mi.ScalarTransform4f(matrix) @ pose


def pose_of(mi: Any, thing: SceneObject) -> Any:
    """From the shape's own axes to the world's."""
    T = mi.ScalarTransform4f
    pose = T().translate(list(thing.position_mm))
    for axis, degrees in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), thing.rotation_deg[::-1], strict=True):
        pose = pose @ T().rotate(list(axis), degrees)
    return pose


def shape_plugin(
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
    T, pose, shape = mi.ScalarTransform4f, frame.pose(mi, pose_of(mi, thing)), thing.shape
    parts = {"bsdf": surface} | ({} if emitter is None else {"emitter": mi.load_dict(emitter)})
    matrix = np.array(pose.matrix, dtype=np.float64)
    is_whole = thing.material.opacity is None
    if isinstance(shape, Card) and is_whole:
        to_world = pose @ card_pose(mi, shape.width_mm, shape.height_mm)
        return {"type": "rectangle", "to_world": to_world} | parts
    if isinstance(shape, Sphere) and is_whole:
        if emitter is not None and shape.radius_mm < SMALL_BALL_SHARE * reach_mm:
            return _mesh(mi, _small_ball(shape.radius_mm, matrix[:3, 3] / frame.unit), matrix, parts)
        return {"type": "sphere", "to_world": pose @ globe_pose(mi) @ T().scale(shape.radius_mm)} | parts
    return _mesh(mi, solid_parts(shape, thing.material, assets), matrix, parts)


def _small_ball(radius_mm: float, position_mm: np.ndarray) -> Triangles:
    """A ball of the sphere's area at this position, as fine as single precision allows."""
    step_mm = float(np.spacing(np.float32(np.abs(position_mm).max() + radius_mm)))
    least_mm = LEAST_STEPS_PER_EDGE * LEAST_BALL_MESH_ROWS * step_mm / np.pi
    if radius_mm < least_mm:
        raise InputError(
            f"shape.radius_mm: {radius_mm:g} is too small to shine at {np.linalg.norm(position_mm):.4g} mm "
            f"from the cameras; it must be at least {least_mm:.2g}"
        )
    rows = int(np.pi * radius_mm / (STEPS_PER_EDGE * step_mm))
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
        rest = cut_out(triangles, assets.numbers(material.opacity, where)[..., 0], tiled=material.tiled)
    except ValueError as fault:
        raise InputError(f"{where}: {fault}") from None
    if rest is None:
        raise InputError(f"{where}: leaves nothing of the surface")
    return rest


def check_texcoords(where: str, instead: str, shape: Shape, assets: Assets) -> None:
    """`InputError` for a picture on a mesh that does not say where it lies."""
    if isinstance(shape, Mesh) and assets.meshes[shape.file].texcoords is None:
        raise InputError(
            f"{where}: it cannot be laid on {shape.file!r}, which has no texture coordinates; "
            f"add them to the file, or {instead}"
        )


def card_pose(mi: Any, width_mm: float, height_mm: float) -> Any:
    """Mitsuba's rectangle (2 x 2, normal +Z, v upwards) as a card that faces the cameras (-Z).

    Turning about X by 180 degrees brings the normal to -Z and the top row of a texture up, to -Y.
    """
    T = mi.ScalarTransform4f
    return T().rotate([1, 0, 0], 180) @ T().scale([width_mm / 2, height_mm / 2, 1])


def globe_pose(mi: Any) -> Any:
    """Mitsuba's sphere (first row of a texture about +Z, its middle column at -X) as a globe.

    The first row comes to -Y, which is up, and the middle to -Z, towards the cameras.
    """
    return mi.ScalarTransform4f([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])


def _mesh(mi: Any, triangles: Triangles, matrix: np.ndarray, parts: dict[str, Any]) -> Any:
    """A mesh of triangles in mm with a surface and an emitter, moved by a matrix (4, 4)."""
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
