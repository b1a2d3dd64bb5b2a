"""What the two-object scene is made with: noise, colours, and closed surfaces with a chart each.

Units are millimetres; axes are X right, Y down and Z away from the camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating]
Ellipsoid = tuple[tuple[float, float, float], tuple[float, float, float]]  # centre, semi-axes

ATLAS = 1024  # pixels along one side of the bird's texture
CHART_PAD = 3  # texels kept around a chart, so that filtering never reaches its neighbour
SRGB_RANGE = (14.0, 241.0)  # a lit surface is never quite black, and white is left to the light


class SolidNoise:
    """Periodic 1/f noise in space, unit variance, with wavelengths from 1 to 10 mm.

    Texels look their value up by 3-D position, which is what makes the textures free of seams
    and of pinching at the poles of a parametrisation.
    """

    def __init__(self, seed: int, cells: int = 160, period: float = 48.0) -> None:
        white = np.random.default_rng(seed).standard_normal((cells,) * 3, dtype=np.float32)
        f = np.fft.fftfreq(cells, period / cells)
        freq = np.sqrt(f[:, None, None] ** 2 + f[:, None] ** 2 + f[: cells // 2 + 1] ** 2)
        # A surface cuts a slice: amplitude f^-1.5 in space is f^-1 on the slice.
        gain = np.where((freq > 0.1) & (freq < 1.0), np.maximum(freq, 0.1) ** -1.5, 0.0)
        grid = np.fft.irfftn(np.fft.rfftn(white) * gain, s=white.shape, axes=(0, 1, 2))
        self._grid = (grid / grid.std()).ravel()
        self._cells, self._step = cells, period / cells

    def __call__(self, p: Array) -> Array:
        """Return the noise at the points `p` (..., 3), by trilinear interpolation."""
        n = self._cells
        base = np.floor(p / self._step)
        frac = p / self._step - base
        low = base.astype(np.int64) % n
        index, weight = (low, (low + 1) % n), (1 - frac, frac)
        out = np.zeros(p.shape[:-1])
        for corner in np.ndindex(2, 2, 2):
            i, j, k = (index[c][..., a] for a, c in enumerate(corner))
            wi, wj, wk = (weight[c][..., a] for a, c in enumerate(corner))
            out += wi * wj * wk * self._grid[(i * n + j) * n + k]
        return out


def unit(v: Array) -> Array:
    """Return `v` scaled to unit length along its last axis."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def smoothstep(low: float, high: float, x: Array) -> Array:
    """Return a soft step from 0 at `low` to 1 at `high` (which may be the smaller of the two)."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def mix(a: Array, b: Array, t: Array) -> Array:
    """Blend the colours `a` and `b` with the mask `t` (0 gives `a`)."""
    return a + (b - a) * t[..., None]


def linear(*srgb: float) -> Array:
    """Return the linear reflectance of an 8-bit sRGB colour."""
    c = np.array(srgb) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def to_srgb8(rgb: Array) -> NDArray[np.uint8]:
    """Encode linear reflectance (not negative) as 8-bit sRGB, kept inside `SRGB_RANGE`."""
    code = 255 * np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * rgb ** (1 / 2.4) - 0.055)
    return np.rint(np.clip(code, *SRGB_RANGE)).astype(np.uint8)


def octahedral(a: Array, b: Array) -> Array:
    """Map the square [-1, 1]^2 to directions; the centre is -Z, the whole border the back.

    One square covers a closed surface, its only cut is behind the part, and no cell of a grid
    on it collapses as the cells at a pole would.
    """
    z = np.abs(a) + np.abs(b) - 1
    x = np.where(z > 0, (1 - np.abs(b)) * np.where(a < 0, -1, 1), a)
    y = np.where(z > 0, (1 - np.abs(a)) * np.where(b < 0, -1, 1), b)
    return unit(np.stack([x, y, z], axis=-1))


def frame(aim: ArrayLike) -> Array:
    """Return the local axes (3, 3), by row, of what has its local -Z end point along `aim`."""
    back = -unit(np.asarray(aim, float))
    near_y = np.array([0.0, 1.0, 0.0] if abs(back[1]) < 0.7 else [0.0, 0.0, -1.0])
    right = unit(np.cross(near_y, back))
    return np.stack([right, np.cross(back, right), back])


@dataclass(frozen=True, kw_only=True)
class Part:
    """A closed surface around a point from which all of it is seen, and how it is painted.

    `n` grid cells along a side give 2 n^2 faces; `cell` is the chart in the atlas (left, top, size);
    `mottle` is the contrast (rms) of the noise on it.
    """

    paint: Callable[[Array], Array]
    cell: tuple[int, int, int]
    n: int = 16
    mottle: float = 0.21

    def surface(self, d: Array) -> Array:
        """Return the model positions of the surface in the local directions `d` (..., 3)."""
        raise NotImplementedError

    def normals(self, d: Array) -> Array:
        """Return outward unit normals by differences; unlike face averages they have no seam."""
        ref = np.where(np.abs(d[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        t1 = 0.01 * unit(np.cross(d, ref))
        t2 = np.cross(d, t1)
        du, dv = (self.surface(unit(d + t)) - self.surface(unit(d - t)) for t in (t1, t2))
        return unit(np.cross(du, dv))


@dataclass(frozen=True, kw_only=True)
class Superellipsoid(Part):
    """A superellipsoid whose local -Z end points along `aim` and is narrower by the share `taper`."""

    centre: ArrayLike
    axes: ArrayLike
    aim: ArrayLike = (0.0, 0.0, -1.0)
    power: float = 2.0
    taper: float = 0.0

    def surface(self, d: Array) -> Array:
        """Return the model positions of the surface in the local directions `d` (..., 3)."""
        q = d / (np.abs(d) ** self.power).sum(-1, keepdims=True) ** (1 / self.power)
        tip = (1 - q[..., 2:]) / 2  # 0 at the root of the part, 1 at its tip
        narrow = 1 - self.taper * tip**1.5
        local = q * np.asarray(self.axes, float)
        local = np.concatenate([local[..., :2] * narrow, local[..., 2:]], axis=-1)
        return np.asarray(self.centre, float) + local @ frame(self.aim)


@dataclass(frozen=True, kw_only=True)
class Union(Part):
    """Ellipsoids that flow into one another; the origin must be inside, and see all of it.

    The surface is where the sum of exp(-blend (r - 1)) is 1, r the distance from an ellipsoid's centre
    as a share of its radius in that direction.
    """

    ellipsoids: tuple[Ellipsoid, ...]
    blend: float

    def surface(self, d: Array) -> Array:
        """Return where the rays from the origin in the directions `d` (..., 3) leave the union."""
        inside, outside = np.zeros(d.shape[:-1]), np.full(d.shape[:-1], 64.0)
        for _ in range(30):  # bisection to less than 1e-7 mm
            middle = (inside + outside) / 2
            p = d * middle[..., None]
            total = np.zeros(d.shape[:-1])
            for centre, axes in self.ellipsoids:
                total += np.exp(self.blend * (1 - np.linalg.norm((p - centre) / np.array(axes), axis=-1)))
            inside, outside = np.where(total > 1, middle, inside), np.where(total > 1, outside, middle)
        return d * inside[..., None]


def tessellate(part: Part) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the vertices (x, y, z, nx, ny, nz, s, t) and the faces of one part."""
    n, (left, top, size) = part.n, part.cell
    a, b = (g.ravel() for g in np.meshgrid(*[np.linspace(-1, 1, n + 1)] * 2))
    d = octahedral(a, b)
    st = (np.stack([a, b], -1) * (size / 2 - CHART_PAD) + size / 2 + [left, top]) / ATLAS
    st[:, 1] = 1 - st[:, 1]  # t runs up the picture
    vertices = np.hstack([part.surface(d), part.normals(d), st]).astype(np.float32)

    i, j = (g.ravel() for g in np.meshgrid(np.arange(n), np.arange(n)))
    v00 = j * (n + 1) + i
    v10, v01, v11 = v00 + 1, v00 + n + 1, v00 + n + 2
    # Diagonals run along the folds |a| + |b| = 1 of the mapping, never across them.
    anti = ((2 * i + 1 - n) * (2 * j + 1 - n) > 0)[:, None]
    first = np.where(anti, np.stack([v00, v01, v10], -1), np.stack([v00, v01, v11], -1))
    second = np.where(anti, np.stack([v10, v01, v11], -1), np.stack([v00, v11, v10], -1))
    return vertices, np.vstack([first, second]).astype(np.int32)


def check_mesh(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    """Raise if the mesh has bad numbers, slivers or faces turned inwards."""
    p, normals = vertices[faces, :3].astype(float), vertices[faces, 3:6]
    cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    if not np.isfinite(vertices).all() or np.linalg.norm(cross, axis=-1).min() < 1e-3:
        raise ValueError("mesh has non-finite vertices or degenerate faces")
    if (cross[:, None] * normals).sum(-1).min() <= 0:
        raise ValueError("mesh has faces that disagree with their normals")


def write_ply(path: Path, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    """Write a binary little-endian PLY with normals and the texture coordinates s, t."""
    names = "".join(f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz", "s", "t"))
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{names}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, faces
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())
