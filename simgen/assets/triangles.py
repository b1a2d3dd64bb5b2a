"""Triangle meshes: checked arrays, the shapes of a scene as triangles, and points on a surface.

Axes as in the world: X right, Y down, Z forward; unrotated, -Z faces the cameras and -Y is up.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from pcii.base import InputError
from simgen.base import LARGEST_MM
from simgen.spec import Box, Card, Cylinder, Mesh, Shape, Sphere

MOST_VERTICES = 1 << 22
MOST_FACES = 1 << 22
LARGEST_COORDINATE = 1e9
SMALLEST_MESH_MM = 1e-3
GLOBE_ROWS = 90
"""Of a globe, which has twice as many columns: its area is 3e-4 less than the sphere's."""
CYLINDER_SECTORS = 1024
"""Chords stay within 5e-6 of the radius, so that depth is exact to a millionth of the distance."""
# By face of a box: outwards, and where the picture's right and upper borders lie.
_SIDES = (
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    ((0, 0, 1), (-1, 0, 0), (0, -1, 0)),
    ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    ((-1, 0, 0), (0, 0, -1), (0, -1, 0)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
)
_SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
PROBE_POINTS, PAIRS_AT_ONCE = 1024, 1 << 22
"""Points at which `bears_pictures_once` looks; a hundredth of a picture that is there twice is noticed."""
INSIDE, SAME_PLACE = 1e-4, 1e-3
"""Points nearer to a triangle's sides than `INSIDE` of its height may be a neighbour's, and places nearer to
each other than `SAME_PLACE` of a mesh's size are one."""


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
        cls, positions: np.ndarray, faces: np.ndarray, normals: np.ndarray | None, uv: np.ndarray | None
    ) -> Self:
        """Triangles from numbers of any dtype; vertices that no face uses are left out.

        Raises `ValueError` with the end of a sentence for what cannot be rendered.
        """
        if not len(faces):
            raise ValueError("has no faces")
        if len(positions) > MOST_VERTICES or len(faces) > MOST_FACES:
            raise ValueError(f"has more than {MOST_VERTICES} vertices or {MOST_FACES} faces")
        beyond = faces[(faces < 0) | (faces >= len(positions))]
        if beyond.size:
            raise ValueError(
                f"has a face with vertex {beyond[0]}, but only vertices 0 to {len(positions) - 1} exist"
            )
        used = np.zeros(len(positions), dtype=bool)
        used[faces] = True
        faces = (np.cumsum(used) - 1)[faces]
        corners = _numbers("position", positions[used])
        if not np.ptp(corners, axis=0).any():
            raise ValueError("has no extent: all its vertices are one point")
        if normals is not None:
            normals = _numbers("normal", normals[used])
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            if not lengths.all():
                raise ValueError("has a normal of length 0")
            normals = (normals / lengths).astype(np.float32)
        return cls(
            corners.astype(np.float32),
            faces.astype(np.int32),
            normals,
            None if uv is None else _numbers("texture coordinate", uv[used]).astype(np.float32),
        )


def _numbers(what: str, array: np.ndarray) -> np.ndarray:
    beyond = array[~(np.abs(array) <= LARGEST_COORDINATE)]  # or NaN
    if beyond.size:
        raise ValueError(f"has a {what} of {beyond[0]:g}; numbers up to {LARGEST_COORDINATE:g} are allowed")
    return array.astype(np.float64)


def fan_all(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) of convex polygons, each about its first corner, in the order of the polygons.

    `corners` are those of all polygons one after another, `counts` of them each. Raises `ValueError` with
    the end of a sentence for a polygon of fewer than three.
    """
    if (counts < 3).any():
        raise ValueError(f"has a face of {counts.min()} corners; a face has at least 3")
    first, triangles = np.cumsum(counts) - counts, counts - 2
    number = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    first = np.repeat(first, triangles)
    return corners[np.stack([first, first + number + 1, first + number + 2], axis=-1)]


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


def across_faces(corners: np.ndarray) -> np.ndarray:
    """Normals (M, 3) of triangles (M, 3, 3), as long as twice their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


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
    positions = np.column_stack([(_SQUARE - 0.5) * [width, -height], np.zeros(4)])
    return Triangles.checked(positions, np.array([(0, 1, 2), (0, 2, 3)]), None, _SQUARE)


