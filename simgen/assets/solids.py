"""Shapes as triangles about their position, each face with its own part of the picture.

Axes as in the world: X right, Y down, Z forward; unrotated, -Z faces the cameras and -Y is up.
Texture coordinates run right (u) and up (v).
"""

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import Assets
from simgen.assets.triangles import Triangles, fans
from simgen.base.strict_models import LARGEST_MM
from simgen.spec.shapes import Box, Card, Cylinder, Mesh, Shape, Sphere

SMALLEST_MM = 1e-3
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


def triangles_of(shape: Shape, assets: Assets) -> Triangles:
    """A shape as triangles in mm; a sphere only nearly.

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
            return _scaled(shape, assets.mesh(shape.file))


def _scaled(shape: Mesh, mesh: Triangles) -> Triangles:
    scales = np.broadcast_to(shape.scale, 3).astype(np.float64)
    positions = mesh.positions * scales
    reach, extent = float(np.abs(positions).max()), float(np.ptp(positions, axis=0).max())
    if not (extent >= SMALLEST_MM and reach <= LARGEST_MM):
        raise InputError(
            f"shape.scale: with this the mesh {shape.file!r} is {extent:g} mm large and reaches "
            f"{reach:g} mm from its origin; {SMALLEST_MM:g} to {LARGEST_MM:g} mm are allowed"
        )
    if (scales == 1).all():
        return mesh
    # A mirror turns the order of corners, which says where outside is.
    faces = mesh.faces if scales.prod() > 0 else mesh.faces[:, ::-1]
    return Triangles.checked(
        positions, faces, None if mesh.normals is None else mesh.normals / scales, mesh.texcoords
    )


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
        fans(quads.reshape(-1, 4)),
        normals.reshape(-1, 3),
        np.stack([along, up], axis=-1).reshape(-1, 2),
    )


def box(width: float, height: float, depth: float) -> Triangles:
    """A box; each side bears the whole picture, upright from in front, behind, left and right.

    On the top the picture's lower border is in front, on the bottom its upper one.
    """
    positions, texcoords, normals = [], [], []
    for outwards, right, up in np.array(_SIDES, dtype=float):
        for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
            positions.append(outwards + (2 * u - 1) * right + (2 * v - 1) * up)
            texcoords.append((u, v))
            normals.append(outwards)
    first = 4 * np.arange(len(_SIDES))[:, None, None]
    faces = (first + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    halves = np.array([width, height, depth]) / 2
    return Triangles.checked(np.array(positions) * halves, faces, np.array(normals), np.array(texcoords))


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
