"""Build the assets of the two-object scene: a bird (mesh, texture) and a ball (texture).

The bird is a European robin of our own design. Everything is procedural and deterministic. Units are
millimetres; the model axes are X right, Y down and Z away from the camera, so the bird looks along -Z
until the scene turns it. Run the script without arguments; it writes `bird.ply`, `bird.png` and
`ball.png` beside itself.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from parts import (
    ATLAS,
    CHART_PAD,
    Array,
    Part,
    SolidNoise,
    Superellipsoid,
    Union,
    check_mesh,
    frame,
    linear,
    mix,
    octahedral,
    smoothstep,
    tessellate,
    to_srgb8,
    unit,
    write_ply,
)
from PIL import Image

BALL_SIZE = (1536, 768)
BALL_RADIUS = 30.0

TRUNK = (  # breast and belly, head, rump
    ((0.0, 8.0, 0.0), (28.8, 28.0, 25.0)),
    ((0.0, -18.0, -5.0), (20.8, 19.0, 19.0)),
    ((4.0, 17.0, 14.0), (15.0, 12.0, 13.0)),
)
# Shared by the geometry and by the paint that has to line up with it.
EYE = np.array([13.8, -20.5, -17.7])
WING_AIM = np.array([0.12, 0.68, 0.72])
TAIL_AIM = np.array([0.62, 0.62, 0.42])  # flicked aside, so that it is seen beside the body


def shingles(row: Array, across: Callable[[Array], Array]) -> Array:
    """Return the shade (-1 to 1) of feathers that overlap like shingles, row below row.

    `row` counts rows and grows towards the tips; `across` tells a row's number where between two
    neighbours each point is, 0 to 1.
    """
    shade = np.zeros(row.shape)
    for below in (1, 0, -1):  # a row lies on the one below it, so it is painted later
        k = np.floor(row) + below
        middle = 2 * (across(k) % 1) - 1
        inside = k + 1.75 - 0.75 * middle**2 - row  # height above the feather's lower edge
        rim = 0.55 * smoothstep(0.1, 0.5, inside) - smoothstep(0.25, 0.0, inside)
        shade = np.where(inside > 0, rim - 0.5 * smoothstep(0.7, 1.7, inside), shade)
    return shade


def plumage(p: Array) -> Array:
    """Return the shade of the small feathers of head and body, whose rows run down from the crown.

    Each row has a whole number of feathers, so that the rows close behind the bird.
    """
    q = unit(p / [28.0, 36.0, 26.0])  # about as far from the origin everywhere
    pitch = 0.11  # of the rows, as an angle: some 3 mm
    turn = np.arctan2(q[..., 0], -q[..., 2]) / (2 * np.pi)

    def across(k: Array) -> Array:
        return turn * np.maximum(np.rint(50 * np.sin(k * pitch)), 3) + 0.5 * (k % 2)

    return shingles(np.arccos(np.clip(-q[..., 1], -1, 1)) / pitch, across)


def bird_parts(noise: SolidNoise) -> list[Part]:
    """Return the parts of the bird, a European robin; they overlap instead of being joined."""
    olive, brown, slate = linear(150, 128, 84), linear(122, 98, 68), linear(128, 135, 140)
    rust, buff, pale = linear(194, 78, 26), linear(178, 146, 102), linear(198, 190, 173)
    white, black = linear(240, 240, 240), linear(24, 22, 22)
    horn, skin = linear(62, 50, 44), linear(158, 112, 88)

    def paint_trunk(p: Array) -> Array:
        ragged = noise(p * [1.0, 0.5, 1.0] + 17)
        x, y, z = np.moveaxis(p, -1, 0)
        turn = np.arctan2(np.abs(x), -z)  # from straight ahead
        under = y + 9 * np.cos(turn) + 1.5 * ragged
        rgb = mix(np.broadcast_to(olive, p.shape), buff, smoothstep(9.0, 16.0, under))
        rgb = mix(rgb, pale, smoothstep(17.0, 25.0, under))
        # Face and breast: about how many mm inside the border of a superellipse over turn and height.
        bib = 21 * (1 - ((turn / 1.14) ** 2.3 + np.abs((y + 8.5) / 22) ** 2.3) ** (1 / 2.3)) + ragged
        beside = smoothstep(0.6, 0.9, turn) * smoothstep(-34.0, -26.0, y) * smoothstep(12.0, 4.0, y)
        rgb = mix(rgb, slate, smoothstep(-6.5, -4.0, bib) * beside)
        rgb = mix(rgb, rust, smoothstep(-1.0, 1.2, bib))
        ruffled = p + 0.5 * np.stack([noise(p * 0.7 + shift) for shift in (3, 11, 23)], axis=-1)
        down = np.clip(noise(p * [1.6, 0.4, 1.6] + 41), -2.8, 2.8)
        return rgb * np.exp(0.45 * plumage(ruffled) + 0.3 * down)[..., None]

    def paint_wing(p: Array) -> Array:
        _, over, back = np.moveaxis(p @ frame(WING_AIM).T, -1, 0)
        coverts = shingles(-back / 4.5, lambda k: over / 4.5 + 0.5 * (k % 2))
        quills = shingles(over / 3.2, lambda _: (40 - back) / 80)
        tip = smoothstep(-12.0, -14.0, back)
        return mix(olive, brown, tip) * np.exp(0.5 * (coverts + (quills - coverts) * tip))[..., None]

    def paint_tail(p: Array) -> Array:
        _, over, back = np.moveaxis(p @ frame(TAIL_AIM).T, -1, 0)
        vanes = shingles(over / 2.4, lambda _: (40 - back) / 120)
        return mix(olive, brown, smoothstep(-30.0, -40.0, back)) * np.exp(0.3 * vanes)[..., None]

    def paint_eye(p: Array) -> Array:
        x, y, z = np.moveaxis(p, -1, 0)
        glint = np.hypot(x - np.sign(x) * EYE[0] + 1.0, y - EYE[1] + 1.3)
        return mix(black, white, smoothstep(1.0, 0.6, glint) * (z < EYE[2]))

    def paint_beak(p: Array) -> Array:
        return np.broadcast_to(horn, p.shape)

    def paint_leg(p: Array) -> Array:
        return np.broadcast_to(skin, p.shape)

    parts: list[Part] = [
        Union(ellipsoids=TRUNK, blend=5.0, paint=paint_trunk, cell=(0, 0, 768), n=68, mottle=0.26),
        Superellipsoid(centre=(0, -17, -26), axes=(2.4, 2.2, 8.5), aim=(0, 0.08, -1), taper=0.6,
                       paint=paint_beak, cell=(0, 768, 128)),
        Superellipsoid(centre=(19, 27.5, 13), axes=(2.2, 5, 16.5), aim=TAIL_AIM, taper=-0.2, power=3.2,
                       paint=paint_tail, cell=(768, 512, 256)),
    ]  # fmt: skip
    for k, side in enumerate((-1, 1)):
        parts += [
            Superellipsoid(centre=EYE * [side, 1, 1], axes=(3.5, 3.5, 3.5),
                           paint=paint_eye, cell=(128 + 128 * k, 768, 128), mottle=0.07),
            Superellipsoid(centre=(side * 24.2, 13.5, 9.5), axes=(4.5, 12.5, 24), taper=0.75,
                           aim=WING_AIM * [-side, 1, 1], paint=paint_wing, cell=(768, 256 * k, 256), n=20),
            Superellipsoid(centre=(side * 7, 35, 2), axes=(1.4, 6, 1.4),
                           paint=paint_leg, cell=(384 + 64 * k, 768, 64), n=10),
        ]  # fmt: skip
        for toe, turn in enumerate((-0.5, 0.0, 0.5)):
            ahead = np.array([np.sin(turn), 0.0, -np.cos(turn)])
            parts.append(
                Superellipsoid(centre=[side * 7, 40.3, 2] + 3.5 * ahead, axes=(1.2, 1.2, 4.8), taper=0.4,
                               aim=(ahead[0], 0.1, ahead[2]), paint=paint_leg,
                               cell=(384 + 64 * toe, 832 + 64 * k, 64), n=8)
            )  # fmt: skip
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