def globe(radius: float, rows: int = GLOBE_ROWS) -> Triangles:
    """A sphere; the picture goes once around, its middle in front, its upper border at the pole above."""
    columns = 2 * rows
    along, up = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    east, north = (2 * along - 1) * np.pi, (up - 0.5) * np.pi
    normals = np.stack([np.sin(east) * np.cos(north), -np.sin(north), -np.cos(east) * np.cos(north)], axis=-1)
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1)
    faces, texcoords = fan_all(quads.ravel(), np.full(rows * columns, 4)), np.stack([along, up], axis=-1)
    normals = normals.reshape(-1, 3)
    return Triangles.checked(radius * normals, faces, normals, texcoords.reshape(-1, 2))


def box(width: float, height: float, depth: float) -> Triangles:
    """A box; each side bears the whole picture, upright from in front, behind, left and right.

    On the top the picture's lower border is in front, on the bottom its upper one.
    """
    outwards, right, up = np.array(_SIDES, dtype=float).transpose(1, 0, 2)[:, :, None]
    u, v = 2 * _SQUARE.T[..., None] - 1
    positions = (outwards + u * right + v * up).reshape(-1, 3) * np.array([width, height, depth]) / 2
    faces = fan_all(np.arange(len(positions)), np.full(len(_SIDES), 4))
    normals = np.repeat(outwards.reshape(-1, 3), 4, axis=0)
    return Triangles.checked(positions, faces, normals, np.tile(_SQUARE, (len(_SIDES), 1)))


def cylinder(radius: float, length: float) -> Triangles:
    """A closed upright cylinder; the picture goes once around, its middle in front, its borders behind.

    Each end bears the picture's inscribed circle, laid as on a box.
    """
    n = CYLINDER_SECTORS
    angle = np.linspace(-np.pi, np.pi, n + 1)  # from the front towards the right
    ring = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=-1)
    disc, down, along = np.vstack([[0, 0, 0], ring[:-1]]), np.array([0, 1.0, 0]), np.linspace(0, 1, n + 1)
    positions = [radius * ring - length / 2 * down, radius * ring + length / 2 * down]
    texcoords = [np.stack([along, 0 * along + v], axis=-1) for v in (1, 0)]
    normals, upper = [ring, ring], np.arange(n)
    lower = upper + n + 1
    faces = [np.stack([upper, lower, upper + 1], -1), np.stack([upper + 1, lower, lower + 1], -1)]
    for end, side in ((2, -1), (3, 1)):  # the top, the bottom
        positions.append(radius * disc + side * length / 2 * down)
        texcoords.append(0.5 + disc[:, ::2] / 2 * [1, -side])
        normals.append(np.tile(side * down, (n + 1, 1)))
        rim = end * (n + 1) + 1 + upper
        faces.append(np.stack([0 * rim + end * (n + 1), rim, np.roll(rim, -1)], -1)[:, ::-side])
    return Triangles.checked(*map(np.concatenate, (positions, faces, normals, texcoords)))


class SurfacePoints(NamedTuple):
    """Middles (N, 3) of parts of a surface, unit normals outwards, areas (N,), texture coordinates if any."""

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

    across = across_faces(mesh.positions.astype(np.float64)[mesh.faces])
    doubled = np.linalg.norm(across, axis=1)
    normal = np.repeat(across / np.where(doubled > 0, doubled, 1)[:, None], n * n, axis=0)
    texcoord = None if mesh.texcoords is None else at_points(mesh.texcoords)
    area = np.repeat(doubled / (2 * n * n), n * n)
    return SurfacePoints(at_points(mesh.positions), normal, area, texcoord)


def bears_pictures_once(mesh: Triangles) -> bool:
    """Whether texture coordinates are from 0 to 1 and no two places have the same, by trying points."""
    if mesh.texcoords is None or mesh.texcoords.min() < 0 or mesh.texcoords.max() > 1:
        return False
    points = surface_points(mesh, PROBE_POINTS)
    assert points.texcoord is not None
    step = max(1, len(points.texcoord) // PROBE_POINTS)
    texcoord, place = points.texcoord[::step], points.position[::step]
    reach = SAME_PLACE * np.ptp(mesh.positions, axis=0).max()
    for faces in np.array_split(mesh.faces, math.ceil(len(mesh.faces) * len(texcoord) / PAIRS_AT_ONCE)):
        uv, corner = mesh.texcoords[faces].astype(np.float64), mesh.positions[faces].astype(np.float64)
        near = (texcoord > uv.min(axis=1)[:, None]) & (texcoord < uv.max(axis=1)[:, None])
        face, point = np.nonzero(near.all(axis=2))
        shares = barycentric(texcoord[point], uv[face])
        inside = (shares > INSIDE).all(axis=1)
        other_place = np.einsum("nc,ncd->nd", shares[inside], corner[face[inside]])
        if (np.linalg.norm(other_place - place[point[inside]], axis=1) > reach).any():
            return False
    return True
