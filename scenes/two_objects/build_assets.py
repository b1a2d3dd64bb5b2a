"""Build the assets of the two-object scene: a toy bird (mesh, texture) and a ball (texture).

Everything is procedural and deterministic. Units are millimetres; the model axes are X right,
Y down and Z away from the camera, so the bird looks along -Z. Run the script without arguments;
it writes `bird.ply`, `bird.png` and `ball.png` beside itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

Array = NDArray[np.floating]

ATLAS = 1024  # pixels along one side of the bird's texture
CHART_PAD = 3  # texels kept around a chart, so that filtering never reaches its neighbour
BALL_SIZE = (1536, 768)
BALL_RADIUS = 30.0
SRGB_RANGE = (14.0, 241.0)  # a lit surface is never quite black, and white is left to the light

# Shared by the geometry and by the paint that has to line up with it.
BODY_AXES = np.array([31.5, 31.0, 24.5])
EYE = np.array([10.2, -5.5, -20.2])


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


@dataclass(frozen=True)
class Part:
    """A closed superellipsoid whose local -Z end may be narrowed (`taper`) and bent along Y.

    `aim` is where local -Z points; `n` grid cells along a side give 2 n^2 faces; `cell` is the
    chart in the atlas (left, top, size); `mottle` is the contrast (rms) of the noise on it.
    """

    centre: ArrayLike
    axes: ArrayLike
    paint: Callable[[Array], Array]
    cell: tuple[int, int, int]
    n: int = 16
    power: float = 2.0
    aim: tuple[float, float, float] = (0.0, 0.0, -1.0)
    taper: float = 0.0
    bend: float = 0.0
    pear: float = 0.0
    mottle: float = 0.21

    def surface(self, d: Array) -> Array:
        """Return the model positions of the surface in the local directions `d` (..., 3)."""
        q = d / (np.abs(d) ** self.power).sum(-1, keepdims=True) ** (1 / self.power)
        tip = (1 - q[..., 2]) / 2  # 0 at the root of the part, 1 at its tip
        narrow = 1 - self.taper * tip**1.5
        x, y, z = np.moveaxis(q * np.asarray(self.axes, float), -1, 0)
        x, y = x * narrow * (1 + self.pear * q[..., 1]), y * narrow + self.bend * tip**2
        back = -unit(np.array(self.aim))
        near_y = np.array([0.0, 1.0, 0.0] if abs(back[1]) < 0.7 else [0.0, 0.0, -1.0])
        right = unit(np.cross(near_y, back))
        frame = np.stack([right, np.cross(back, right), back])
        return np.asarray(self.centre, float) + np.stack([x, y, z], -1) @ frame

    def normals(self, d: Array) -> Array:
        """Return outward unit normals by differences; unlike face averages they have no seam."""
        ref = np.where(np.abs(d[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        t1 = 0.01 * unit(np.cross(d, ref))
        t2 = np.cross(d, t1)
        du, dv = (self.surface(unit(d + t)) - self.surface(unit(d - t)) for t in (t1, t2))
        return unit(np.cross(du, dv))


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


def plumage(p: Array) -> Array:
    """Return the shade (-1 to 1) of overlapping feathers on the body.

    They lie in rows like shingles, from the crown downwards; each row has a whole number of
    them, so that the rows close behind the bird.
    """
    q = unit(p / BODY_AXES)
    pitch = 5.2 / BODY_AXES[1]
    row = np.arccos(np.clip(-q[..., 1], -1, 1)) / pitch
    turn = np.arctan2(q[..., 0], -q[..., 2]) / (2 * np.pi)
    shade = np.zeros(row.shape)
    for below in (1, 0, -1):  # a row lies on the one below it, so it is painted later
        k = np.floor(row) + below
        count = np.maximum(np.rint(30 * np.sin(k * pitch)), 3)
        across = 2 * ((turn * count + 0.5 * (k % 2)) % 1) - 1
        inside = k + 1.75 - 0.75 * across**2 - row  # height above the feather's lower edge
        rim = 0.55 * smoothstep(0.1, 0.5, inside) - smoothstep(0.25, 0.0, inside)
        shade = np.where(inside > 0, rim - 0.5 * smoothstep(0.7, 1.7, inside), shade)
    return shade


def bird_parts(noise: SolidNoise) -> list[Part]:
    """Return the parts of the bird; they overlap instead of being joined."""
    crimson, maroon, cream = linear(204, 30, 40), linear(112, 22, 34), linear(232, 208, 168)
    orange, amber, dark = linear(238, 140, 26), linear(232, 172, 48), linear(50, 36, 38)
    white, black = linear(226, 222, 212), linear(27, 26, 29)

    def paint_body(p: Array) -> Array:
        ragged = 1.1 * noise(p * [1.0, 0.6, 1.0] + 17)
        x, y, z = np.moveaxis(p, -1, 0)
        belly = np.hypot(x / 21, (y - 22) / 17) * 18 - 18 + ragged
        belly = smoothstep(1.0, -1.0, belly) * smoothstep(9.0, 7.0, z + 2 * ragged)
        mask = np.hypot((np.abs(x) - EYE[0]) / 11, (y - EYE[1]) / 11.5) * 11 - 11 + 0.6 * ragged
        mask = smoothstep(1.0, -1.5, mask) * (z < 0)
        rgb = mix(mix(crimson, maroon, 0.75 * mask), cream, belly)
        return rgb * np.exp(0.2 * plumage(p))[..., None]

    def paint_eye(p: Array) -> Array:
        r = np.hypot(np.abs(p[..., 0]) - EYE[0] + 1.7, p[..., 1] - EYE[1] - 1.2)
        return mix(mix(black, amber, smoothstep(2.8, 3.2, r)), white, smoothstep(3.7, 4.1, r))

    def paint_beak(p: Array) -> Array:
        x, y, z = np.moveaxis(p, -1, 0)
        nostril = np.hypot((np.abs(x) - 2.9) / 1.2, (y - 3.0) / 0.7)
        rgb = mix(orange, amber, smoothstep(-24.0, -35.0, z))
        return mix(dark, rgb, smoothstep(0.7, 1.3, nostril))

    def paint_tuft(p: Array) -> Array:
        crown = p[..., 1] - 0.4 * np.abs(p[..., 0]) + 0.8 * noise(p + 5)
        return mix(amber, crimson, smoothstep(-41.0, -37.5, crown))

    def paint_wing(p: Array) -> Array:
        bars = np.sin(p[..., 1] * 2 * np.pi / 7 + 0.5 * noise(p + 9))
        return mix(maroon, crimson, 0.55 * smoothstep(-0.3, 0.3, bars))

    def flat(*srgb: float) -> Callable[[Array], Array]:
        return lambda p: np.broadcast_to(linear(*srgb), p.shape)

    parts = [
        Part((0, 0, 0), BODY_AXES, paint_body, (0, 0, 768), n=52, power=2.3, pear=0.07),
        Part((0, 3, -21), (12, 7.5, 14.5), paint_beak, (768, 0, 256), n=24, power=1.6,
             taper=0.6, bend=6.5),
        Part((0, 9.5, -19.5), (8.5, 5.5, 11), flat(206, 100, 22), (768, 256, 256), n=20,
             power=1.8, taper=0.45),
        Part((0, -34, 0), (3.4, 2.6, 11), paint_tuft, (512, 768, 128), aim=(0.05, -1, -0.1),
             taper=0.3),
        Part((0, 8, 22), (6.5, 4, 13), flat(112, 22, 34), (640, 768, 128), aim=(0, -0.5, 1)),
    ]  # fmt: skip
    for k, side in enumerate((-1, 1)):
        parts += [
            Part(EYE * [side, 1, 1], (7.4, 8.0, 5.5), paint_eye, (128 * k, 896, 128), n=20,
                 aim=(side * 0.25, -0.08, -1), mottle=0.07),
            Part((side * 10.8, -13.4, -21), (5, 3.7, 11), flat(50, 36, 38),
                 (256 + 128 * k, 896, 128), n=20, power=2.5, aim=(side, -0.5, 0.25), taper=0.35),
            Part((side * 31, 6, -1), (4.2, 10, 14), paint_wing, (768, 512 + 256 * k, 256), n=18,
                 aim=(side * 0.28, 1, -0.15), taper=0.35),
            Part((side * 5.2, -31.5, 1), (3, 2.4, 9), paint_tuft, (128 * k, 768, 128),
                 aim=(side * 0.55, -1, 0), taper=0.3),
            Part((side * 9, 30.5, -9), (5.5, 3.2, 7.5), flat(238, 140, 26),
                 (256 + 128 * k, 768, 128), aim=(side * 0.2, 0.1, -1)),
        ]  # fmt: skip
    return parts


def bird_texture(parts: list[Part], noise: SolidNoise) -> NDArray[np.uint8]:
    """Paint every part's chart of the atlas from the 3-D positions of its texels."""
    atlas = np.full((ATLAS, ATLAS, 3), 64, np.uint8)
    for part in parts:
        left, top, size = part.cell
        t = np.clip((np.arange(size) + 0.5 - size / 2) / (size / 2 - CHART_PAD), -1, 1)
        p = part.surface(octahedral(*np.meshgrid(t, t)))
        # Half of the mottling is drawn out along Y, the way feathers and brush strokes lie.
        grain = (noise(p) + noise(p * [1.0, 0.45, 1.0] + 31)) / np.sqrt(2)
        rgb = part.paint(p) * np.exp(part.mottle * np.clip(grain, -2.8, 2.8))[..., None]
        atlas[top : top + size, left : left + size] = to_srgb8(rgb)
    return atlas


