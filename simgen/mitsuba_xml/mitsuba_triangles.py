"""Shapes of Mitsuba as triangles, with its texture coordinates, and normals as it makes them for meshes.

Mitsuba's texture coordinates run right and down over the picture; those of `Triangles` run right and up.
Mitsuba 3.9, src/shapes and Mesh::recompute_vertex_normals in src/render/mesh.cpp.
"""

from dataclasses import replace

import numpy as np

from simgen.assets.triangles import Triangles, fans

SECTORS = 1024
"""Of a circle: chords stay within 5e-6 of the radius."""
ROWS = 90
"""Of a sphere, which has twice as many columns: its area is 3e-4 less than a true one's."""
# By face of the cube: outwards, and where u and v grow to.
_SIDES = (
    ((0, -1, 0), (0, 0, 1), (1, 0, 0)),
    ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
    ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
    ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 0, -1), (0, -1, 0), (1, 0, 0)),
)


def rectangle() -> Triangles:
    """The square from (-1, -1, 0) to (1, 1, 0), which faces +Z."""
    uv = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    positions = np.column_stack([2 * uv - 1, np.zeros(4)])
    return Triangles.checked(positions, np.array([(0, 1, 2), (0, 2, 3)]), None, _upwards(uv))


def cube() -> Triangles:
    """The cube from (-1, -1, -1) to (1, 1, 1); each side bears the whole picture."""
    uv = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    positions, normals, faces = [], [], []
    for number, (outwards, along_u, along_v) in enumerate(np.array(_SIDES, dtype=float)):
        positions.append(outwards + (2 * uv[:, :1] - 1) * along_u + (2 * uv[:, 1:] - 1) * along_v)
        normals.append(np.tile(outwards, (4, 1)))
        order = (0, 1, 2, 3) if np.cross(along_u, along_v) @ outwards > 0 else (3, 2, 1, 0)
        faces.append(4 * number + fans(np.array([order])))
    texcoords = _upwards(np.tile(uv, (len(_SIDES), 1)))
    return Triangles.checked(
        np.concatenate(positions), np.concatenate(faces), np.concatenate(normals), texcoords
    )


def sphere() -> Triangles:
    """The sphere of radius 1: u goes around +Z from +X, v from +Z down to -Z."""
    u, v = np.meshgrid(np.linspace(0, 1, 2 * ROWS + 1), np.linspace(0, 1, ROWS + 1))
    around, from_top = 2 * np.pi * u, np.pi * v
    normals = np.stack(
        [np.sin(from_top) * np.cos(around), np.sin(from_top) * np.sin(around), np.cos(from_top)], axis=-1
    ).reshape(-1, 3)
    return Triangles.checked(normals, _grid(ROWS, 2 * ROWS), normals, _upwards(_pairs(u, v)))


def disk() -> Triangles:
    """The disk of radius 1 that faces +Z: u is the distance from its middle, v goes around from +X."""
    v = np.linspace(0, 1, SECTORS + 1)
    rim = np.stack([np.cos(2 * np.pi * v), np.sin(2 * np.pi * v), 0 * v], axis=-1)
    # The middle is there once for each sector, whose own direction it has.
    positions = np.concatenate([rim, np.zeros((SECTORS, 3))])
    uv = np.concatenate([_pairs(1 + 0 * v, v), _pairs(np.zeros(SECTORS), (v[1:] + v[:-1]) / 2)])
    first = np.arange(SECTORS)
    faces = np.stack([SECTORS + 1 + first, first, first + 1], axis=-1)
    return Triangles.checked(positions, faces, None, _upwards(uv))


def cylinder() -> Triangles:
    """The open tube of radius 1 about Z from 0 to 1: u goes around from +X, v along Z."""
    v, u = np.meshgrid(np.array([0.0, 1.0]), np.linspace(0, 1, SECTORS + 1))
    around = 2 * np.pi * u
    positions = np.stack([np.cos(around), np.sin(around), v], axis=-1).reshape(-1, 3)
    return Triangles.checked(positions, _grid(SECTORS, 1), positions * [1, 1, 0], _upwards(_pairs(u, v)))


def _pairs(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.stack([u, v], axis=-1).reshape(-1, 2)


def _upwards(uv: np.ndarray) -> np.ndarray:
    """From Mitsuba's texture coordinates (N, 2) to those of `Triangles`, or back."""
    return uv * [1, -1] + [0, 1]


def _grid(rows: int, columns: int) -> np.ndarray:
    """Triangles of a grid of (rows + 1) x (columns + 1) corners, counted row by row."""
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    quads = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1)
    return fans(quads.reshape(-1, 4))


def smoothed(mesh: Triangles) -> Triangles:
    """With normals at vertices: those of their faces, weighted by the angles there."""
    corner = mesh.positions.astype(np.float64)[mesh.faces]
    normals = np.zeros(mesh.positions.shape)
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    for number in range(3):
        one = corner[:, (number + 1) % 3] - corner[:, number]
        other = corner[:, (number + 2) % 3] - corner[:, number]
        angle = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
        np.add.at(normals, mesh.faces[:, number], across * angle[:, None])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    # Vertices without any have the one that Mitsuba gives them.
    normals = np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1), (1.0, 0.0, 0.0))
    return replace(mesh, normals=normals.astype(np.float32))


def turned_over(mesh: Triangles) -> Triangles:
    """With its outside inside."""
    normals = None if mesh.normals is None else -mesh.normals
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), normals=normals)


def flipped_pictures(mesh: Triangles) -> Triangles:
    """With texture coordinates that run the other way from top to bottom."""
    if mesh.texcoords is None:
        return mesh
    return replace(mesh, texcoords=_upwards(mesh.texcoords).astype(np.float32))


def laid_out(mesh: Triangles, to_uv: np.ndarray) -> Triangles:
    """With Mitsuba's texture coordinates moved by a matrix (3, 3).

    A mesh without them gets those that Mitsuba takes then: on each triangle (0, 0), (1, 0) and (0, 1).
    """
    if mesh.texcoords is None:
        corners = mesh.faces.ravel()
        mesh = Triangles(
            mesh.positions[corners],
            np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
            None if mesh.normals is None else mesh.normals[corners],
            _upwards(np.tile([(0, 0), (1, 0), (0, 1)], (len(mesh.faces), 1))).astype(np.float32),
        )
    assert mesh.texcoords is not None
    uv = _upwards(mesh.texcoords.astype(np.float64)) @ to_uv[:2, :2].T + to_uv[:2, 2]
    return replace(mesh, texcoords=_upwards(uv).astype(np.float32))
