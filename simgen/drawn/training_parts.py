"""Parts of scenes that networks are trained on: shapes, materials, walls; and curved shapes as meshes,
made of random numbers: bumpy blobs and heads, cones and vases, rings and knots.

A curved surface is a grid of points (rows, columns, 3) in units of about its own radius. It is written as a
PLY file of quads with texture coordinates, named after its content. Axes are the world's: Y down, Z forward.
"""

import hashlib
import math
from pathlib import Path
from random import Random

import numpy as np

from pcii.base import write_bytes_safely
from simgen.base import cache_folder
from simgen.drawn import kinds as draw
from simgen.drawn.kinds import UPRIGHT, Material, Objects, Table, Triple

HALF_FIELD = 0.36
"""Half of what a camera sees, by its depth."""
ROWS, COLUMNS = 64, 128
HEADER = """ply
format binary_little_endian 1.0
element vertex {vertices}
property float x
property float y
property float z
property float s
property float t
element face {faces}
property list uchar int vertex_indices
end_header
"""


def any_shape(random: Random, size_mm: float, kind: str | None = None) -> tuple[Table, float, float]:
    """A shape about as large as a ball of this radius, how far its middle is behind what is seen of it, and
    half of its height."""
    r, stretch = size_mm, math.exp(random.gauss(0, 0.35))
    match kind or random.choice(["ball", "ball", "box", "box", "tin", "tin", "card"]):
        case "ball":
            return draw.sphere(r), 0.7 * r, r
        case "box":
            depth = 2 * r * draw.log_uniform(random, 0.2, 1)
            return draw.box_of(1.8 * r * stretch, 1.8 * r / stretch, depth), depth / 2, 0.9 * r / stretch
        case "tin":
            return draw.cylinder_of(0.8 * r / stretch, 2 * r * stretch), 0.65 * r / stretch, r * stretch
        case "rod":  # a tin of which a scene can have many
            radius = 0.8 * r / stretch
            return mesh_of(rod(), radius, r * stretch, radius), 0.8 * radius, r * stretch
        case _:
            return draw.card(2 * r * stretch, 2 * r / stretch), 0.0, r / stretch


def any_turn(random: Random) -> Triple:
    """A turn that still shows the front."""
    return random.uniform(-25, 25), random.uniform(-40, 40), random.uniform(-40, 40)


def any_material(random: Random, pixels: int = 512) -> Table:
    """Noise, one colour, stripes, checks, a star, text or metal."""
    two = [draw.colour(random, 0.1, 0.5), draw.colour(random, 0.4, 0.9)]
    if random.random() < 0.25:
        return {"reflectance": draw.colour(random, 0.1, 0.9)}
    if random.random() < 0.08:
        return draw.metal(random.choice(["Ag", "Au", "Cu"]), draw.log_uniform(random, 0.08, 0.5))
    # All are drawn, and one of them is taken.
    noise = {
        "type": "noise",
        "exponent": round(random.uniform(0.7, 1.5), 2),
        "contrast": round(random.uniform(0.1, 0.35), 2),
        "colour": draw.colour(random, 0.3, 0.65),
        "chroma": round(random.uniform(0, 0.5), 2),
        "seed": random.randrange(100_000),
    }
    stripes = {
        "type": "stripes",
        "periods": random.randint(3, 30),
        "angle_deg": round(random.uniform(-90, 90), 1),
        "profile": random.choice(["square", "sine"]),
        "colours": two,
    }
    checks = {"type": "checks", "rows": random.randint(2, 12), "columns": random.randint(2, 12)}
    star = {"type": "star", "spokes": random.randint(4, 40), "colours": two}
    text = {"type": "text", "text": random.choice(["photon", "a b c d e f", "Depth 42"]), "colours": two}
    texture = random.choice([noise, stripes, checks | {"colours": two}, star, text])
    return {"texture": texture | {"pixels": pixels}}


def large_material(random: Random) -> Table:
    """What walls and floors are of: one colour, shades that change slowly, or patterns."""
    if random.random() < 0.35:
        return draw.plain(random)
    if random.random() < 0.6:
        return any_material(random, 1024)
    shades = {
        "type": "noise",
        "exponent": round(random.uniform(1.6, 2.4), 2),
        "contrast": round(random.uniform(0.1, 0.3), 2),
        "colour": draw.colour(random, 0.3, 0.65),
        "seed": random.randrange(100_000),
        "pixels": 512,
    }
    return {"texture": shades}


def add_wall(
    random: Random,
    objects: Objects,
    z_mm: float,
    material: Material,
    name: str = "wall",
    side_mm: float = 1200,
) -> None:
    """Add an upright wall that fills the film."""
    objects.add(name, (0.0, 0.0, z_mm), UPRIGHT, draw.card(side_mm, side_mm), material(random))


