"""Further scenes that the network is trained on: rooms, heaps, fences, large plain things, slopes, gloss.

A scene names the planes that its things are at. These are 6 to 20 px of total disparity apart for ten
cameras in a row, 5 mm apart, with 50 mm of focal length and pixels of 0.0704 mm.
"""

import math
from collections.abc import Callable
from functools import partial
from itertools import accumulate
from random import Random

import simgen
from simgen.drawn.composition import box_of, card, colour, cylinder_of, placed, sphere
from simgen.drawn.kinds import glossy, plain
from training.mesh_shapes import FOLDER, blob, head, mesh_of, rod, spindle, tube
from training.scenes import Table, any_material, log_uniform

Material = Callable[[Random], Table]

TOTAL_PX_MM = 9 * 5 * 50 / 0.0704
"""Total disparity times depth."""
TOTAL_PX = 43.0, 71.0
"""Total disparities of the farthest and of the nearest plane: depths of 450 to 743 mm."""
GAP_PX = 6.0, 20.0
"""Total disparity between neighbouring planes."""
UPRIGHT = 0.0, 0.0, 0.0
HALF_FIELD = 0.36
"""Half of what a camera sees, by its depth."""


def furnished(random: Random) -> simgen.Scene:
    """A room: a back wall with pictures, mostly a floor and side walls, and things that stand or hang before
    it at two or three depths."""
    planes = plane_depths(random, random.choice([2, 2, 3]), nearest_gap_px=8)
    *planes, wall = planes if random.random() < 0.5 else [*planes, random.randint(planes[-1] + 40, 800)]
    floor = log_uniform(random, 60, 160)
    objects = [*walls(random, wall, floor), *pictures(random, wall, floor)]
    for number in range(random.randint(len(planes), 2 * len(planes) + 1)):
        z = planes[number % len(planes)]
        shape, behind, half_height = any_shape(random, log_uniform(random, 12, 60))
        x = random.uniform(-0.75, 0.75) * HALF_FIELD * z
        turned = 0.0, random.uniform(-50, 50), 0.0
        if stands := random.random() < 0.7:
            y = floor - half_height - 0.2
        else:
            y = random.uniform(-0.7 * HALF_FIELD * z, floor - 1.5 * half_height)
        name = f"{'standing' if stands else 'hanging'}-{number}"
        objects.append(placed(name, (x, y, z + behind), turned, shape, any_material(random)))
    named = [*planes, wall] if random.random() < 0.5 else planes
    return composed(random, "A furnished room", objects, named)


def heap(random: Random) -> simgen.Scene:
    """Many things of one kind, of one to three materials, over and under one another."""
    planes = plane_depths(random, random.choice([1, 2, 2, 3]))
    materials = [one_of(random, plain, any_material)(random) for _ in range(random.choice([1, 1, 1, 2, 3]))]
    size, spread = log_uniform(random, 7, 40), log_uniform(random, 30, 90)
    size_spread, depth_spread = random.uniform(0, 0.3), log_uniform(random, 0.5, 8)
    kind = random.choice(["ball", "box", "rod", "card"])
    turn = random.choice([5.0, 45.0])
    objects = []
    for number in range(round(log_uniform(random, 8, 70))):
        shape, behind, _ = any_shape(random, size * math.exp(random.gauss(0, size_spread)), kind)
        z = random.choice(planes) + behind + random.gauss(0, depth_spread)
        place = random.gauss(0, spread), random.gauss(0, 0.8 * spread), z
        turned = random.uniform(-turn, turn), random.uniform(-turn, turn), random.uniform(-180, 180)
        material = nearly_alike(random, random.choice(materials))
        objects.append(placed(f"{kind}-{number}", place, turned, shape, material))
    objects += anything_behind(random, planes[-1])
    return composed(random, "A heap", objects, planes)


