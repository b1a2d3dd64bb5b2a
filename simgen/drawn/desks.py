"""Kinds of drawn scenes that are arranged: solids that stand on a desk, something behind leaves."""

import math
from random import Random

from simgen.drawn.composition import (
    Table,
    box_of,
    card,
    chessboard,
    colour,
    cylinder_of,
    drawn_scene,
    noise,
    placed,
    sphere,
)
from simgen.spec.scene import Scene

DESK_TOP_MM = 65.0
APART_MM = 2.0
MAX_TRIES = 1000


def drawn_solids(random: Random) -> Scene:
    """Boxes, a tin, a ball and a few marbles on a desk before a wall; nothing touches anything else."""
    near = random.randint(470, 490)
    middle = near + random.randint(75, 90)
    far = middle + random.randint(80, 100)
    standing: list[Table] = []
    reaches: list[tuple[tuple[float, float], float]] = []

    def stand(
        name: str, shape: Table, half_height_mm: float, radius_mm: float, z_mm: float, x_mm: float
    ) -> None:
        """Put something on the desk, drawn again until it is apart from all others."""
        for _ in range(MAX_TRIES):
            x = random.uniform(-x_mm, x_mm)
            gaps = (math.dist((x, z_mm), place) - reach - radius_mm for place, reach in reaches)
            if all(gap >= APART_MM for gap in gaps):
                break
        else:
            return  # the desk is full
        reaches.append(((x, z_mm), radius_mm))
        turned = 0.0, random.uniform(-60, 60), 0.0
        place = x, DESK_TOP_MM - half_height_mm, z_mm
        standing.append(placed(name, place, turned, shape, _material(random, name)))

    radius = random.uniform(32, 46)
    stand("ball", sphere(radius), radius, radius, far + 25, 90)
    radius, height = random.uniform(20, 32), random.uniform(40, 75)
    stand("tin", cylinder_of(radius, height), height / 2, radius, middle + 20, 95)
    for number in range(random.randint(1, 2)):
        width, height, depth = random.uniform(28, 42), random.uniform(28, 50), random.uniform(28, 38)
        reach = math.hypot(width, depth) / 2
        stand(f"block-{number + 1}", box_of(width, height, depth), height / 2, reach, near + 20, 110)
    for number in range(random.randint(0, 4)):
        radius, depth = random.uniform(7, 12), random.choice([near, middle])
        stand(f"marble-{number + 1}", sphere(radius), radius, radius, depth + 12, 115)
    wood = random.choice([[0.62, 0.52, 0.4], [0.62, 0.52, 0.4], [0.35, 0.25, 0.18], [0.42, 0.44, 0.5]])
    upright = 0.0, 0.0, 0.0
    desk = placed("desk", (0.0, 185.0, 590.0), upright, box_of(640, 240, 320), noise(random, wood))
    paper = noise(random, colour(random, 0.5, 0.75))
    wall = placed("wall", (0.0, 0.0, 761.0), upright, card(700, 700), paper)
    return drawn_scene(random, "Solids on a desk", [desk, wall, *standing], [near, middle, far, 760], None)


def drawn_foliage(random: Random) -> Scene:
    """Seeing through what stands in front: 20 to 45 leaves of one kind before a patterned solid."""
    near = random.randint(465, 500)
    far = near + random.randint(95, 140)
    green = random.choices(
        [[0.3, 0.5, 0.2], [0.45, 0.55, 0.25], [0.6, 0.45, 0.2], [0.55, 0.25, 0.2]], weights=[4, 3, 1, 1]
    )[0]
    objects = []
    for number in range(random.randint(20, 45)):
        place = random.gauss(0, 33), random.gauss(0, 33), near + random.gauss(0, 2)
        turned = random.uniform(-45, 45), random.uniform(-45, 45), random.uniform(0, 180)
        shape = card(random.uniform(12, 28), random.uniform(8, 16))
        # Each a little lighter or darker than the green of all.
        light = random.uniform(0.8, 1.25)
        material = noise(random, [round(min(light * part, 1.0), 3) for part in green])
        objects.append(placed(f"leaf-{number + 1}", place, turned, shape, material))
    shape = random.choice(
        [
            sphere(random.uniform(58, 72)),
            cylinder_of(random.uniform(42, 54), random.uniform(110, 150)),
            box_of(random.uniform(85, 110), random.uniform(95, 130), 60),
        ]
    )
    turned = random.uniform(-20, 20), random.uniform(-40, 40), random.uniform(-30, 30)
    place = random.uniform(-15, 15), random.uniform(-15, 15), far + 25.0
    objects.append(placed("hidden", place, turned, shape, _material(random, "hidden")))
    backdrop = {"z_mm": 2500.0, "reflectance": [0.03, 0.035, 0.04]}
    return drawn_scene(random, "Something behind leaves", objects, [near, far], backdrop)


def _material(random: Random, name: str) -> Table:
    """Metal or plastic for marbles, checks for blocks, checks, noise or stripes for the rest."""
    kind = name.partition("-")[0]
    if kind == "marble" and random.random() < 0.5:
        metal, roughness = random.choice(["Ag", "Au", "Cu"]), round(random.uniform(0.05, 0.4), 2)
        return {"finish": {"type": "metal", "name": metal, "roughness": roughness}}
    if kind == "marble":
        return {"reflectance": colour(random, 0.2, 0.9), "finish": {"type": "plastic", "roughness": 0.1}}
    if kind == "block" or random.random() < 0.4:
        return chessboard(random)
    if random.random() < 0.5:
        return noise(random, colour(random, 0.3, 0.6))
    periods, angle = random.randint(6, 16), round(random.uniform(-90, 90), 1)
    colours = [colour(random, 0.1, 0.6), [0.9, 0.88, 0.8]]
    return {"texture": {"type": "stripes", "periods": periods, "angle_deg": angle, "colours": colours}}
