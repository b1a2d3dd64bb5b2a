"""Ten kinds of scenes that networks are trained on: rooms, heaps, bars, large plain things, slopes, gloss.

They are for training alone: no test and no benchmark of methods has scenes of them, and what is judged on is
of the kinds in `kinds`. A scene names the planes that its things are at. But for `assorted` and `screens`
these are 6 to 20 px of total disparity apart for ten cameras in a row, 5 mm apart, with 50 mm of focal length
and pixels of 0.0704 mm.
"""

import math
from functools import partial
from itertools import accumulate
from random import Random

from simgen.drawn import kinds as draw
from simgen.drawn import training_parts as parts
from simgen.drawn.kinds import UPRIGHT, Objects, Table, Triple
from simgen.spec import Scene

TOTAL_PX_MM = 9 * 5 * 50 / 0.0704
"""Total disparity times depth."""
TOTAL_PX = 43.0, 71.0
"""Total disparities of the farthest and of the nearest plane: depths of 450 to 743 mm."""
GAP_PX = 6.0, 20.0
"""Total disparity between neighbouring planes."""


def assorted(random: Random) -> Scene:
    """Up to a dozen things, plain, patterned or shiny, over and under one another at any depth from 440 to
    700 mm, before a backdrop that is dark, plain or patterned, or a floor."""
    near = random.randint(455, 520)
    middle = near + random.randint(50, 90)
    far = middle + random.randint(50, 100)
    objects = Objects()

    def add(kind: str, sizes_mm: list[tuple[float, float]], behind_mm: float, turn_deg: Triple) -> None:
        """A thing whose sizes are between these, its middle so far behind a plane."""
        z = random.choice([near, middle, far]) + behind_mm
        if kind == "card":
            z = random.uniform(450, 700)
        place = random.uniform(-110, 110), random.uniform(-100, 100), z
        a, b, c = (random.uniform(-angle, angle) for angle in turn_deg)
        make = {"ball": draw.sphere, "box": draw.box_of, "tin": draw.cylinder_of, "card": draw.card}[kind]
        shape = make(*(draw.log_uniform(random, *ends) for ends in sizes_mm))
        count = sum(thing["name"].startswith(kind) for thing in objects)
        objects.add(f"{kind}-{count}", place, (a, b, c), shape, parts.any_material(random))

    for _ in range(random.randint(0, 3)):
        add("ball", [(10, 65)], 30, (180, 180, 180))
    for _ in range(random.randint(0, 3)):
        add("box", [(15, 120), (15, 120), (10, 60)], 25, (40, 50, 60))
    for _ in range(random.randint(0, 2)):
        add("tin", [(6, 40), (30, 180)], 20, (60, 60, 90))
    for _ in range(random.choices([0, 1, 2, 6, 14], weights=[2, 2, 2, 1, 1])[0]):
        add("card", [(15, 160), (10, 110)], 0, (35, 35, 180))
    if random.random() < 0.5:  # a wall or a floor within reach
        turned = random.choice([UPRIGHT, (random.uniform(-10, 10), random.uniform(-30, 30), 0.0)])
        turned = random.choice([turned, (random.uniform(40, 65), random.uniform(-10, 10), 0.0)])
        place = 0.0, 60.0, random.uniform(690, 780)
        objects.add("ground", place, turned, draw.card(900, 900), parts.any_material(random, 2048))
    luminances = [draw.log_uniform(random, 500, 4000), draw.log_uniform(random, 40, 400)]
    return _under_a_lamp(random, "Assorted things", objects, [near, middle, far], luminances)


def screens(random: Random) -> Scene:
    """Upright bars of one material, from few and broad to many and narrow, before one or two things and
    sometimes a wall: from every camera another part of what is behind is hidden."""
    near = random.randint(450, 510)
    far = near + random.randint(60, 150)
    width, tilt, material = (
        draw.log_uniform(random, 3, 16),
        random.uniform(-90, 90),
        parts.any_material(random, 256),
    )
    objects = Objects()
    for number in range(random.choice([3, 6, 10])):
        place = random.uniform(-110, 110), random.uniform(-30, 30), near + random.gauss(0, 2)
        shape = draw.card(width, random.uniform(120, 260))
        objects.add(f"bar-{number}", place, (0.0, 0.0, tilt + random.gauss(0, 6)), shape, material)
    for number in range(random.randint(1, 2)):
        ball = draw.sphere(random.uniform(30, 72))
        tin = draw.cylinder_of(random.uniform(25, 54), random.uniform(70, 150))
        box = draw.box_of(random.uniform(60, 180), random.uniform(60, 160), random.uniform(4, 60))
        shape = random.choice([ball, tin, box])
        place = random.uniform(-60, 60), random.uniform(-50, 50), far + 25.0
        turned = random.uniform(-20, 20), random.uniform(-40, 40), random.uniform(-30, 30)
        objects.add(f"thing-{number}", place, turned, shape, parts.any_material(random))
    if random.random() < 1 / 3:
        material = partial(parts.any_material, pixels=2048)
        parts.add_wall(random, objects, random.uniform(690, 780), material, side_mm=900)
    luminances = [2000, draw.log_uniform(random, 60, 300)]
    return _under_a_lamp(random, "Things behind bars", objects, [near, far], luminances)