def pickets(random: Random) -> simgen.Scene:
    """Pickets, rods, a grid or wires, 3 to 25 px wide, before one to three things or a wall."""
    near, *others = plane_depths(random, random.choice([2, 2, 3]))
    objects = narrow_things(random, near)
    material = one_of(random, plain, any_material)
    if random.random() < 0.3:
        wall = card(1000, 1000)
        objects.append(placed("wall", (0.0, 0.0, others[-1]), UPRIGHT, wall, material(random)))
        others = others[:-1] or others
    for number in range(random.randint(1, 3)):
        z = random.choice(others)
        shape, behind, _ = any_shape(random, log_uniform(random, 25, 90))
        place = random.uniform(-100, 100), random.uniform(-80, 80), z + behind - 1.0
        objects.append(placed(f"thing-{number}", place, any_turn(random), shape, material(random)))
    objects += anything_behind(random, max(others))
    return composed(random, "Narrow things", objects, [near, *others])


def plain_pair(random: Random) -> simgen.Scene:
    """Two or three large things of one colour each before the dark, or before what is plain as well."""
    planes = plane_depths(random, random.choice([2, 2, 3]))
    apart, objects = log_uniform(random, 50, 130), []
    for number, z in enumerate(random.sample(planes, len(planes))):
        shape, behind, _ = any_shape(random, log_uniform(random, 38, 95))
        x = apart * (number - (len(planes) - 1) / 2) + random.uniform(-15, 15)
        place = x, random.uniform(-40, 40), z + behind
        objects.append(placed(f"plain-{number}", place, any_turn(random), shape, plain(random)))
    if random.random() < 0.3:
        objects.append(wall_at(random, random.uniform(planes[-1] + 60, 850), plain))
    return composed(random, "Large plain things", objects, planes)


def leaning(random: Random) -> simgen.Scene:
    """Cards, books and floors that lean through depth, some with things that do not among them."""
    planes = plane_depths(random, random.choice([1, 2, 3]))
    objects = []
    for number in range(random.randint(1, 4)):
        long, broad = log_uniform(random, 80, 400), log_uniform(random, 40, 200)
        angle = random.choice([-1, 1]) * random.uniform(25, 75)
        # The long side leans: about the level axis, or about the upright one.
        size, turned = random.choice(
            [((broad, long), (angle, 0.0, 0.0)), ((long, broad), (0.0, angle, 0.0))],
        )
        turned = *turned[:2], random.choice([0.0, random.uniform(-30, 30)])
        place = random.uniform(-90, 90), random.uniform(-80, 80), random.choice(planes)
        shape = random.choice([card(*size), box_of(*size, log_uniform(random, 3, 30))])
        objects.append(placed(f"leaning-{number}", place, turned, shape, any_material(random)))
    for number in range(random.randint(0, 3)):
        z = random.choice(planes)
        shape, behind, _ = any_shape(random, log_uniform(random, 12, 50))
        place = random.uniform(-110, 110), random.uniform(-90, 90), z + behind
        objects.append(placed(f"thing-{number}", place, any_turn(random), shape, any_material(random)))
    if random.random() < 0.4:
        place = 0.0, random.uniform(90, 160), random.uniform(560, 640)
        turned = random.uniform(-90, -70), random.uniform(-15, 15), 0.0
        objects.append(placed("floor", place, turned, card(900, 420), large_material(random)))
    objects += anything_behind(random, 760)
    return composed(random, "Leaning things", objects, planes)


