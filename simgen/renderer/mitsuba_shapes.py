"""Where things stand in the renderer, and their shapes: Mitsuba's sphere and rectangle, or meshes.

Cameras and objects are brought to the axes of a Mitsuba file that a scene refers to: not all of Mitsuba's
plugins could be moved (in 3.9 a turned `sdfgrid` is cut off, and scaled curves keep their radius).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pcii.base import InputError
from simgen.assets import Assets, Triangles, cut_out, globe, triangles_of
from simgen.spec import Card, Material, Mesh, SceneObject, Shape, Sphere

SMALL_BALL_SHARE = 0.02
"""A ball that shines is a mesh if its radius is a smaller share of the scene's size. Mitsuba aims at its own
sphere in single precision: at a radius of 0.01 of the distance light is right to 4e-4, at 0.001 to 3e-2."""
BALL_MESH_ROWS = 6, 32
"""The least and largest number of rows of such a mesh."""
STEPS_PER_EDGE = 8, 100
"""Steps of single precision along an edge of it: below the first a ball is refused, from the second on its
area is right to 1e-4."""


@dataclass(frozen=True, eq=False)
class WorldFrame:
    """The similarity from the world to the renderer's axes and unit: p_mm is at `unit` R p_mm + `origin`."""

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
        # The origin is subtracted first: far points are large numbers.
        (x, y, z), (a, b, c) = (self.rotation[:, 2] / self.unit).tolist(), self.origin.tolist()
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
    T, (x, y, z) = mi.ScalarTransform4f, thing.rotation_deg
    pose = T().translate(list(thing.position_mm)) @ T().rotate([0, 0, 1], z)
    return pose @ T().rotate([0, 1, 0], y) @ T().rotate([1, 0, 0], x)


def shape_plugin(
    mi: Any, thing: SceneObject, assets: Assets, parts: dict[str, Any], reach_mm: float, frame: WorldFrame
) -> Any:
    """The Mitsuba shape (or the plugin that makes it) of an object; `parts` are its bsdf and emitter.

    The scene is at most `reach_mm` large. Raises `InputError` for a ball that is too small to shine.
    """
    T, pose, shape = mi.ScalarTransform4f, frame.pose(mi, pose_of(mi, thing)), thing.shape
    matrix, is_whole = np.array(pose.matrix, dtype=np.float64), thing.material.opacity is None
    if isinstance(shape, Card) and is_whole:
        to_world = pose @ card_pose(mi, shape.width_mm, shape.height_mm)
        return {"type": "rectangle", "to_world": to_world} | parts
    if isinstance(shape, Sphere) and is_whole:
        if "emitter" in parts and shape.radius_mm < SMALL_BALL_SHARE * reach_mm:
            return _mesh(mi, _small_ball(shape.radius_mm, matrix[:3, 3] / frame.unit), matrix, parts)
        # Mitsuba's has the first row of a texture about +Z and its middle at -X, a globe at -Y and -Z.
        globe_pose = T([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
        return {"type": "sphere", "to_world": pose @ globe_pose @ T().scale(shape.radius_mm)} | parts
    return _mesh(mi, solid_parts(shape, thing.material, assets), matrix, parts)


def _small_ball(radius_mm: float, position_mm: np.ndarray) -> Triangles:
    """A ball of the sphere's area at this position, as fine as single precision allows."""
    (fewest, most), (least_steps, steps) = BALL_MESH_ROWS, STEPS_PER_EDGE
    step_mm = float(np.spacing(np.float32(np.abs(position_mm).max() + radius_mm)))
    least_mm = least_steps * fewest * step_mm / np.pi
    if radius_mm < least_mm:
        raise InputError(
            f"shape.radius_mm: {radius_mm:g} is too small to shine at {np.linalg.norm(position_mm):.4g} mm "
            f"from the cameras; it must be at least {least_mm:.2g}"
        )
    ball = globe(radius_mm, min(max(int(np.pi * radius_mm / (steps * step_mm)), fewest), most))
    across = across_faces(ball.positions.astype(np.float64)[ball.faces])
    share = np.linalg.norm(across, axis=1).sum() / 2 / (4 * np.pi * radius_mm**2)
    return replace(ball, positions=(ball.positions / np.sqrt(share)).astype(np.float32))


def across_faces(corners: np.ndarray) -> np.ndarray:
    """Normals (M, 3) of triangles (M, 3, 3), as long as twice their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


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
    check_texcoords(where, shape, assets)
    try:
        rest = cut_out(triangles, assets.numbers(material.opacity, where)[..., 0], tiled=material.tiled)
    except ValueError as fault:
        raise InputError(f"{where}: {fault}") from None
    if rest is None:
        raise InputError(f"{where}: leaves nothing of the surface")
    return rest


def check_texcoords(where: str, shape: Shape, assets: Assets) -> None:
    """`InputError` for a picture on a mesh that does not say where it lies."""
    if isinstance(shape, Mesh) and assets.meshes[shape.file].texcoords is None:
        raise InputError(f"{where}: {shape.file!r} has no texture coordinates; add them, or leave it out")


def card_pose(mi: Any, width_mm: float, height_mm: float) -> Any:
    """Mitsuba's rectangle (2 x 2, normal +Z, v upwards) as a card that faces -Z, with v towards -Y."""
    T = mi.ScalarTransform4f
    return T().rotate([1, 0, 0], 180) @ T().scale([width_mm / 2, height_mm / 2, 1])


def _mesh(mi: Any, triangles: Triangles, matrix: np.ndarray, parts: dict[str, Any]) -> Any:
    """A mesh of triangles in mm with a surface and an emitter, moved by a matrix (4, 4)."""
    properties = mi.Properties()
    for name, plugin in parts.items():
        properties[name] = plugin
    # The renderer aims at lamps as if their faces were flat; with smoothed normals it would be off.
    normals, texcoords = None if "emitter" in parts else triangles.normals, triangles.texcoords
    positions = triangles.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    mesh = mi.Mesh(
        "mesh", len(positions), len(triangles.faces), properties, normals is not None, texcoords is not None
    )
    values = mi.traverse(mesh)
    values["vertex_positions"] = positions.astype(np.float32).ravel()
    values["faces"] = triangles.faces.astype(np.uint32).ravel()
    if normals is not None:
        values["vertex_normals"] = (normals @ matrix[:3, :3].T).astype(np.float32).ravel()
    if texcoords is not None:  # Mitsuba's v runs down a picture
        values["vertex_texcoords"] = (texcoords * [1, -1] + [0, 1]).astype(np.float32).ravel()
    values.update()
    return mesh
