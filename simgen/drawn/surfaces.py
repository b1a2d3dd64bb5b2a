"""Materials of drawn scenes: plain, patterned, glossy."""

from random import Random
from typing import Any

Table = dict[str, Any]


def colour(random: Random, low: float, high: float) -> list[float]:
    """sRGB, each part between the two."""
    return [round(random.uniform(low, high), 2) for _ in range(3)]


def plain(random: Random) -> Table:
    """One colour."""
    return {"reflectance": colour(random, 0.15, 0.85)}


def noise(random: Random, mean_colour: list[float]) -> Table:
    """Noise like that of natural scenes about a colour."""
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
    """Checks of two colours, so many to a side."""
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