def glazed(random: Random) -> simgen.Scene:
    """Things of glass, metal and shiny plastic, and some that are matt, before a wall or in a room."""
    planes = plane_depths(random, random.choice([2, 3]))
    wall, has_glass = random.uniform(planes[-1] + 50, 850), random.random() < 0.5
    objects = [wall_at(random, wall, large_material)]
    if not has_glass and random.random() < 0.5:
        objects = walls(random, wall, random.uniform(90, 160))
    for number in range(random.randint(2, 6)):
        z = planes[number % len(planes)]
        shape, behind, _ = any_shape(random, log_uniform(random, 15, 65))
        place = random.uniform(-110, 110), random.uniform(-80, 70), z + behind
        material = one_of(random, glossy, glossy, any_material)(random)
        if has_glass and number < 2:
            material = {"finish": {"type": "glass", "refractive_index": round(random.uniform(1.3, 1.8), 2)}}
        objects.append(placed(f"glazed-{number}", place, any_turn(random), shape, material))
    return composed(random, "Glass and gloss", objects, planes)


def meshes(random: Random) -> simgen.Scene:
    """Two to six curved shapes: blobs, heads, rings, knots, springs, cones, capsules and vases."""
    planes = plane_depths(random, random.choice([2, 2, 3, 4]))
    objects = []
    for number in range(random.randint(2, 6)):
        make, z = random.choice([blob, head, tube, tube, spindle]), planes[number % len(planes)]
        size = log_uniform(random, 18, 85)
        place = random.uniform(-100, 100), random.uniform(-80, 80), z + (0.0 if make is tube else 0.6 * size)
        turn = 40.0 if make is head else random.choice([25.0, 180.0])
        rotation = random.uniform(-turn, turn) / 2, random.uniform(-turn, turn), random.uniform(-turn, turn)
        material = one_of(random, plain, any_material, any_material, glossy)(random)
        name, shape = f"{make.__name__}-{number}", mesh_of(make(random), size)
        objects.append(placed(name, place, rotation, shape, material))
    objects += anything_behind(random, planes[-1])
    return composed(random, "Curved things", objects, planes)


def empty_wall(random: Random) -> simgen.Scene:
    """A bare or patterned wall by itself, upright or a little turned; the named planes are away from it."""
    wall = random.uniform(440, 760)
    turned = random.choice([UPRIGHT, (random.uniform(-8, 8), random.uniform(-12, 12), 0.0)])
    material = one_of(random, plain, large_material)(random)
    objects = [placed("wall", (0.0, 0.0, wall), turned, card(1200, 1200), material)]
    away = [plane for plane in range(440, 761) if abs(TOTAL_PX_MM / plane - TOTAL_PX_MM / wall) > 13]
    planes = [random.choice(away)]
    return composed(random, "An empty wall", objects, planes)


def plane_depths(random: Random, count: int, nearest_gap_px: float = GAP_PX[0]) -> list[int]:
    """Depths of `count` planes in mm, the nearest first, from hardly to well apart."""
    far, near = TOTAL_PX
    while True:
        gaps = [log_uniform(random, nearest_gap_px, GAP_PX[1]) for _ in range(count - 1)]
        if sum(gaps) <= near - far:
            break
    totals = accumulate(gaps, initial=random.uniform(far, near - sum(gaps)))
    return sorted(round(TOTAL_PX_MM / total) for total in totals)


def any_shape(random: Random, size_mm: float, kind: str | None = None) -> tuple[Table, float, float]:
    """A shape about as large as a ball of this radius, how far its middle is behind what is seen of it, and
    half of its height."""
    r, stretch = size_mm, math.exp(random.gauss(0, 0.35))
    match kind or random.choice(["ball", "ball", "box", "box", "tin", "tin", "card"]):
        case "ball":
            return sphere(r), 0.7 * r, r
        case "box":
            depth = 2 * r * log_uniform(random, 0.2, 1)
            return box_of(1.8 * r * stretch, 1.8 * r / stretch, depth), depth / 2, 0.9 * r / stretch
        case "tin":
            return cylinder_of(0.8 * r / stretch, 2 * r * stretch), 0.65 * r / stretch, r * stretch
        case "rod":  # a tin of which a scene can have many
            radius = 0.8 * r / stretch
            return mesh_of(rod(), radius, r * stretch, radius), 0.8 * radius, r * stretch
        case _:
            return card(2 * r * stretch, 2 * r / stretch), 0.0, r / stretch


