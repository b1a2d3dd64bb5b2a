"""Triangle meshes: checked arrays, the shapes of a scene as triangles, and points on a surface.

Axes as in the world: X right, Y down, Z forward; unrotated, -Z faces the cameras and -Y is up.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from pcii.base.errors import InputError
from simgen.base.strict_models import LARGEST_MM
from simgen.spec.shapes import Box, Card, Cylinder, Mesh, Shape, Sphere

MOST_VERTICES = 1 << 22
MOST_FACES = 1 << 22
LARGEST_COORDINATE = 1e9
SMALLEST_MESH_MM = 1e-3
GLOBE_ROWS = 90
"""Of a globe, which has twice as many columns: its area is 3e-4 less than the sphere's."""
CYLINDER_SECTORS = 1024
"""Chords stay within 5e-6 of the radius, so that depth is exact to a millionth of the distance."""
# By face of the box: outwards, and where the picture's right and upper borders lie.
_SIDES = (
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    ((0, 0, 1), (-1, 0, 0), (0, -1, 0)),
    ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    ((-1, 0, 0), (0, 0, -1), (0, -1, 0)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
)
PROBE_POINTS = 1024
"""Points at which `bears_pictures_once` looks; a hundredth of a picture that is there twice is noticed."""
PAIRS_AT_ONCE = 1 << 22
INSIDE = 1e-4
"""Points nearer to the sides of a triangle than this share of its height may be a neighbour's."""
SAME_PLACE = 1e-3
"""Places nearer to each other than this share of a mesh's size are one."""


@dataclass(frozen=True)
class Triangles:
    """A triangle mesh, of arrays as `checked` makes them.

    `positions` (N, 3) float32, `faces` (M, 3) int32, `normals` (N, 3) float32 of length 1 or None for flat
    faces, `texcoords` (N, 2) float32 or None: u runs right and v up over the picture.
    """

    positions: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    texcoords: np.ndarray | None = None

    @classmethod
    def checked(
        cls,
        positions: np.ndarray,
        faces: np.ndarray,
        normals: np.ndarray | None,
        texcoords: np.ndarray | None,
    ) -> Self:
        """Triangles from numbers of any dtype; vertices that no face uses are left out.

        Raises `ValueError` with the end of a sentence for what cannot be rendered.
        """
        if not len(faces):
            raise ValueError("has no faces")
        if len(positions) > MOST_VERTICES or len(faces) > MOST_FACES:
            raise ValueError(
                f"has {len(positions)} vertices and {len(faces)} faces; at most {MOST_VERTICES} and "
                f"{MOST_FACES} are allowed"
            )
        low, high = int(faces.min()), int(faces.max())
        if low < 0 or high >= len(positions):
            raise ValueError(
                f"has a face with vertex {low if low < 0 else high}, but only vertices 0 to "
                f"{len(positions) - 1} exist"
            )
        used = np.zeros(len(positions), dtype=bool)
        used[faces] = True
        if not used.all():
            faces = (np.cumsum(used) - 1)[faces]
        corners = _numbers("position", positions[used])
        if not np.ptp(corners, axis=0).any():
            raise ValueError("has no extent: all its vertices are one point")
        return cls(
            corners.astype(np.float32),
            faces.astype(np.int32),
            None if normals is None else _unit(_numbers("normal", normals[used])),
            None if texcoords is None else _numbers("texture coordinate", texcoords[used]).astype(np.float32),
        )


def _numbers(what: str, array: np.ndarray) -> np.ndarray:
    is_sound = np.abs(array) <= LARGEST_COORDINATE  # false for NaN
    if not is_sound.all():
        value = float(array[~is_sound][0])
        raise ValueError(f"has a {what} of {value:g}; numbers up to {LARGEST_COORDINATE:g} are allowed")
    return array.astype(np.float64)


def _unit(normals: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not lengths.all():
        raise ValueError("has a normal of length 0")
    return (normals / lengths).astype(np.float32)


def fan_all(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) of convex polygons, each about its first corner, in the order of the polygons.

    `corners` are those of all polygons one after another, `counts` of them each. Raises `ValueError` with
    the end of a sentence for a polygon of fewer than three.
    """
    if len(counts) and counts.min() < 3:
        raise ValueError(f"has a face of {counts.min()} corners; a face has at least 3")
    starts = np.cumsum(counts) - counts
    parts, order = [np.empty((0, 3), corners.dtype)], [np.empty(0, np.int64)]
    for n in np.unique(counts):
        rows = np.flatnonzero(counts == n)
        parts.append(_fans(corners[starts[rows][:, None] + np.arange(n)]))
        order.append(np.repeat(rows, n - 2))
    return np.concatenate(parts)[np.argsort(np.concatenate(order), kind="stable")]


def _fans(polygons: np.ndarray) -> np.ndarray:
    """(M, n) corners of convex polygons as (M (n - 2), 3) triangles about their first corners."""
    n = polygons.shape[1]
    middle = np.arange(1, n - 1)
    first = np.broadcast_to(polygons[:, :1], (len(polygons), n - 2))
    return np.stack([first, polygons[:, middle], polygons[:, middle + 1]], axis=-1).reshape(-1, 3)


def cross_2d(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Cross product of vectors (..., 2) in a plane: twice the area of the triangle between them, signed."""
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def barycentric(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (N, 3) of points (N, 2) in triangles (N, 3, 2); not finite in flat ones."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        second = cross_2d(points - a, c - a) / cross_2d(b - a, c - a)
        third = cross_2d(b - a, points - a) / cross_2d(b - a, c - a)
    return np.stack([1 - second - third, second, third], axis=-1)


def triangles_of(shape: Shape, meshes: Mapping[str, Triangles]) -> Triangles:
    """A shape as triangles in mm, a sphere as a `globe`; `meshes` are those of files by name.

    Raises `InputError` for a mesh whose scale makes it too small or too large.
    """
    match shape:
        case Sphere():
            return globe(shape.radius_mm)
        case Card():
            return card_triangles(shape.width_mm, shape.height_mm)
        case Box():
            return box(shape.width_mm, shape.height_mm, shape.depth_mm)
        case Cylinder():
            return cylinder(shape.radius_mm, shape.length_mm)
        case Mesh():
            return _scaled(shape, meshes[shape.file])


def _scaled(shape: Mesh, mesh: Triangles) -> Triangles:
    scales = np.broadcast_to(shape.scale, 3).astype(np.float64)
    positions = mesh.positions * scales
    reach, extent = float(np.abs(positions).max()), float(np.ptp(positions, axis=0).max())
    if not (extent >= SMALLEST_MESH_MM and reach <= LARGEST_MM):
        raise InputError(
            f"shape.scale: with this the mesh {shape.file!r} is {extent:g} mm large and reaches "
            f"{reach:g} mm from its origin; {SMALLEST_MESH_MM:g} to {LARGEST_MM:g} mm are allowed"
        )
    if (scales == 1).all():
        return mesh
    # A mirror turns the order of corners, which says where outside is.
    faces = mesh.faces if scales.prod() > 0 else mesh.faces[:, ::-1]
    normals = None if mesh.normals is None else mesh.normals / scales
    return Triangles.checked(positions, faces, normals, mesh.texcoords)


def card_triangles(width: float, height: float) -> Triangles:
    """A rectangle that faces the cameras, the picture upright."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    positions = np.column_stack([(corners - 0.5) * [width, -height], np.zeros(4)])
    return Triangles.checked(positions, np.array([(0, 1, 2), (0, 2, 3)]), None, corners)


def globe(radius: float, rows: int = GLOBE_ROWS) -> Triangles:
    """A sphere; the picture goes once around, its middle in front, its upper border at the pole above."""
    columns = 2 * rows
    along, up = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    east, north = (2 * along - 1) * np.pi, (up - 0.5) * np.pi
    normals = np.stack([np.sin(east) * np.cos(north), -np.sin(north), -np.cos(east) * np.cos(north)], axis=-1)
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1)
    return Triangles.checked(
        radius * normals.reshape(-1, 3),
        _fans(quads.reshape(-1, 4)),
        normals.reshape(-1, 3),
        np.stack([along, up], axis=-1).reshape(-1, 2),
    )


def box(width: float, height: float, depth: float) -> Triangles:
    """A box; each side bears the whole picture, upright from in front, behind, left and right.

    On the top the picture's lower border is in front, on the bottom its upper one.
    """
    outwards, right, up = np.array(_SIDES, dtype=float).transpose(1, 0, 2)[:, :, None]
    texcoords = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    u, v = 2 * texcoords.T[..., None] - 1
    positions = outwards + u * right + v * up
    first = 4 * np.arange(len(_SIDES))[:, None, None]
    return Triangles.checked(
        positions.reshape(-1, 3) * np.array([width, height, depth]) / 2,
        (first + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3),
        np.broadcast_to(outwards, positions.shape).reshape(-1, 3),
        np.tile(texcoords, (len(_SIDES), 1)),
    )


def cylinder(radius: float, length: float) -> Triangles:
    """A closed upright cylinder; the picture goes once around, its middle in front, its borders behind.

    Each end bears the picture's inscribed circle, laid as on a box.
    """
    n = CYLINDER_SECTORS
    angle = np.linspace(-np.pi, np.pi, n + 1)  # from the front towards the right
    ring = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=-1)
    down, along = np.array([0, 1.0, 0]), np.linspace(0, 1, n + 1)
    positions = [radius * ring - length / 2 * down, radius * ring + length / 2 * down]
    texcoords = [np.stack([along, 0 * along + v], axis=-1) for v in (1, 0)]
    normals, upper = [ring, ring], np.arange(n)
    lower = upper + n + 1
    faces = [np.stack([upper, lower, upper + 1], -1), np.stack([upper + 1, lower, lower + 1], -1)]
    for side in (-1, 1):  # the top end, the bottom end
        middle = sum(map(len, positions))
        positions.append(np.vstack([[0, 0, 0], radius * ring[:-1]]) + side * length / 2 * down)
        disc = np.vstack([[0, 0, 0], ring[:-1]]) / 2
        texcoords.append(np.stack([0.5 + disc[:, 0], 0.5 - side * disc[:, 2]], axis=-1))
        normals.append(np.tile(side * down, (n + 1, 1)))
        rim = middle + 1 + np.arange(n)
        faces.append(np.stack([0 * rim + middle, rim, np.roll(rim, -1)], -1)[:, ::-side])
    return Triangles.checked(*map(np.concatenate, (positions, faces, normals, texcoords)))


class SurfacePoints(NamedTuple):
    """Middles of N parts of a surface: places (N, 3), normals (N, 3) of length 1 outwards, areas (N,) of the
    parts, texture coordinates (N, 2) where there are any."""

    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    texcoord: np.ndarray | None


def surface_points(mesh: Triangles, number: int) -> SurfacePoints:
    """Middles of n x n like parts of each triangle, with n such that there are about `number` in all."""
    n = max(1, math.isqrt(number // len(mesh.faces)))
    side = np.add.outer(np.arange(n), np.arange(n))
    upright, turned = np.argwhere(side < n) + 1 / 3, np.argwhere(side < n - 1) + 2 / 3
    second, third = np.concatenate([upright, turned]).T / n
    shares = np.stack([1 - second - third, second, third], axis=-1)

    def at_points(values: np.ndarray) -> np.ndarray:
        mixed = np.einsum("pc,mcd->mpd", shares, values.astype(np.float64)[mesh.faces])
        return mixed.reshape(-1, values.shape[1])

    corner = mesh.positions.astype(np.float64)[mesh.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    normal = across / np.where(doubled > 0, doubled, 1)[:, None]
    return SurfacePoints(
        at_points(mesh.positions),
        np.repeat(normal, n * n, axis=0),
        np.repeat(doubled / (2 * n * n), n * n),
        None if mesh.texcoords is None else at_points(mesh.texcoords),
    )


def bears_pictures_once(mesh: Triangles) -> bool:
    """Whether texture coordinates are from 0 to 1 and no two places have the same, by trying points."""
    if mesh.texcoords is None or mesh.texcoords.min() < 0 or mesh.texcoords.max() > 1:
        return False
    points = surface_points(mesh, PROBE_POINTS)
    assert points.texcoord is not None
    step = max(1, len(points.texcoord) // PROBE_POINTS)
    at, place = points.texcoord[::step], points.position[::step]
    uv, corner = mesh.texcoords.astype(np.float64)[mesh.faces], mesh.positions.astype(np.float64)[mesh.faces]
    reach = SAME_PLACE * np.ptp(mesh.positions, axis=0).max()
    chunk = max(1, PAIRS_AT_ONCE // len(at))
    for start in range(0, len(uv), chunk):
        some, of = uv[start : start + chunk], corner[start : start + chunk]
        near = (at[None] > some.min(axis=1)[:, None]) & (at[None] < some.max(axis=1)[:, None])
        triangle, point = np.nonzero(near.all(axis=2))
        shares = barycentric(at[point], some[triangle])
        inside = (shares > INSIDE).all(axis=1)
        other_place = np.einsum("nc,ncd->nd", shares[inside], of[triangle[inside]])
        if (np.linalg.norm(other_place - place[point[inside]], axis=1) > reach).any():
            return False
    return True