def furnished(random: Random) -> Scene:
    """A room: a back wall with pictures, mostly a floor and side walls, and things that stand or hang before
    it at two or three depths."""
    planes = plane_depths(random, random.choice([2, 2, 3]), nearest_gap_px=8)
    *planes, wall = planes if random.random() < 0.5 else [*planes, random.randint(planes[-1] + 40, 800)]
    floor = draw.log_uniform(random, 60, 160)
    objects = Objects()
    parts.add_room(random, objects, wall, floor)
    _add_pictures(random, objects, wall, floor)
    for number in range(random.randint(len(planes), 2 * len(planes) + 1)):
        z = planes[number % len(planes)]
        shape, behind, half_height = parts.any_shape(random, draw.log_uniform(random, 12, 60))
        x = random.uniform(-0.75, 0.75) * parts.HALF_FIELD * z
        turned = 0.0, random.uniform(-50, 50), 0.0
        if stands := random.random() < 0.7:
            y = floor - half_height - 0.2
        else:
            y = random.uniform(-0.7 * parts.HALF_FIELD * z, floor - 1.5 * half_height)
        name = f"{'standing' if stands else 'hanging'}-{number}"
        objects.add(name, (x, y, z + behind), turned, shape, parts.any_material(random))
    named = [*planes, wall] if random.random() < 0.5 else planes
    return _in_any_light(random, "A furnished room", objects, named)


def heap(random: Random) -> Scene:
    """Many things of one kind, of one to three materials, over and under one another."""
    planes = plane_depths(random, random.choice([1, 2, 2, 3]))
    materials = [
        random.choice([draw.plain, parts.any_material])(random) for _ in range(random.choice([1, 1, 1, 2, 3]))
    ]
    size, spread = draw.log_uniform(random, 7, 40), draw.log_uniform(random, 30, 90)
    size_spread, depth_spread = random.uniform(0, 0.3), draw.log_uniform(random, 0.5, 8)
    kind = random.choice(["ball", "box", "rod", "card"])
    turn = random.choice([5.0, 45.0])
    objects = Objects()
    for number in range(round(draw.log_uniform(random, 8, 70))):
        shape, behind, _ = parts.any_shape(random, size * math.exp(random.gauss(0, size_spread)), kind)
        z = random.choice(planes) + behind + random.gauss(0, depth_spread)
        place = random.gauss(0, spread), random.gauss(0, 0.8 * spread), z
        turned = random.uniform(-turn, turn), random.uniform(-turn, turn), random.uniform(-180, 180)
        material = _nearly_alike(random, random.choice(materials))
        objects.add(f"{kind}-{number}", place, turned, shape, material)
    parts.add_backwall(random, objects, planes[-1])
    return _in_any_light(random, "A heap", objects, planes)


def pickets(random: Random) -> Scene:
    """Pickets, rods, a grid or wires, 3 to 25 px wide, before one to three things or a wall."""
    near, *others = plane_depths(random, random.choice([2, 2, 3]))
    objects = Objects()
    _add_narrow_things(random, objects, near)
    material = random.choice([draw.plain, parts.any_material])
    if random.random() < 0.3:
        parts.add_wall(random, objects, others[-1], material, side_mm=1000)
        others = others[:-1] or others
    for number in range(random.randint(1, 3)):
        z = random.choice(others)
        shape, behind, _ = parts.any_shape(random, draw.log_uniform(random, 25, 90))
        place = random.uniform(-100, 100), random.uniform(-80, 80), z + behind - 1.0
        objects.add(f"thing-{number}", place, parts.any_turn(random), shape, material(random))
    parts.add_backwall(random, objects, max(others))
    return _in_any_light(random, "Narrow things", objects, [near, *others])


def plain_pair(random: Random) -> Scene:
    """Two or three large things of one colour each before the dark, or before what is plain as well."""
    planes = plane_depths(random, random.choice([2, 2, 3]))
    apart, objects = draw.log_uniform(random, 50, 130), Objects()
    for number, z in enumerate(random.sample(planes, len(planes))):
        shape, behind, _ = parts.any_shape(random, draw.log_uniform(random, 38, 95))
        x = apart * (number - (len(planes) - 1) / 2) + random.uniform(-15, 15)
        place = x, random.uniform(-40, 40), z + behind
        objects.add(f"plain-{number}", place, parts.any_turn(random), shape, draw.plain(random))
    if random.random() < 0.3:
        parts.add_wall(random, objects, random.uniform(planes[-1] + 60, 850), draw.plain)
    return _in_any_light(random, "Large plain things", objects, planes)