def ball_texture(noise: SolidNoise) -> NDArray[np.uint8]:
    """Paint the tricoloured ball for a sphere: u is the azimuth about +Z, v the polar angle.

    The scene turns the sphere such that the pole of the texture is in front. The three gores meet at
    both ends of an axis close to Z, so that the ball shows all of them from the front (-Z) and from
    the back as well.
    """
    width, height = BALL_SIZE
    phi = (np.arange(width) + 0.5) * 2 * np.pi / width
    phi, theta = np.meshgrid(phi, (np.arange(height) + 0.5) * np.pi / height)
    ring = np.sin(theta)
    p = BALL_RADIUS * np.stack([ring * np.cos(phi), ring * np.sin(phi), np.cos(theta)], -1)

    axis = unit(np.array([-0.17, 0.13, 1.0]))
    east = unit(np.cross([0.0, 1.0, 0.0], axis))
    x, y = p @ east, p @ np.cross(axis, east)
    turn = (np.arctan2(y, x) / (2 * np.pi) + 0.25) * 3
    gores = np.stack([linear(206, 36, 40), linear(30, 150, 62), linear(36, 70, 196)])
    rgb = gores[np.floor(turn).astype(int) % 3]
    beside_seam = np.hypot(x, y) * np.abs(np.sin((turn - np.rint(turn)) * 2 * np.pi / 3))
    rgb = mix(linear(228, 220, 200), rgb, smoothstep(0.55, 0.85, beside_seam))

    # A woven print: a wavy lattice in space, which meets the sphere the same way everywhere.
    a, b, c = np.moveaxis(p * 2 * np.pi / 3.1 + 0.9 * noise(0.4 * p + 7)[..., None], -1, 0)
    weave = np.sin(a) * np.cos(b) + np.sin(b) * np.cos(c) + np.sin(c) * np.cos(a)
    grain = 0.14 * np.clip(noise(p * 1.1), -2.8, 2.8) + 0.08 * weave
    return to_srgb8(rgb * np.exp(grain)[..., None])


def main() -> None:
    """Write the three files and say what they hold."""
    here = Path(__file__).resolve().parent
    noise = SolidNoise(seed=20)
    parts = bird_parts(noise)
    meshes = [tessellate(part) for part in parts]
    starts = np.cumsum([0] + [len(v) for v, _ in meshes[:-1]], dtype=np.int32)
    vertices = np.vstack([v for v, _ in meshes])
    faces = np.vstack([f + start for (_, f), start in zip(meshes, starts, strict=True)])
    check_mesh(vertices, faces)
    write_ply(here / "bird.ply", vertices, faces)
    Image.fromarray(bird_texture(parts, noise)).save(here / "bird.png")
    Image.fromarray(ball_texture(noise)).save(here / "ball.png")
    low, high = vertices[:, :3].min(0), vertices[:, :3].max(0)
    print(f"bird: {len(vertices)} vertices, {len(faces)} faces, from {low} to {high} mm")


if __name__ == "__main__":
    main()
