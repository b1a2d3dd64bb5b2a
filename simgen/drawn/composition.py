"""What drawn scenes are composed of: depths, objects that stand there, lamps.

The order in which a scene calls its `Random` is part of what a number means. Lengths are rounded to 0.1 mm.
"""

from collections.abc import Sequence
from itertools import pairwise
from random import Random
from typing import Any

from simgen.spec.scene import Scene, scene_of

Table = dict[str, Any]
"""A TOML table."""
REFERENCE_MM = 560.0
"""Sizes and places are drawn for this depth and scaled, so that things are as large in the picture."""
PLANES_MM: tuple[int, ...] = (480, 510, 545, 585, 630, 680)
MIN_GAP_MM = 80
DARK_BACKDROP = {"z_mm": 3000.0, "reflectance": "black 2"}


def colour(random: Random, low: float, high: float) -> list[float]:
    """sRGB, each part between the two."""
    return [round(random.uniform(low, high), 2) for _ in range(3)]


def plain(random: Random) -> Table:
    """One colour."""
    return {"reflectance": colour(random, 0.15, 0.85)}


def noise(random: Random, mean_colour: list[float]) -> Table:
    """Noise like that of natural scenes, of this mean colour."""
    exponent, contrast = random.uniform(0.8, 1.3), random.uniform(0.15, 0.3)
    return {
        "texture": {
            "type": "noise",
            "exponent": round(exponent, 2),
            "contrast": round(contrast, 2),
            "colour": mean_colour,
            "chroma": round(random.uniform(0, 0.4), 2),
            "seed": random.randrange(1000),
        }
    }


def pattern(random: Random) -> Table:
    """Noise or checks."""
    if random.random() < 0.6:
        return noise(random, colour(random, 0.3, 0.7))
    return chessboard(random)


def chessboard(random: Random, fewest: int = 4, most: int = 8) -> Table:
    """Checks of two colours, from `fewest` to `most` to a side."""
    colours = [colour(random, 0.15, 0.85), colour(random, 0.15, 0.85)]
    rows, columns = random.randint(fewest, most), random.randint(fewest, most)
    return {"texture": {"type": "checks", "rows": rows, "columns": columns, "colours": colours}}


def glossy(random: Random) -> Table:
    """Plastic of one colour, or metal, each from a near mirror to dull."""
    roughness = round(10 ** random.uniform(-1.4, -0.3), 2)
    if random.random() < 0.5:
        return plain(random) | {"finish": {"type": "plastic", "roughness": roughness}}
    metal = random.choice(["Ag", "Al", "Au", "Cr", "Cu", "W"])
    return {"finish": {"type": "metal", "name": metal, "roughness": roughness}}


def drawn_scene(
    random: Random,
    title: str,
    objects: list[Table],
    planes_mm: Sequence[int],
    backdrop: Table | None = DARK_BACKDROP,
) -> Scene:
    """The scene of these objects, its lamps drawn last."""
    scene = {"title": title, "planes_mm": list(planes_mm), "objects": objects, "lights": _lamps(random)}
    return scene_of(scene if backdrop is None else scene | {"backdrop": backdrop}, None, title)


def planes_apart(random: Random, count: int) -> list[int]:
    """`count` depths, in mm, well apart."""
    while True:
        planes: list[int] = sorted(random.sample(PLANES_MM, count))
        if all(far - near >= MIN_GAP_MM for near, far in pairwise(planes)):
            return planes


def two_planes(random: Random) -> tuple[int, int]:
    """Two depths, from 90 to 140 mm apart, the nearer first."""
    near = random.randrange(470, 531)
    return near, near + random.randrange(90, 141)


def solid(
    random: Random, name: str, place_mm: tuple[float, float, float], radius_mm: float, material: Table
) -> Table:
    """A turned sphere, cylinder or box, about as large as a sphere of this radius."""
    rotation_deg = random.uniform(-25, 25), random.uniform(-40, 40), random.uniform(-25, 25)
    r = radius_mm
    shapes = [sphere(r), cylinder_of(0.7 * r, 2.1 * r), box_of(1.5 * r, 1.7 * r, 1.3 * r)]
    return placed(name, place_mm, rotation_deg, random.choice(shapes), material)


def placed(
    name: str,
    place_mm: tuple[float, float, float],
    rotation_deg: tuple[float, float, float],
    shape: Table,
    material: Table,
) -> Table:
    """An object of a scene."""
    return {
        "name": name,
        "position_mm": [round(value, 1) for value in place_mm],
        "rotation_deg": [round(value, 1) for value in rotation_deg],
        "shape": shape,
        "material": material,
    }


def sphere(radius_mm: float) -> Table:
    """A sphere."""
    return _shape("sphere", radius_mm=radius_mm)


def cylinder_of(radius_mm: float, length_mm: float) -> Table:
    """A cylinder, whose axis is upright."""
    return _shape("cylinder", radius_mm=radius_mm, length_mm=length_mm)


def box_of(width_mm: float, height_mm: float, depth_mm: float) -> Table:
    """A box."""
    return _shape("box", width_mm=width_mm, height_mm=height_mm, depth_mm=depth_mm)


def card(width_mm: float, height_mm: float) -> Table:
    """A card, which faces the cameras."""
    return _shape("card", width_mm=width_mm, height_mm=height_mm)


def _shape(kind: str, **sizes_mm: float) -> Table:
    return {"type": kind} | {name: round(size_mm, 1) for name, size_mm in sizes_mm.items()}


def _lamps(random: Random) -> list[Table]:
    return [
        {
            "type": "area",
            "position_mm": [round(random.uniform(-300, 300), 0), -430.0, round(random.uniform(150, 400), 0)],
            "target_mm": [0.0, 0.0, 600.0],
            "width_mm": 400.0,
            "height_mm": 300.0,
            "luminance_cd_m2": 2000.0,
        },
        {"type": "uniform", "luminance_cd_m2": round(random.uniform(60, 150), 0)},
    ]
