"""What drawn scenes consist of: colours, materials, shapes and lamps; and curved shapes as meshes, made of
random numbers: bumpy blobs and heads, cones and vases, rings and knots.

A curved surface is a grid of points (rows, columns, 3) in units of about its own radius. It is written as a
PLY file of quads with texture coordinates, named after its content. Axes are the world's: Y down, Z forward.
The order in which a function calls its `Random` is part of what the number of a scene means. Lengths are
rounded to 0.1 mm.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from pcii.base import write_bytes_safely
from simgen.base import cache_folder
from simgen.spec import Scene, scene_of

Table = dict[str, Any]
"""A TOML table."""
Material = Callable[[Random], Table]
Triple = tuple[float, float, float]

UPRIGHT: Triple = 0.0, 0.0, 0.0
SIZES = {
    "sphere": ("radius_mm",),
    "cylinder": ("radius_mm", "length_mm"),
    "box": ("width_mm", "height_mm", "depth_mm"),
    "card": ("width_mm", "height_mm"),
}
ROWS, COLUMNS = 64, 128
HEADER = (
    "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n"
    + "".join(f"property float {name}\n" for name in "xyzst")
    + "element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
)


def log_uniform(random: Random, low: float, high: float) -> float:
    """A number between the two, even in its logarithm."""
    return low * (high / low) ** random.random()


def colour(random: Random, low: float, high: float) -> list[float]:
    """sRGB, each part between the two."""
    return [round(random.uniform(low, high), 2) for _ in range(3)]


def plain(random: Random) -> Table:
    """A material of one colour."""
    return {"reflectance": colour(random, 0.15, 0.85)}


def noise(
    random: Random,
    mean_colour: list[float] | None = None,
    exponents: tuple[float, float] = (0.8, 1.3),
    contrasts: tuple[float, float] = (0.15, 0.3),
    most_chroma: float = 0.4,
    seeds: int = 1000,
) -> Table:
    """Noise like that of natural scenes, of this mean colour or any, and without chroma at 0."""
    texture: Table = {
        "type": "noise",
        "exponent": round(random.uniform(*exponents), 2),
        "contrast": round(random.uniform(*contrasts), 2),
        "colour": mean_colour or colour(random, 0.3, 0.65),
    }
    if most_chroma:
        texture["chroma"] = round(random.uniform(0, most_chroma), 2)
    return {"texture": texture | {"seed": random.randrange(seeds)}}


def metal(name: str, roughness: float) -> Table:
    """A metal by its symbol; the roughness is rounded to 0.01."""
    return {"finish": {"type": "metal", "name": name, "roughness": round(roughness, 2)}}


def glossy(random: Random) -> Table:
    """Plastic of one colour, or metal, each from a near mirror to dull."""
    roughness = round(10 ** random.uniform(-1.4, -0.3), 2)
    if random.random() < 0.5:
        return plain(random) | {"finish": {"type": "plastic", "roughness": roughness}}
    return metal(random.choice(["Ag", "Al", "Au", "Cr", "Cu", "W"]), roughness)


class Objects(list[Table]):
    """The objects of a scene."""

    def add(self, name: str, place_mm: Triple, rotation_deg: Triple, shape: Table, material: Table) -> None:
        """Put another one beside them."""
        thing: Table = {"name": name, "shape": shape, "material": material}
        thing["position_mm"] = [round(value, 1) for value in place_mm]
        self.append(thing | {"rotation_deg": [round(value, 1) for value in rotation_deg]})


def shape_of(kind: str, *sizes_mm: float) -> Table:
    """A sphere, an upright cylinder, a box, or a card, which faces the cameras, of its `SIZES`."""
    sizes = zip(SIZES[kind], sizes_mm, strict=True)
    return {"type": kind} | {name: round(size_mm, 1) for name, size_mm in sizes}


def lamp_and_sky(x_mm: float, z_mm: float, lamp_cd_m2: float, sky_cd_m2: float) -> list[Table]:
    """A broad lamp above what the cameras see, and even light from all around."""
    lamp = {
        "type": "area",
        "position_mm": [x_mm, -430, z_mm],
        "target_mm": [0, 0, 600],
        "width_mm": 400,
        "height_mm": 300,
        "luminance_cd_m2": lamp_cd_m2,
    }
    return [lamp, {"type": "uniform", "luminance_cd_m2": sky_cd_m2}]


def any_lights(random: Random, finishes: set[str]) -> list[Table]:
    """Even light from all around, mostly with a lamp: broad or small, a bulb, a spot, or one far away.

    Gloss and metals make rare and bright paths of the light of a small lamp, and glass does so of any lamp.
    So lamps are broad where `finishes` has gloss or metals, and there are none with glass.
    """
    even_light = {"type": "uniform", "luminance_cd_m2": round(log_uniform(random, 20, 400), 1)}
    kinds = ["area", "area", "none"]
    if "glass" in finishes:
        kinds = ["none"]
    elif not finishes:
        kinds += ["point", "spot", "directional"]
    kind = random.choice(kinds)
    place = [round(random.uniform(*ends)) for ends in ((-140, 140), (-430, -220), (0, 420))]
    target = [round(random.uniform(*ends)) for ends in ((-80, 80), (-60, 60), (480, 720))]
    lux, square_m = log_uniform(random, 100, 3000), math.dist(place, target) ** 2 / 1e6
    side, beam = log_uniform(random, 300 if finishes else 40, 400), random.uniform(3, 25)
    if kind == "none":
        return [even_light]
    luminance = lux * square_m / (side * side / 1e6)
    values = {
        "area": {"width_mm": side, "height_mm": side, "luminance_cd_m2": luminance},
        "point": {"intensity_cd": lux * square_m},
        "spot": {"intensity_cd": lux * square_m, "beam_deg": beam, "cutoff_deg": 2 * beam},
        "directional": {"illuminance_lux": lux},
    }
    lamp = {name: round(value, 3) for name, value in values[kind].items()}
    places = {"position_mm": place, "target_mm": target}
    if kind == "point":
        places = {"position_mm": place}
    elif kind == "directional":
        places = {"direction": [b - a for a, b in zip(place, target, strict=True)]}
    tint = random.choice(["D65", "D65", "A", "FL2"])
    return [even_light, {"type": kind, "illuminant": tint} | lamp | places]


def composed(
    title: str,
    objects: Objects,
    planes_mm: Sequence[float],
    lights: list[Table],
    backdrop: Table | None,
    *,
    has_meshes: bool = False,
) -> Scene:
    """The scene of these parts."""
    values = {"title": title, "planes_mm": list(planes_mm), "objects": objects, "lights": lights}
    folder = mesh_folder() if has_meshes else None
    return scene_of(values if backdrop is None else values | {"backdrop": backdrop}, folder, title)


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


def rod_of(radius_mm: float, length_mm: float) -> Table:
    """An upright prism of 32 sides, in pieces: rays are slow to trace between the long slivers of which a
    cylinder consists."""
    line = np.array([(0.0, -1.0), *((1.0, height) for height in np.linspace(-1, 1, 41)), (0.0, 1.0)])
    return mesh_of(_around(line, 32), radius_mm, length_mm / 2, radius_mm)


def blob(random: Random) -> np.ndarray:
    """A ball with bumps, stretched: waves over its surface, the shorter the lower."""
    directions = _globe()
    radius = np.ones(directions.shape[:2])
    strength, roughness = log_uniform(random, 0.05, 0.35), random.uniform(0.8, 1.8)
    for _ in range(12):
        frequency = log_uniform(random, 1, 8)
        wave = np.array([random.gauss(0, frequency) for _ in range(3)])
        height = strength * frequency**-roughness
        radius += height * np.sin(directions @ wave + random.uniform(0, 2 * math.pi))
    stretch = [log_uniform(random, 0.7, 1.3) for _ in range(3)]
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
        line = np.array([(0.0, -1.2), (log_uniform(random, 0.4, 1), 0.8), (0.0, 0.8)])
    elif kind == "capsule":
        angle = np.linspace(-math.pi / 2, math.pi / 2, ROWS)
        straight = random.uniform(0.3, 1.2) * np.sign(angle)
        line = 0.6 * np.stack([np.cos(angle), np.sin(angle) + straight], axis=-1)
    elif kind == "annulus":
        inner, half = random.uniform(0.3, 0.8), log_uniform(random, 0.03, 0.4)
        line = np.array([(inner, -half), (1.0, -half), (1.0, half), (inner, half), (inner, -half)])
    else:
        radius = random.uniform(0.35, 0.6) * np.ones(ROWS)
        for number in range(1, 4):
            radius += random.uniform(-0.25, 0.25) / number * np.cos(number * math.pi * along)
        side = np.stack([np.maximum(radius, 0.12), 2 * along - 1], axis=-1)
        line = np.concatenate([[(0.0, -1.0)], side, [(0.0, 1.0)]])
    if len(line) < ROWS:  # as many points, evenly along it
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        even = np.linspace(0, length[-1], ROWS)
        line = np.stack([np.interp(even, length, part) for part in line.T], axis=-1)
    return _around(line, COLUMNS)


def tube(random: Random) -> np.ndarray:
    """A ring, round or wavy, a knot or a spring: a circle that goes along a curve."""
    kind = random.choice(["ring", "ring", "wavy", "knot", "spring"])
    along, thick = np.linspace(0, 2 * math.pi, 4 * ROWS), log_uniform(random, 0.06, 0.4)
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


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
