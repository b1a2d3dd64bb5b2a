"""What drawn scenes consist of: colours, materials, shapes, lamps. Lengths are rounded to 0.1 mm.

The order in which a function calls its `Random` is part of what the number of a scene means.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any

from simgen.spec import Scene, scene_of

Table = dict[str, Any]
"""A TOML table."""
Material = Callable[[Random], Table]
Triple = tuple[float, float, float]

UPRIGHT: Triple = 0.0, 0.0, 0.0


def log_uniform(random: Random, low: float, high: float) -> float:
    """A number between the two, even in its logarithm."""
    return low * (high / low) ** random.random()


def colour(random: Random, low: float, high: float) -> list[float]:
    """sRGB, each part between the two."""
    return [round(random.uniform(low, high), 2) for _ in range(3)]


def plain(random: Random) -> Table:
    """A material of one colour."""
    return {"reflectance": colour(random, 0.15, 0.85)}


def noise(random: Random, mean_colour: list[float]) -> Table:
    """Noise like that of natural scenes, of this mean colour."""
    texture = {
        "type": "noise",
        "exponent": round(random.uniform(0.8, 1.3), 2),
        "contrast": round(random.uniform(0.15, 0.3), 2),
        "colour": mean_colour,
        "chroma": round(random.uniform(0, 0.4), 2),
        "seed": random.randrange(1000),
    }
    return {"texture": texture}


def chessboard(random: Random, fewest: int = 4, most: int = 8) -> Table:
    """Checks of two colours, from `fewest` to `most` to a side."""
    colours = [colour(random, 0.15, 0.85), colour(random, 0.15, 0.85)]
    rows, columns = random.randint(fewest, most), random.randint(fewest, most)
    return {"texture": {"type": "checks", "rows": rows, "columns": columns, "colours": colours}}


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


def sphere(radius_mm: float) -> Table:
    """A sphere."""
    return {"type": "sphere", "radius_mm": round(radius_mm, 1)}


def cylinder_of(radius_mm: float, length_mm: float) -> Table:
    """A cylinder, whose axis is upright."""
    return {"type": "cylinder", "radius_mm": round(radius_mm, 1), "length_mm": round(length_mm, 1)}


def box_of(width_mm: float, height_mm: float, depth_mm: float) -> Table:
    """A box."""
    return card(width_mm, height_mm) | {"type": "box", "depth_mm": round(depth_mm, 1)}


def card(width_mm: float, height_mm: float) -> Table:
    """A card, which faces the cameras."""
    return {"type": "card", "width_mm": round(width_mm, 1), "height_mm": round(height_mm, 1)}


def lamp_above(x_mm: float, z_mm: float, luminance_cd_m2: float) -> Table:
    """A broad lamp above what the cameras see."""
    return {
        "type": "area",
        "position_mm": [x_mm, -430, z_mm],
        "target_mm": [0, 0, 600],
        "width_mm": 400,
        "height_mm": 300,
        "luminance_cd_m2": luminance_cd_m2,
    }


def sky(luminance_cd_m2: float) -> Table:
    """Even light from all around."""
    return {"type": "uniform", "luminance_cd_m2": luminance_cd_m2}


def composed(
    title: str,
    objects: Objects,
    planes_mm: Sequence[float],
    lights: list[Table],
    backdrop: Table | None,
    folder: Path | None = None,
) -> Scene:
    """The scene of these parts, its meshes in `folder`."""
    values = {"title": title, "planes_mm": list(planes_mm), "objects": objects, "lights": lights}
    return scene_of(values if backdrop is None else values | {"backdrop": backdrop}, folder, title)
