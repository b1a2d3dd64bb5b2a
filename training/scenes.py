"""Scenes that the network is trained on beside those that ship: `simgen` draws them by number."""

from collections.abc import Callable
from random import Random
from typing import Any

import simgen
from simgen.drawn.composition import box_of, card, colour, cylinder_of, placed, sphere

Table = dict[str, Any]


def assorted(random: Random) -> simgen.Scene:
    """Up to a dozen things, plain, patterned or shiny, over and under one another at any depth from 440 to
    700 mm, before a backdrop that is dark, plain or patterned, or a floor: all that the shipped scenes have,
    in other combinations."""
    near = random.randint(455, 520)
    middle = near + random.randint(50, 90)
    far = middle + random.randint(50, 100)
    objects = []

    def add(
        kind: str, count: int, shape: Callable[[], Table], away_mm: float, turn: tuple[float, ...]
    ) -> None:
        for number in range(count):
            z = random.choice([near, middle, far]) + away_mm
            if kind == "card":
                z = random.uniform(450, 700)
            place = random.uniform(-110, 110), random.uniform(-100, 100), z
            turned = tuple(random.uniform(-angle, angle) for angle in turn)
            objects.append(placed(f"{kind}-{number}", place, turned, shape(), any_material(random)))

    add("ball", random.randint(0, 3), lambda: sphere(log_uniform(random, 10, 65)), 30, (180, 180, 180))
    sides = (15, 120), (15, 120), (10, 60)
    add(
        "box",
        random.randint(0, 3),
        lambda: box_of(*(log_uniform(random, *ends) for ends in sides)),
        25,
        (40, 50, 60),
    )
    add(
        "tin",
        random.randint(0, 2),
        lambda: cylinder_of(log_uniform(random, 6, 40), log_uniform(random, 30, 180)),
        20,
        (60, 60, 90),
    )
    cards = random.choices([0, 1, 2, 6, 14], weights=[2, 2, 2, 1, 1])[0]
    add(
        "card",
        cards,
        lambda: card(log_uniform(random, 15, 160), log_uniform(random, 10, 110)),
        0,
        (35, 35, 180),
    )
    if random.random() < 0.5:  # a wall or a floor within reach
        turned = random.choice([(0.0, 0.0, 0.0), (random.uniform(-10, 10), random.uniform(-30, 30), 0.0)])
        turned = random.choice([turned, (random.uniform(40, 65), random.uniform(-10, 10), 0.0)])
        place = 0.0, 60.0, random.uniform(690, 780)
        objects.append(placed("ground", place, turned, card(900, 900), any_material(random, 2048)))
    luminances = log_uniform(random, 500, 4000), log_uniform(random, 40, 400)
    return _lit(random, "Assorted things", objects, [near, middle, far], luminances)


def screens(random: Random) -> simgen.Scene:
    """Upright bars of one material, from few and broad to many and narrow, before one or two things and
    sometimes a wall: from every camera another part of what is behind is hidden."""
    near = random.randint(450, 510)
    far = near + random.randint(60, 150)
    width, tilt, material = log_uniform(random, 3, 16), random.uniform(-90, 90), any_material(random, 256)
    objects = []
    for number in range(random.choice([3, 6, 10])):
        place = random.uniform(-110, 110), random.uniform(-30, 30), near + random.gauss(0, 2)
        shape = card(width, random.uniform(120, 260))
        objects.append(placed(f"bar-{number}", place, (0.0, 0.0, tilt + random.gauss(0, 6)), shape, material))
    for number in range(random.randint(1, 2)):
        shape = random.choice(
            [
                sphere(random.uniform(30, 72)),
                cylinder_of(random.uniform(25, 54), random.uniform(70, 150)),
                box_of(random.uniform(60, 180), random.uniform(60, 160), random.uniform(4, 60)),
            ]
        )
        place = random.uniform(-60, 60), random.uniform(-50, 50), far + 25.0
        turned = random.uniform(-20, 20), random.uniform(-40, 40), random.uniform(-30, 30)
        objects.append(placed(f"thing-{number}", place, turned, shape, any_material(random)))
    if random.random() < 1 / 3:
        place = 0.0, 0.0, random.uniform(690, 780)
        objects.append(placed("wall", place, (0.0, 0.0, 0.0), card(900, 900), any_material(random, 2048)))
    return _lit(random, "Things behind bars", objects, [near, far], (2000.0, log_uniform(random, 60, 300)))


def any_material(random: Random, pixels: int = 512) -> Table:
    """Noise, one colour, stripes, checks, a star, text or metal."""
    two = [colour(random, 0.1, 0.5), colour(random, 0.4, 0.9)]
    if random.random() < 0.25:
        return {"reflectance": colour(random, 0.1, 0.9)}
    if random.random() < 0.08:
        metal, roughness = random.choice(["Ag", "Au", "Cu"]), round(log_uniform(random, 0.08, 0.5), 2)
        return {"finish": {"type": "metal", "name": metal, "roughness": roughness}}
    texture = random.choice(
        [
            {
                "type": "noise",
                "exponent": round(random.uniform(0.7, 1.5), 2),
                "contrast": round(random.uniform(0.1, 0.35), 2),
                "colour": colour(random, 0.3, 0.65),
                "chroma": round(random.uniform(0, 0.5), 2),
                "seed": random.randrange(100_000),
            },
            {
                "type": "stripes",
                "periods": random.randint(3, 30),
                "angle_deg": round(random.uniform(-90, 90), 1),
                "profile": random.choice(["square", "sine"]),
                "colours": two,
            },
            {
                "type": "checks",
                "rows": random.randint(2, 12),
                "columns": random.randint(2, 12),
                "colours": two,
            },
            {"type": "star", "spokes": random.randint(4, 40), "colours": two},
            {"type": "text", "text": random.choice(["photon", "a b c d e f", "Depth 42"]), "colours": two},
        ]
    )
    return {"texture": texture | {"pixels": pixels}}


def log_uniform(random: Random, low: float, high: float) -> float:
    """A number between the two, even in its logarithm."""
    return low * (high / low) ** random.random()


def _lit(
    random: Random, title: str, objects: list[Table], planes: list[int], luminances: tuple[float, float]
) -> simgen.Scene:
    lamp = {
        "type": "area",
        "position_mm": [round(random.uniform(-300, 300)), -430.0, round(random.uniform(100, 400))],
        "target_mm": [0.0, 0.0, 600.0],
        "width_mm": 400.0,
        "height_mm": 300.0,
        "luminance_cd_m2": round(luminances[0], 1),
    }
    dark = [[0.02, 0.02, 0.02], [0.04, 0.04, 0.05], colour(random, 0.1, 0.6)]
    values = {
        "title": title,
        "planes_mm": planes,
        "objects": objects,
        "lights": [lamp, {"type": "uniform", "luminance_cd_m2": round(luminances[1], 1)}],
        "backdrop": {"z_mm": 2500.0, "reflectance": random.choices(dark, weights=[2, 2, 1])[0]},
    }
    return simgen.load_scene(values)
