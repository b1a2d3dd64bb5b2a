"""Triangles with what a renderer needs of them: checked arrays, whoever made them."""

from dataclasses import dataclass
from typing import Self

import numpy as np

MOST_VERTICES = 1 << 22
MOST_FACES = 1 << 22
LARGEST_COORDINATE = 1e9
LARGEST_POLYGON = 1024


@dataclass(frozen=True)
class Triangles:
    """A triangle mesh; a corner's texture coordinates (u, v) run right and up over the picture.

    `positions` (N, 3) float32, `faces` (M, 3) int32, `normals` (N, 3) float32 of length 1 or None for
    flat faces, `texcoords` (N, 2) float32 or None. Raises `ValueError` for what cannot be rendered.
    """

    positions: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    texcoords: np.ndarray | None = None

    def __post_init__(self) -> None:
        count = len(self.positions)
        _check("positions", self.positions, (count, 3), np.float32)
        _check("faces", self.faces, (len(self.faces), 3), np.int32)
        if self.normals is not None:
            _check("normals", self.normals, (count, 3), np.float32)
        if self.texcoords is not None:
            _check("texture coordinates", self.texcoords, (count, 2), np.float32)
        if not len(self.faces):
            raise ValueError("has no faces")
        _check_indices(self.faces, count)

    @classmethod
    def checked(
        cls,
        positions: np.ndarray,
        faces: np.ndarray,
        normals: np.ndarray | None,
        texcoords: np.ndarray | None,
    ) -> Self:
        """Triangles from a file's numbers, any dtype; vertices that no face uses are left out."""
        if not len(faces):
            raise ValueError("has no faces")
        check_counts(len(positions), len(faces))
        _check_indices(faces, len(positions))
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


def check_counts(vertices: int, faces: int) -> None:
    """`ValueError` for a mesh that is larger than may be."""
    if vertices > MOST_VERTICES:
        raise ValueError(f"has {vertices} vertices; at most {MOST_VERTICES} are allowed")
    if faces > MOST_FACES:
        raise ValueError(f"has {faces} faces; at most {MOST_FACES} are allowed")


def fans(polygons: np.ndarray) -> np.ndarray:
    """(M, n) corners of convex polygons as (M (n - 2), 3) triangles about their first corners."""
    n = polygons.shape[1]
    middle = np.arange(1, n - 1)
    first = np.broadcast_to(polygons[:, :1], (len(polygons), n - 2))
    return np.stack([first, polygons[:, middle], polygons[:, middle + 1]], axis=-1).reshape(-1, 3)


def fan_all(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Triangles of polygons in their order: `corners` one after another, `counts` of them each."""
    if len(counts) and (counts.min() < 3 or counts.max() > LARGEST_POLYGON):
        odd = counts[(counts < 3) | (counts > LARGEST_POLYGON)][0]
        raise ValueError(f"has a face of {odd} corners; 3 to {LARGEST_POLYGON} are allowed")
    starts = np.cumsum(counts) - counts
    parts, order = [np.empty((0, 3), corners.dtype)], [np.empty(0, np.int64)]
    for n in np.unique(counts):
        rows = np.flatnonzero(counts == n)
        parts.append(fans(corners[starts[rows][:, None] + np.arange(n)]))
        order.append(np.repeat(rows, n - 2))
    return np.concatenate(parts)[np.argsort(np.concatenate(order), kind="stable")]


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


def _check(what: str, array: np.ndarray, shape: tuple[int, ...], dtype: type) -> None:
    if array.shape != shape or array.dtype != dtype:
        raise ValueError(f"{what}: expected {shape} {dtype.__name__}, got {array.shape} {array.dtype}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what}: must be finite")


def _check_indices(faces: np.ndarray, count: int) -> None:
    low, high = faces.min(), faces.max()
    if low < 0 or high >= count:
        odd = int(low if low < 0 else high)
        raise ValueError(f"has a face with vertex {odd}, but only vertices 0 to {count - 1} exist")


def _numbers(what: str, array: np.ndarray) -> np.ndarray:
    sound = np.abs(array) <= LARGEST_COORDINATE  # false for NaN
    if not sound.all():
        odd = float(array[~sound][0])
        raise ValueError(f"has a {what} of {odd:g}; numbers up to {LARGEST_COORDINATE:g} are allowed")
    return array.astype(np.float64)


def _unit(normals: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not lengths.all():
        raise ValueError("has a normal of length 0")
    return (normals / lengths).astype(np.float32)