def any_turn(random: Random) -> tuple[float, float, float]:
    """A turn that still shows the front."""
    return random.uniform(-25, 25), random.uniform(-40, 40), random.uniform(-40, 40)


def one_of(random: Random, *materials: Material) -> Material:
    """One of these kinds of materials."""
    return random.choice(materials)


def nearly_alike(random: Random, material: Table) -> Table:
    """The same material; of one colour a little lighter or darker."""
    light = random.uniform(0.9, 1.1)
    if "reflectance" not in material:
        return material
    return material | {"reflectance": [round(min(1.0, light * part), 3) for part in material["reflectance"]]}


def large_material(random: Random) -> Table:
    """What walls and floors are of: one colour, shades that change slowly, or patterns."""
    if random.random() < 0.35:
        return plain(random)
    if random.random() < 0.6:
        return any_material(random, 1024)
    shades = {
        "type": "noise",
        "exponent": round(random.uniform(1.6, 2.4), 2),
        "contrast": round(random.uniform(0.1, 0.3), 2),
        "colour": colour(random, 0.3, 0.65),
        "seed": random.randrange(100_000),
    }
    return {"texture": shades | {"pixels": 512}}


def wall_at(random: Random, z_mm: float, material: Material) -> Table:
    """A wall that fills the film."""
    return placed("wall", (0.0, 0.0, z_mm), UPRIGHT, card(1200, 1200), material(random))


def walls(random: Random, wall_mm: float, floor_mm: float) -> list[Table]:
    """A back wall, mostly a floor and often a side wall or two."""
    objects = [wall_at(random, wall_mm, large_material)]
    middle, long = (wall_mm + 400) / 2, wall_mm - 400
    if random.random() < 0.8:
        place, shape = (0.0, floor_mm + 200, middle), box_of(1200, 400, long)
        objects.append(placed("floor", place, UPRIGHT, shape, large_material(random)))
    for name, side in (("left", -1), ("right", 1)):
        if random.random() < 0.5:
            place = side * random.uniform(150, 270), 0.0, middle
            turned = 0.0, 90.0, 0.0
            objects.append(placed(f"{name}-wall", place, turned, card(long, 1000), large_material(random)))
    return objects


def pictures(random: Random, wall_mm: float, floor_mm: float) -> list[Table]:
    """Up to four pictures on the back wall, some of them in a frame, some of a few patches."""
    objects = []
    for number in range(random.choice([0, 1, 1, 2, 3, 4])):
        width, height = log_uniform(random, 30, 250), log_uniform(random, 30, 180)
        reach = HALF_FIELD * wall_mm
        x, y = random.uniform(-0.8, 0.8) * reach, random.uniform(-0.8 * reach, min(floor_mm, reach) - 20)
        turned = 0.0, 0.0, random.choice([0.0, random.uniform(-8, 8)])
        if random.random() < 0.5:
            frame = box_of(1.12 * width, 1.12 * height, 3)
            objects.append(placed(f"frame-{number}", (x, y, wall_mm - 1.6), turned, frame, plain(random)))
        picture = card(width, height), any_material(random)
        objects.append(placed(f"picture-{number}", (x, y, wall_mm - 3.3), turned, *picture))
        for patch in range(random.choice([0, 0, 3])):
            place = x + random.uniform(-0.3, 0.3) * width, y + random.uniform(-0.3, 0.3) * height
            shape = card(random.uniform(0.1, 0.4) * width, random.uniform(0.1, 0.4) * height)
            name, z = f"picture-{number}-{patch}", wall_mm - 3.6 - 0.3 * patch
            objects.append(placed(name, (*place, z), turned, shape, any_material(random, 128)))
    return objects


