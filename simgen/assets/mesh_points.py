"""Points that are spread over a mesh, and whether each part of a picture lies on it once."""

import math
from typing import NamedTuple

import numpy as np

from simgen.assets.triangles import Triangles, barycentric

PAIRS_AT_ONCE = 1 << 22
INSIDE = 1e-4
"""Of a triangle's height: points nearer to its sides than this may be a neighbour's."""
SAME_PLACE = 1e-3
"""Of the size of a mesh: places nearer to each other than this are one."""
LOOKED_AT = 1024
"""Points, such that pictures of which a hundredth is there twice are found."""


class SurfacePoints(NamedTuple):
    """Middles of parts of a surface."""

    position: np.ndarray
    """(N, 3)."""
    normal: np.ndarray
    """(N, 3), of length 1, outwards."""
    area: np.ndarray
    """(N,), of the parts."""
    texcoord: np.ndarray | None
    """(N, 2)."""


def surface_points(mesh: Triangles, number: int) -> SurfacePoints:
    """Middles of the n x n like parts of each triangle, such that there are some `number` of them in all."""
    n = max(1, math.isqrt(number // len(mesh.faces)))
    side = np.add.outer(np.arange(n), np.arange(n))
    upright, turned = np.argwhere(side < n) + 1 / 3, np.argwhere(side < n - 1) + 2 / 3
    second, third = np.concatenate([upright, turned]).T / n
    shares = np.stack([1 - second - third, second, third], axis=-1)

    def of_points(values: np.ndarray) -> np.ndarray:
        mixed = np.einsum("pc,mcd->mpd", shares, values.astype(np.float64)[mesh.faces])
        return mixed.reshape(-1, values.shape[1])

    corner = mesh.positions.astype(np.float64)[mesh.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    normal = across / np.where(doubled > 0, doubled, 1)[:, None]
    return SurfacePoints(
        of_points(mesh.positions),
        np.repeat(normal, n * n, axis=0),
        np.repeat(doubled / (2 * n * n), n * n),
        None if mesh.texcoords is None else of_points(mesh.texcoords),
    )


def bears_pictures_once(mesh: Triangles) -> bool:
    """Whether texture coordinates are from 0 to 1 and no two places have the same; found by trying points."""
    if mesh.texcoords is None or mesh.texcoords.min() < 0 or mesh.texcoords.max() > 1:
        return False
    points = surface_points(mesh, LOOKED_AT)
    assert points.texcoord is not None
    step = max(1, len(points.texcoord) // LOOKED_AT)
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
        found = np.einsum("nc,ncd->nd", shares[inside], of[triangle[inside]])
        if (np.linalg.norm(found - place[point[inside]], axis=1) > reach).any():
            return False
    return True
