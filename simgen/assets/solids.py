"""Boxes and cylinders as triangles about their middle, each face with its own part of the picture.

Axes as in the world: X right, Y down, Z forward; unrotated, -Z faces the cameras and -Y is up.
Texture coordinates run right (u) and up (v).
"""

import numpy as np

from simgen.assets.triangles import Triangles

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