def leaning(random: Random) -> Scene:
    """Cards, books and floors that lean through depth, some with things that do not among them."""
    planes = plane_depths(random, random.choice([1, 2, 3]))
    objects = Objects()
    for number in range(random.randint(1, 4)):
        long, broad = draw.log_uniform(random, 80, 400), draw.log_uniform(random, 40, 200)
        angle = random.choice([-1, 1]) * random.uniform(25, 75)
        # The long side leans: about the level axis, or about the upright one.
        about_level, about_upright = ((broad, long), (angle, 0.0)), ((long, broad), (0.0, angle))
        size, turned = random.choice([about_level, about_upright])
        turned = *turned, random.choice([0.0, random.uniform(-30, 30)])
        place = random.uniform(-90, 90), random.uniform(-80, 80), random.choice(planes)
        shape = random.choice([draw.card(*size), draw.box_of(*size, draw.log_uniform(random, 3, 30))])
        objects.add(f"leaning-{number}", place, turned, shape, parts.any_material(random))
    for number in range(random.randint(0, 3)):
        z = random.choice(planes)
        shape, behind, _ = parts.any_shape(random, draw.log_uniform(random, 12, 50))
        place = random.uniform(-110, 110), random.uniform(-90, 90), z + behind
        objects.add(f"thing-{number}", place, parts.any_turn(random), shape, parts.any_material(random))
    if random.random() < 0.4:
        place = 0.0, random.uniform(90, 160), random.uniform(560, 640)
        turned = random.uniform(-90, -70), random.uniform(-15, 15), 0.0
        objects.add("floor", place, turned, draw.card(900, 420), parts.large_material(random))
    parts.add_backwall(random, objects, 760)
    return _in_any_light(random, "Leaning things", objects, planes)


def glazed(random: Random) -> Scene:
    """Things of glass, metal and shiny plastic, and some that are matt, before a wall or in a room."""
    planes = plane_depths(random, random.choice([2, 3]))
    wall, has_glass = random.uniform(planes[-1] + 50, 850), random.random() < 0.5
    objects = Objects()
    parts.add_wall(random, objects, wall, parts.large_material)
    if not has_glass and random.random() < 0.5:
        objects.clear()
        parts.add_room(random, objects, wall, random.uniform(90, 160))
    for number in range(random.randint(2, 6)):
        z = planes[number % len(planes)]
        shape, behind, _ = parts.any_shape(random, draw.log_uniform(random, 15, 65))
        place = random.uniform(-110, 110), random.uniform(-80, 70), z + behind
        material = random.choice([draw.glossy, draw.glossy, parts.any_material])(random)
        if has_glass and number < 2:
            material = {"finish": {"type": "glass", "refractive_index": round(random.uniform(1.3, 1.8), 2)}}
        objects.add(f"glazed-{number}", place, parts.any_turn(random), shape, material)
    return _in_any_light(random, "Glass and gloss", objects, planes)


def meshes(random: Random) -> Scene:
    """Two to six curved shapes: blobs, heads, rings, knots, springs, cones, capsules and vases."""
    planes = plane_depths(random, random.choice([2, 2, 3, 4]))
    objects = Objects()
    for number in range(random.randint(2, 6)):
        make = random.choice(parts.CURVED)
        size = draw.log_uniform(random, 18, 85)
        kind, z = make.__name__, planes[number % len(planes)]
        behind = 0.0 if kind == "tube" else 0.6 * size
        place = random.uniform(-100, 100), random.uniform(-80, 80), z + behind
        turn = 40.0 if kind == "head" else random.choice([25.0, 180.0])
        rotation = random.uniform(-turn, turn) / 2, random.uniform(-turn, turn), random.uniform(-turn, turn)
        material = random.choice([draw.plain, parts.any_material, parts.any_material, draw.glossy])(random)
        objects.add(f"{kind}-{number}", place, rotation, parts.mesh_of(make(random), size), material)
    parts.add_backwall(random, objects, planes[-1])
    return _in_any_light(random, "Curved things", objects, planes)


def empty_wall(random: Random) -> Scene:
    """A bare or patterned wall by itself, upright or a little turned; the named planes are away from it."""
    wall = random.uniform(440, 760)
    turned = random.choice([UPRIGHT, (random.uniform(-8, 8), random.uniform(-12, 12), 0.0)])
    material = random.choice([draw.plain, parts.large_material])(random)
    objects = Objects()
    objects.add("wall", (0.0, 0.0, wall), turned, draw.card(1200, 1200), material)
    away = [plane for plane in range(440, 761) if abs(TOTAL_PX_MM / plane - TOTAL_PX_MM / wall) > 13]
    return _in_any_light(random, "An empty wall", objects, [random.choice(away)])