def add_backwall(random: Random, objects: Objects, farthest_mm: float) -> None:
    """As often as not, add a wall behind all."""
    if random.random() >= 0.5:
        add_wall(random, objects, random.uniform(farthest_mm + 40, 880), large_material, "backwall")


def add_room(random: Random, objects: Objects, wall_mm: float, floor_mm: float) -> None:
    """Add a back wall, mostly a floor and often a side wall or two."""
    add_wall(random, objects, wall_mm, large_material)
    middle, long = (wall_mm + 400) / 2, wall_mm - 400
    if random.random() < 0.8:
        place, shape = (0.0, floor_mm + 200, middle), draw.box_of(1200, 400, long)
        objects.add("floor", place, UPRIGHT, shape, large_material(random))
    for name, side in (("left", -1), ("right", 1)):
        if random.random() < 0.5:
            place, shape = (side * random.uniform(150, 270), 0.0, middle), draw.card(long, 1000)
            objects.add(f"{name}-wall", place, (0.0, 90.0, 0.0), shape, large_material(random))


def mesh_folder() -> Path:
    """Where the files are; those that are there are not written again."""
    return cache_folder() / "meshes"


def mesh_of(points: np.ndarray, *sizes_mm: float) -> Table:
    """The mesh of a grid of points (rows, columns, 3); `sizes_mm` is the length of one unit, for each axis or
    for all three."""
    rows, columns, _ = points.shape
    right, up = np.meshgrid(np.linspace(0, 1, columns), np.linspace(1, 0, rows))
    vertices = np.concatenate([np.round(points, 4), right[..., None], up[..., None]], axis=-1).astype("<f4")
    corner = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1)
    faces = np.empty(quads[..., 0].size, [("count", "u1"), ("corners", "<i4", 4)])
    faces["count"], faces["corners"] = 4, quads.reshape(-1, 4)
    header = HEADER.format(vertices=rows * columns, faces=faces.size).encode()
    content = header + vertices.tobytes() + faces.tobytes()
    file = mesh_folder() / f"{hashlib.sha256(content).hexdigest()[:24]}.ply"
    if not file.exists():
        write_bytes_safely(file, content)
    scale = [round(size_mm, 2) for size_mm in sizes_mm]
    return {"type": "mesh", "file": file.name, "scale": scale if len(scale) > 1 else scale[0]}


def rod() -> np.ndarray:
    """An upright prism of 32 sides, of radius and half length 1, in pieces: rays are slow to trace between
    the long slivers of which a cylinder consists."""
    line = np.array([(0.0, -1.0), *((1.0, height) for height in np.linspace(-1, 1, 41)), (0.0, 1.0)])
    return _around(line, 32)


def blob(random: Random) -> np.ndarray:
    """A ball with bumps, stretched: waves over its surface, the shorter the lower."""
    directions = _globe()
    radius = np.ones(directions.shape[:2])
    strength, roughness = draw.log_uniform(random, 0.05, 0.35), random.uniform(0.8, 1.8)
    for _ in range(12):
        frequency = draw.log_uniform(random, 1, 8)
        wave = np.array([random.gauss(0, frequency) for _ in range(3)])
        height = strength * frequency**-roughness
        radius += height * np.sin(directions @ wave + random.uniform(0, 2 * math.pi))
    stretch = [draw.log_uniform(random, 0.7, 1.3) for _ in range(3)]
    return directions * np.maximum(radius, 0.3)[..., None] * stretch


def head(random: Random) -> np.ndarray:
    """An egg that faces the cameras, with a nose, two hollows for eyes, a chin and a neck."""
    directions = _globe()
    radius = 1.0 + 0.05 * np.cos(3 * directions[..., 1])
    nose, eyes = random.uniform(0.2, 0.4), random.uniform(0.08, 0.18)
    features = [
        ((0.0, random.uniform(0.05, 0.2), -1.0), nose, 0.16),
        ((-0.35, -0.15, -0.9), -eyes, 0.2),
        ((0.35, -0.15, -0.9), -eyes, 0.2),
        ((0.0, 0.75, -0.65), random.uniform(0.0, 0.15), 0.25),
        ((-1.0, 0.0, 0.0), 0.15, 0.15),
        ((1.0, 0.0, 0.0), 0.15, 0.15),
        ((0.0, 1.0, 0.15), random.uniform(0.2, 0.9), 0.4),
    ]
    for place, height, width in features:
        away = np.linalg.norm(directions - np.array(place) / np.linalg.norm(place), axis=-1)
        radius += height * np.exp(-((away / width) ** 2))
    return directions * radius[..., None] * [random.uniform(0.7, 0.85), 1.0, random.uniform(0.8, 0.95)]


