"""Parts of scenes that networks are trained on: shapes, materials, walls, pictures, bars, lights."""

import math
from random import Random

from simgen.drawn import composition as draw
from simgen.drawn.composition import UPRIGHT, Material, Objects, Table, Triple
from simgen.drawn.curved_shapes import mesh_of, rod

HALF_FIELD = 0.36
"""Half of what a camera sees, by its depth."""


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
    """Noise, one draw.colour, stripes, checks, a star, text or metal."""
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


def nearly_alike(random: Random, material: Table) -> Table:
    """The same material; of one colour a little lighter or darker."""
    light = random.uniform(0.9, 1.1)
    if "reflectance" not in material:
        return material
    return material | {"reflectance": [round(min(1.0, light * part), 3) for part in material["reflectance"]]}


def large_material(random: Random) -> Table:
    """What walls and floors are of: one draw.colour, shades that change slowly, or patterns."""
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


def add_pictures(random: Random, objects: Objects, wall_mm: float, floor_mm: float) -> None:
    """Add up to four pictures on the back wall, some of them in a frame, some of a few patches."""
    for number in range(random.choice([0, 1, 1, 2, 3, 4])):
        width, height = draw.log_uniform(random, 30, 250), draw.log_uniform(random, 30, 180)
        reach = HALF_FIELD * wall_mm
        x, y = random.uniform(-0.8, 0.8) * reach, random.uniform(-0.8 * reach, min(floor_mm, reach) - 20)
        turned = 0.0, 0.0, random.choice([0.0, random.uniform(-8, 8)])
        if random.random() < 0.5:
            frame = draw.box_of(1.12 * width, 1.12 * height, 3)
            objects.add(f"frame-{number}", (x, y, wall_mm - 1.6), turned, frame, draw.plain(random))
        place, shape = (x, y, wall_mm - 3.3), draw.card(width, height)
        objects.add(f"picture-{number}", place, turned, shape, any_material(random))
        for patch in range(random.choice([0, 0, 3])):
            place = x + random.uniform(-0.3, 0.3) * width, y + random.uniform(-0.3, 0.3) * height
            shape = draw.card(random.uniform(0.1, 0.4) * width, random.uniform(0.1, 0.4) * height)
            name, z = f"picture-{number}-{patch}", wall_mm - 3.6 - 0.3 * patch
            objects.add(name, (*place, z), turned, shape, any_material(random, 128))


def add_narrow_things(random: Random, objects: Objects, z_mm: float) -> None:
    """Add pickets, rods or wires beside each other, of one material, or two layers of them that cross."""
    width = draw.log_uniform(random, 2.4, 20)
    shape_of = random.choice(
        [
            lambda long: draw.card(width, long),
            lambda long: draw.box_of(width, long, draw.log_uniform(random, 1, 12)),
            lambda long: mesh_of(rod(), width / 2, long / 2, width / 2),
        ]
    )
    spacing, tilt = width * draw.log_uniform(random, 1.5, 6), random.uniform(-90, 90)
    count, disorder = max(3, min(24, round(320 / spacing))), random.choice([0.0, 1.0, 12.0])
    material = draw.plain(random) if random.choice([True, False]) else any_material(random, 256)
    for layer in range(random.choice([1, 1, 2])):
        long = random.uniform(100, 400)
        for number in range(count):
            angle = tilt + 90 * layer
            along = spacing * (number - (count - 1) / 2) + random.gauss(0, spacing * disorder / 30)
            across = random.gauss(0, 0.04) * long
            cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
            place = along * cosine - across * sine, along * sine + across * cosine, z_mm + 2.0 * layer
            turned = 0.0, 0.0, angle + random.gauss(0, disorder)
            objects.add(f"narrow-{layer}-{number}", place, turned, shape_of(long), material)


def any_backdrop(random: Random, bright: list[float]) -> Table:
    """Black, dark, or of this colour."""
    (reflectance,) = random.choices([[0.02, 0.02, 0.02], [0.04, 0.04, 0.05], bright], weights=[2, 2, 1])
    return {"z_mm": 2500.0, "reflectance": reflectance}


def any_lights(random: Random, finishes: set[str]) -> list[Table]:
    """Even light from all around, mostly with a lamp: broad or small, a bulb, a spot, or one far away.

    Gloss and metals make rare and bright paths of the light of a small lamp, and glass does so of any lamp.
    So lamps are broad where `finishes` has gloss or metals, and there are none with glass.
    """
    even_light = draw.sky(round(draw.log_uniform(random, 20, 400), 1))
    kinds = ["area", "area", "none"]
    if "glass" in finishes:
        kinds = ["none"]
    elif not finishes:
        kinds += ["point", "spot", "directional"]
    kind = random.choice(kinds)
    place, target = (
        [round(random.uniform(*ends)) for ends in box]
        for box in (((-140, 140), (-430, -220), (0, 420)), ((-80, 80), (-60, 60), (480, 720)))
    )
    lux, square_m = draw.log_uniform(random, 100, 3000), math.dist(place, target) ** 2 / 1e6
    side, beam = draw.log_uniform(random, 300 if finishes else 40, 400), random.uniform(3, 25)
    if kind == "none":
        return [even_light]
    luminance = lux * square_m / (side * side / 1e6)
    values = {
        "area": {"width_mm": side, "height_mm": side, "luminance_cd_m2": luminance},
        "point": {"intensity_cd": lux * square_m},
        "spot": {"intensity_cd": lux * square_m, "beam_deg": beam, "cutoff_deg": 2 * beam},
        "directional": {"illuminance_lux": lux},
    }
    lamp: Table = {name: round(value, 3) for name, value in values[kind].items()}
    if kind == "directional":
        lamp["direction"] = [b - a for a, b in zip(place, target, strict=True)]
    else:
        lamp["position_mm"] = place
    if kind in ("area", "spot"):
        lamp["target_mm"] = target
    tint = random.choice(["D65", "D65", "A", "FL2"])
    return [even_light, {"type": kind, "illuminant": tint} | lamp]