def _add_pictures(random: Random, objects: Objects, wall_mm: float, floor_mm: float) -> None:
    """Add up to four pictures on the back wall, some of them in a frame, some of a few patches."""
    for number in range(random.choice([0, 1, 1, 2, 3, 4])):
        width, height = draw.log_uniform(random, 30, 250), draw.log_uniform(random, 30, 180)
        reach = parts.HALF_FIELD * wall_mm
        x, y = random.uniform(-0.8, 0.8) * reach, random.uniform(-0.8 * reach, min(floor_mm, reach) - 20)
        turned = 0.0, 0.0, random.choice([0.0, random.uniform(-8, 8)])
        if random.random() < 0.5:
            frame = draw.box_of(1.12 * width, 1.12 * height, 3)
            objects.add(f"frame-{number}", (x, y, wall_mm - 1.6), turned, frame, draw.plain(random))
        place, shape = (x, y, wall_mm - 3.3), draw.card(width, height)
        objects.add(f"picture-{number}", place, turned, shape, parts.any_material(random))
        for patch in range(random.choice([0, 0, 3])):
            place = x + random.uniform(-0.3, 0.3) * width, y + random.uniform(-0.3, 0.3) * height
            shape = draw.card(random.uniform(0.1, 0.4) * width, random.uniform(0.1, 0.4) * height)
            name, z = f"picture-{number}-{patch}", wall_mm - 3.6 - 0.3 * patch
            objects.add(name, (*place, z), turned, shape, parts.any_material(random, 128))


def _add_narrow_things(random: Random, objects: Objects, z_mm: float) -> None:
    """Add pickets, rods or wires beside each other, of one material, or two layers of them that cross."""
    width = draw.log_uniform(random, 2.4, 20)
    shape_of = random.choice(
        [
            lambda long: draw.card(width, long),
            lambda long: draw.box_of(width, long, draw.log_uniform(random, 1, 12)),
            lambda long: parts.mesh_of(parts.rod(), width / 2, long / 2, width / 2),
        ]
    )
    spacing, tilt = width * draw.log_uniform(random, 1.5, 6), random.uniform(-90, 90)
    count, disorder = max(3, min(24, round(320 / spacing))), random.choice([0.0, 1.0, 12.0])
    material = draw.plain(random) if random.choice([True, False]) else parts.any_material(random, 256)
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


def _nearly_alike(random: Random, material: Table) -> Table:
    """The same material; of one colour a little lighter or darker."""
    light = random.uniform(0.9, 1.1)
    if "reflectance" not in material:
        return material
    return material | {"reflectance": [round(min(1.0, light * part), 3) for part in material["reflectance"]]}


def plane_depths(random: Random, count: int, nearest_gap_px: float = GAP_PX[0]) -> list[int]:
    """Depths of `count` planes in mm, the nearest first, from hardly to well apart."""
    far, near = TOTAL_PX
    while True:
        gaps = [draw.log_uniform(random, nearest_gap_px, GAP_PX[1]) for _ in range(count - 1)]
        if sum(gaps) <= near - far:
            break
    totals = accumulate(gaps, initial=random.uniform(far, near - sum(gaps)))
    return sorted(round(TOTAL_PX_MM / total) for total in totals)


def _under_a_lamp(
    random: Random, title: str, objects: Objects, planes_mm: list[int], luminances_cd_m2: list[float]
) -> Scene:
    """The scene of these objects, with the luminances of a lamp and of the sky."""
    x, z = round(random.uniform(-300, 300)), round(random.uniform(100, 400))
    lamp, around = (round(value, 1) for value in luminances_cd_m2)
    lights = [draw.lamp_above(x, z, lamp), draw.sky(around)]
    backdrop = _any_backdrop(random, draw.colour(random, 0.1, 0.6))
    return draw.composed(title, objects, planes_mm, lights, backdrop)


def _in_any_light(random: Random, title: str, objects: Objects, planes_mm: list[int]) -> Scene:
    finishes = {thing["material"]["finish"]["type"] for thing in objects if "finish" in thing["material"]}
    bright = draw.colour(random, 0.1, 0.6)
    lights = _any_lights(random, finishes)
    backdrop = _any_backdrop(random, bright)
    return draw.composed(title, objects, planes_mm, lights, backdrop, parts.mesh_folder())


def _any_backdrop(random: Random, bright: list[float]) -> Table:
    """Black, dark, or of this colour."""
    (reflectance,) = random.choices([[0.02, 0.02, 0.02], [0.04, 0.04, 0.05], bright], weights=[2, 2, 1])
    return {"z_mm": 2500.0, "reflectance": reflectance}


def _any_lights(random: Random, finishes: set[str]) -> list[Table]:
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