def narrow_things(random: Random, z_mm: float) -> list[Table]:
    """Pickets, rods or wires beside each other, or two layers of them across each other, of one material."""
    width = log_uniform(random, 2.4, 20)
    shape_of = random.choice(
        [
            lambda long: card(width, long),
            lambda long: box_of(width, long, log_uniform(random, 1, 12)),
            lambda long: mesh_of(rod(), width / 2, long / 2, width / 2),
        ]
    )
    spacing, tilt, long = width * log_uniform(random, 1.5, 6), random.uniform(-90, 90), 1.0
    count, disorder = max(3, min(24, round(320 / spacing))), random.choice([0.0, 1.0, 12.0])
    material, objects = one_of(random, plain, partial(any_material, pixels=256))(random), []
    for layer in range(random.choice([1, 1, 2])):
        long = random.uniform(100, 400)
        for number in range(count):
            angle = tilt + 90 * layer
            along = spacing * (number - (count - 1) / 2) + random.gauss(0, spacing * disorder / 30)
            across = random.gauss(0, 0.04) * long
            cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
            place = along * cosine - across * sine, along * sine + across * cosine, z_mm + 2.0 * layer
            turned = 0.0, 0.0, angle + random.gauss(0, disorder)
            objects.append(placed(f"narrow-{layer}-{number}", place, turned, shape_of(long), material))
    return objects


def anything_behind(random: Random, farthest_mm: float) -> list[Table]:
    """As often as not, a wall behind all."""
    if random.random() < 0.5:
        return []
    wall = random.uniform(farthest_mm + 40, 880)
    return [placed("backwall", (0.0, 0.0, wall), UPRIGHT, card(1200, 1200), large_material(random))]


def any_lights(random: Random, finishes: set[str]) -> list[Table]:
    """Even light from all around, mostly with a lamp: broad or small, a bulb, a spot, or one far away.

    Gloss and metals make rare and bright paths of the light of a small lamp, and glass does so of any lamp.
    So lamps are broad where `finishes` has gloss or metals, and there are none with glass.
    """
    sky = {"type": "uniform", "luminance_cd_m2": round(log_uniform(random, 20, 400), 1)}
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
    lux, square_m = log_uniform(random, 100, 3000), math.dist(place, target) ** 2 / 1e6
    side, beam = log_uniform(random, 300 if finishes else 40, 400), random.uniform(3, 25)
    values: dict[str, Table] = {
        "area": {
            "width_mm": side,
            "height_mm": side,
            "luminance_cd_m2": lux * square_m / (side * side / 1e6),
        },
        "point": {"intensity_cd": lux * square_m},
        "spot": {"intensity_cd": lux * square_m, "beam_deg": beam, "cutoff_deg": 2 * beam},
        "directional": {"illuminance_lux": lux},
    }
    if kind == "none":
        return [sky]
    lamp = {name: round(value, 3) for name, value in values[kind].items()}
    if kind == "directional":
        lamp["direction"] = [b - a for a, b in zip(place, target, strict=True)]
    else:
        lamp["position_mm"] = place
    if kind in ("area", "spot"):
        lamp["target_mm"] = target
    tint = random.choice(["D65", "D65", "A", "FL2"])
    return [sky, {"type": kind, "illuminant": tint} | lamp]


def composed(random: Random, title: str, objects: list[Table], planes: list[int]) -> simgen.Scene:
    """The scene of these objects in any light and before any backdrop."""
    finishes = {thing["material"]["finish"]["type"] for thing in objects if "finish" in thing["material"]}
    dark = [[0.02, 0.02, 0.02], [0.04, 0.04, 0.05], colour(random, 0.1, 0.6)]
    values = {
        "title": title,
        "planes_mm": [float(plane) for plane in planes],
        "objects": objects,
        "lights": any_lights(random, finishes),
        "backdrop": {"z_mm": 2500.0, "reflectance": random.choices(dark, weights=[2, 2, 1])[0]},
    }
    return simgen.load_scene(values, folder=FOLDER)
