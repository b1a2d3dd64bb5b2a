"""What objects of drawn scenes are made of: colours, patterns, shapes. Lengths are rounded to 0.1 mm."""

from random import Random
from typing import Any

Table = dict[str, Any]
"""A TOML table."""


def colour(random: Random, low: float, high: float) -> list[float]:
    """sRGB, each part between the two."""
    return [round(random.uniform(low, high), 2) for _ in range(3)]


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