def spindle(random: Random) -> np.ndarray:
    """A cone, a capsule, a disc with a hole, a vase: a line that goes once around the upright axis."""
    kind = random.choice(["cone", "capsule", "annulus", "vase", "vase"])
    along = np.linspace(0, 1, ROWS)
    if kind == "cone":
        line = np.array([(0.0, -1.2), (draw.log_uniform(random, 0.4, 1), 0.8), (0.0, 0.8)])
    elif kind == "capsule":
        angle = np.linspace(-math.pi / 2, math.pi / 2, ROWS)
        straight = random.uniform(0.3, 1.2) * np.sign(angle)
        line = 0.6 * np.stack([np.cos(angle), np.sin(angle) + straight], axis=-1)
    elif kind == "annulus":
        inner, half = random.uniform(0.3, 0.8), draw.log_uniform(random, 0.03, 0.4)
        line = np.array([(inner, -half), (1.0, -half), (1.0, half), (inner, half), (inner, -half)])
    else:
        radius = random.uniform(0.35, 0.6) * np.ones(ROWS)
        for number in range(1, 4):
            radius += random.uniform(-0.25, 0.25) / number * np.cos(number * math.pi * along)
        side = np.stack([np.maximum(radius, 0.12), 2 * along - 1], axis=-1)
        line = np.concatenate([[(0.0, -1.0)], side, [(0.0, 1.0)]])
    if len(line) < ROWS:
        line = _evenly(line)
    return _around(line, COLUMNS)


def tube(random: Random) -> np.ndarray:
    """A ring, round or wavy, a knot or a spring: a circle that goes along a curve."""
    kind = random.choice(["ring", "ring", "wavy", "knot", "spring"])
    along, thick = np.linspace(0, 2 * math.pi, 4 * ROWS), draw.log_uniform(random, 0.06, 0.4)
    radius, depth, turns = np.ones_like(along), 0 * along, 1
    if kind == "wavy":
        waves, height = random.randint(3, 8), random.uniform(0.05, 0.2)
        radius = radius + height * np.cos(waves * along)
        depth = height * np.sin(waves * along)
    elif kind == "knot":
        turns, waves, thick = 2, random.choice([3, 5, 7]), min(thick, 0.15)
        radius, depth = 0.75 + 0.3 * np.cos(waves * along), 0.3 * np.sin(waves * along)
    elif kind == "spring":
        turns, thick = random.randint(3, 6), min(thick, 0.12)
        radius, depth = 0.5 * radius, np.linspace(-1, 1, along.size)
    curve = np.stack([radius * np.cos(turns * along), radius * np.sin(turns * along), depth], axis=-1)
    forward = np.gradient(curve, axis=0)
    if kind != "spring":  # the curve closes
        forward[[0, -1]] = forward[0] + forward[-1]
    # Across the curve: away from the axis through the ring, and at right angles to both.
    outward = np.stack([np.cos(turns * along), np.sin(turns * along), 0 * along], axis=-1)
    sideways = _unit(np.cross(forward, outward))
    outward = _unit(np.cross(sideways, forward))
    angle = np.linspace(2 * math.pi, 0, ROWS // 2)[None, :, None]
    return curve[:, None] + thick * (np.cos(angle) * outward[:, None] + np.sin(angle) * sideways[:, None])


CURVED = blob, head, tube, tube, spindle
"""What makes curved surfaces, tubes twice as often as others."""


def _around(line: np.ndarray, columns: int) -> np.ndarray:
    """The surface (rows, columns + 1, 3) of a line (rows, 2) of radii and heights about the upright axis."""
    angle = np.linspace(-math.pi, math.pi, columns + 1)
    radius, height = (line[:, part, None] + 0 * angle for part in (0, 1))
    return np.stack([radius * np.sin(angle), height, -radius * np.cos(angle)], axis=-1)


def _globe() -> np.ndarray:
    """Directions (ROWS, COLUMNS + 1, 3) from the pole above to the one below, once around."""
    east, south = np.meshgrid(
        np.linspace(-math.pi, math.pi, COLUMNS + 1), np.linspace(-math.pi / 2, math.pi / 2, ROWS)
    )
    return np.stack([np.sin(east) * np.cos(south), np.sin(south), -np.cos(east) * np.cos(south)], axis=-1)


def _evenly(line: np.ndarray) -> np.ndarray:
    """`ROWS` points evenly along a line (N, 2)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    even = np.linspace(0, length[-1], ROWS)
    return np.stack([np.interp(even, length, part) for part in line.T], axis=-1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
