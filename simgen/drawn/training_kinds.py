"""Ten kinds of scenes that networks are trained on: rooms, heaps, bars, large plain things, slopes, gloss.

They are for training alone: no benchmark of methods has scenes of them. A scene names the planes that its
things are at. But for `assorted` and `screens` these are 6 to 20 px of total disparity apart for ten cameras
in a row, 5 mm apart, with 50 mm of focal length and pixels of 0.0704 mm.
"""

import math
from collections.abc import Sequence
from itertools import accumulate
from random import Random

from simgen.drawn import parts
from simgen.drawn.parts import UPRIGHT, Material, Objects, Table, Triple, colour, log_uniform, shape_of
from simgen.spec import Scene

TOTAL_PX_MM = 9 * 5 * 50 / 0.0704
"""Total disparity times depth."""
TOTAL_PX = 43.0, 71.0
"""Total disparities of the farthest and of the nearest plane: depths of 450 to 743 mm."""
GAP_PX = 6.0, 20.0
"""Total disparity between neighbouring planes."""
HALF_FIELD = 0.36
"""Half of what a camera sees, by its depth."""


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
        shape = shape_of(kind, *(log_uniform(random, *ends) for ends in sizes_mm))
        name = {"sphere": "ball", "cylinder": "tin"}.get(kind, kind)
        count = sum(thing["name"].startswith(name) for thing in objects)
        objects.add(f"{name}-{count}", place, (a, b, c), shape, _any_material(random))

    for _ in range(random.randint(0, 3)):
        add("sphere", [(10, 65)], 30, (180, 180, 180))
    for _ in range(random.randint(0, 3)):
        add("box", [(15, 120), (15, 120), (10, 60)], 25, (40, 50, 60))
    for _ in range(random.randint(0, 2)):
        add("cylinder", [(6, 40), (30, 180)], 20, (60, 60, 90))
    for _ in range(random.choices([0, 1, 2, 6, 14], weights=[2, 2, 2, 1, 1])[0]):
        add("card", [(15, 160), (10, 110)], 0, (35, 35, 180))
    if random.random() < 0.5:  # a wall or a floor within reach
        turned = random.choice([UPRIGHT, (random.uniform(-10, 10), random.uniform(-30, 30), 0.0)])
        turned = random.choice([turned, (random.uniform(40, 65), random.uniform(-10, 10), 0.0)])
        place = 0.0, 60.0, random.uniform(690, 780)
        objects.add("ground", place, turned, shape_of("card", 900, 900), _any_material(random, 2048))
    luminances = [log_uniform(random, 500, 4000), log_uniform(random, 40, 400)]
    return _illuminate(random, "Assorted things", objects, [near, middle, far], luminances)


def screens(random: Random) -> Scene:
    """Upright bars of one material, from few and broad to many and narrow, before one or two things and
    sometimes a wall: from every camera another part of what is behind is hidden."""
    near = random.randint(450, 510)
    far = near + random.randint(60, 150)
    width, tilt = log_uniform(random, 3, 16), random.uniform(-90, 90)
    material = _any_material(random, 256)
    objects = Objects()
    for number in range(random.choice([3, 6, 10])):
        place = random.uniform(-110, 110), random.uniform(-30, 30), near + random.gauss(0, 2)
        shape = shape_of("card", width, random.uniform(120, 260))
        objects.add(f"bar-{number}", place, (0.0, 0.0, tilt + random.gauss(0, 6)), shape, material)
    for number in range(random.randint(1, 2)):
        ball = shape_of("sphere", random.uniform(30, 72))
        tin = shape_of("cylinder", random.uniform(25, 54), random.uniform(70, 150))
        box = shape_of("box", random.uniform(60, 180), random.uniform(60, 160), random.uniform(4, 60))
        shape = random.choice([ball, tin, box])
        place = random.uniform(-60, 60), random.uniform(-50, 50), far + 25.0
        turned = random.uniform(-20, 20), random.uniform(-40, 40), random.uniform(-30, 30)
        objects.add(f"thing-{number}", place, turned, shape, _any_material(random))
    if random.random() < 1 / 3:
        place = 0.0, 0.0, random.uniform(690, 780)
        objects.add("wall", place, UPRIGHT, shape_of("card", 900, 900), _any_material(random, 2048))
    luminances = [2000, log_uniform(random, 60, 300)]
    return _illuminate(random, "Things behind bars", objects, [near, far], luminances)


def furnished(random: Random) -> Scene:
    """A room: a back wall with pictures, mostly a floor and side walls, and things that stand or hang before
    it at two or three depths."""
    planes = _plane_depths(random, random.choice([2, 2, 3]), nearest_gap_px=8)
    *planes, wall = planes if random.random() < 0.5 else [*planes, random.randint(planes[-1] + 40, 800)]
    floor = log_uniform(random, 60, 160)
    objects = Objects()
    _add_room(random, objects, wall, floor)
    # Pictures on the wall, some of them in a frame, some of a few patches.
    for number in range(random.choice([0, 1, 1, 2, 3, 4])):
        width, height = log_uniform(random, 30, 250), log_uniform(random, 30, 180)
        reach = HALF_FIELD * wall
        x, y = random.uniform(-0.8, 0.8) * reach, random.uniform(-0.8 * reach, min(floor, reach) - 20)
        turned = 0.0, 0.0, random.choice([0.0, random.uniform(-8, 8)])
        if random.random() < 0.5:
            frame = shape_of("box", 1.12 * width, 1.12 * height, 3)
            objects.add(f"frame-{number}", (x, y, wall - 1.6), turned, frame, parts.plain(random))
        place, shape = (x, y, wall - 3.3), shape_of("card", width, height)
        objects.add(f"picture-{number}", place, turned, shape, _any_material(random))
        for patch in range(random.choice([0, 0, 3])):
            place = x + random.uniform(-0.3, 0.3) * width, y + random.uniform(-0.3, 0.3) * height
            shape = shape_of("card", random.uniform(0.1, 0.4) * width, random.uniform(0.1, 0.4) * height)
            name, z = f"picture-{number}-{patch}", wall - 3.6 - 0.3 * patch
            objects.add(name, (*place, z), turned, shape, _any_material(random, 128))
    for number in range(random.randint(len(planes), 2 * len(planes) + 1)):
        z = planes[number % len(planes)]
        shape, behind, half_height = _any_shape(random, log_uniform(random, 12, 60))
        x = random.uniform(-0.75, 0.75) * HALF_FIELD * z
        turned = 0.0, random.uniform(-50, 50), 0.0
        if stands := random.random() < 0.7:
            y = floor - half_height - 0.2
        else:
            y = random.uniform(-0.7 * HALF_FIELD * z, floor - 1.5 * half_height)
        name = f"{'standing' if stands else 'hanging'}-{number}"
        objects.add(name, (x, y, z + behind), turned, shape, _any_material(random))
    named = [*planes, wall] if random.random() < 0.5 else planes
    return _illuminate(random, "A furnished room", objects, named)


def heap(random: Random) -> Scene:
    """Many things of one kind, of one to three materials, over and under one another."""
    planes = _plane_depths(random, random.choice([1, 2, 2, 3]))
    materials = [
        random.choice([parts.plain, _any_material])(random) for _ in range(random.choice([1, 1, 1, 2, 3]))
    ]
    size, spread = log_uniform(random, 7, 40), log_uniform(random, 30, 90)
    size_spread, depth_spread = random.uniform(0, 0.3), log_uniform(random, 0.5, 8)
    kind = random.choice(["ball", "box", "rod", "card"])
    turn = random.choice([5.0, 45.0])
    objects = Objects()
    for number in range(round(log_uniform(random, 8, 70))):
        shape, behind, _ = _any_shape(random, size * math.exp(random.gauss(0, size_spread)), kind)
        z = random.choice(planes) + behind + random.gauss(0, depth_spread)
        place = random.gauss(0, spread), random.gauss(0, 0.8 * spread), z
        turned = random.uniform(-turn, turn), random.uniform(-turn, turn), random.uniform(-180, 180)
        material, light = random.choice(materials), random.uniform(0.9, 1.1)
        if "reflectance" in material:  # each a little lighter or darker
            own_colour = [round(min(1.0, light * part), 3) for part in material["reflectance"]]
            material = material | {"reflectance": own_colour}
        objects.add(f"{kind}-{number}", place, turned, shape, material)
    _add_backwall(random, objects, planes[-1])
    return _illuminate(random, "A heap", objects, planes)


def pickets(random: Random) -> Scene:
    """Pickets, rods, a grid or wires, 3 to 25 px wide, before one to three things or a wall."""
    near, *others = _plane_depths(random, random.choice([2, 2, 3]))
    objects = Objects()
    _add_narrow_things(random, objects, near)
    material = random.choice([parts.plain, _any_material])
    if random.random() < 0.3:
        _add_wall(random, objects, others[-1], material, side_mm=1000)
        others = others[:-1] or others
    for number in range(random.randint(1, 3)):
        z = random.choice(others)
        shape, behind, _ = _any_shape(random, log_uniform(random, 25, 90))
        place = random.uniform(-100, 100), random.uniform(-80, 80), z + behind - 1.0
        objects.add(f"thing-{number}", place, _any_turn(random), shape, material(random))
    _add_backwall(random, objects, max(others))
    return _illuminate(random, "Narrow things", objects, [near, *others])


def plain_pair(random: Random) -> Scene:
    """Two or three large things of one colour each before the dark, or before what is plain as well."""
    planes = _plane_depths(random, random.choice([2, 2, 3]))
    apart, objects = log_uniform(random, 50, 130), Objects()
    for number, z in enumerate(random.sample(planes, len(planes))):
        shape, behind, _ = _any_shape(random, log_uniform(random, 38, 95))
        x = apart * (number - (len(planes) - 1) / 2) + random.uniform(-15, 15)
        place = x, random.uniform(-40, 40), z + behind
        objects.add(f"plain-{number}", place, _any_turn(random), shape, parts.plain(random))
    if random.random() < 0.3:
        _add_wall(random, objects, random.uniform(planes[-1] + 60, 850), parts.plain)
    return _illuminate(random, "Large plain things", objects, planes)


def leaning(random: Random) -> Scene:
    """Cards, books and floors that lean through depth, some with things that do not among them."""
    planes = _plane_depths(random, random.choice([1, 2, 3]))
    objects = Objects()
    for number in range(random.randint(1, 4)):
        long, broad = log_uniform(random, 80, 400), log_uniform(random, 40, 200)
        angle = random.choice([-1, 1]) * random.uniform(25, 75)
        # The long side leans: about the level axis, or about the upright one.
        about_level, about_upright = ((broad, long), (angle, 0.0)), ((long, broad), (0.0, angle))
        size, turned = random.choice([about_level, about_upright])
        turned = *turned, random.choice([0.0, random.uniform(-30, 30)])
        place = random.uniform(-90, 90), random.uniform(-80, 80), random.choice(planes)
        shape = random.choice([shape_of("card", *size), shape_of("box", *size, log_uniform(random, 3, 30))])
        objects.add(f"leaning-{number}", place, turned, shape, _any_material(random))
    for number in range(random.randint(0, 3)):
        z = random.choice(planes)
        shape, behind, _ = _any_shape(random, log_uniform(random, 12, 50))
        place = random.uniform(-110, 110), random.uniform(-90, 90), z + behind
        objects.add(f"thing-{number}", place, _any_turn(random), shape, _any_material(random))
    if random.random() < 0.4:
        place = 0.0, random.uniform(90, 160), random.uniform(560, 640)
        turned = random.uniform(-90, -70), random.uniform(-15, 15), 0.0
        objects.add("floor", place, turned, shape_of("card", 900, 420), _large_material(random))
    _add_backwall(random, objects, 760)
    return _illuminate(random, "Leaning things", objects, planes)


def glazed(random: Random) -> Scene:
    """Things of glass, metal and shiny plastic, and some that are matt, before a wall or in a room."""
    planes = _plane_depths(random, random.choice([2, 3]))
    wall, has_glass = random.uniform(planes[-1] + 50, 850), random.random() < 0.5
    objects = Objects()
    _add_wall(random, objects, wall, _large_material)
    if not has_glass and random.random() < 0.5:
        objects.clear()
        _add_room(random, objects, wall, random.uniform(90, 160))
    for number in range(random.randint(2, 6)):
        z = planes[number % len(planes)]
        shape, behind, _ = _any_shape(random, log_uniform(random, 15, 65))
        place = random.uniform(-110, 110), random.uniform(-80, 70), z + behind
        material = random.choice([parts.glossy, parts.glossy, _any_material])(random)
        if has_glass and number < 2:
            material = {"finish": {"type": "glass", "refractive_index": round(random.uniform(1.3, 1.8), 2)}}
        objects.add(f"glazed-{number}", place, _any_turn(random), shape, material)
    return _illuminate(random, "Glass and gloss", objects, planes)


def meshes(random: Random) -> Scene:
    """Two to six curved shapes: blobs, heads, rings, knots, springs, cones, capsules and vases."""
    planes = _plane_depths(random, random.choice([2, 2, 3, 4]))
    objects = Objects()
    for number in range(random.randint(2, 6)):
        make = random.choice(parts.CURVED)
        size = log_uniform(random, 18, 85)
        kind, z = make.__name__, planes[number % len(planes)]
        behind = 0.0 if kind == "tube" else 0.6 * size
        place = random.uniform(-100, 100), random.uniform(-80, 80), z + behind
        turn = 40.0 if kind == "head" else random.choice([25.0, 180.0])
        rotation = random.uniform(-turn, turn) / 2, random.uniform(-turn, turn), random.uniform(-turn, turn)
        material = random.choice([parts.plain, _any_material, _any_material, parts.glossy])(random)
        objects.add(f"{kind}-{number}", place, rotation, parts.mesh_of(make(random), size), material)
    _add_backwall(random, objects, planes[-1])
    return _illuminate(random, "Curved things", objects, planes)


def empty_wall(random: Random) -> Scene:
    """A bare or patterned wall by itself, upright or a little turned; the named planes are away from it."""
    wall = random.uniform(440, 760)
    turned = random.choice([UPRIGHT, (random.uniform(-8, 8), random.uniform(-12, 12), 0.0)])
    material = random.choice([parts.plain, _large_material])(random)
    objects = Objects()
    objects.add("wall", (0.0, 0.0, wall), turned, shape_of("card", 1200, 1200), material)
    away = [plane for plane in range(440, 761) if abs(TOTAL_PX_MM / plane - TOTAL_PX_MM / wall) > 13]
    return _illuminate(random, "An empty wall", objects, [random.choice(away)])


def _add_narrow_things(random: Random, objects: Objects, z_mm: float) -> None:
    """Add pickets, rods or wires beside each other, of one material, or two layers of them that cross."""
    width = log_uniform(random, 2.4, 20)
    make = random.choice(
        [
            lambda long: shape_of("card", width, long),
            lambda long: shape_of("box", width, long, log_uniform(random, 1, 12)),
            lambda long: parts.rod_of(width / 2, long),
        ]
    )
    spacing, tilt = width * log_uniform(random, 1.5, 6), random.uniform(-90, 90)
    count, disorder = max(3, min(24, round(320 / spacing))), random.choice([0.0, 1.0, 12.0])
    material = parts.plain(random) if random.choice([True, False]) else _any_material(random, 256)
    for layer in range(random.choice([1, 1, 2])):
        long = random.uniform(100, 400)
        for number in range(count):
            angle = tilt + 90 * layer
            along = spacing * (number - (count - 1) / 2) + random.gauss(0, spacing * disorder / 30)
            across = random.gauss(0, 0.04) * long
            cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
            place = along * cosine - across * sine, along * sine + across * cosine, z_mm + 2.0 * layer
            turned = 0.0, 0.0, angle + random.gauss(0, disorder)
            objects.add(f"narrow-{layer}-{number}", place, turned, make(long), material)


def _any_shape(random: Random, size_mm: float, kind: str | None = None) -> tuple[Table, float, float]:
    """A shape about as large as a ball of this radius, how far its middle is behind what is seen of it, and
    half of its height."""
    r, stretch = size_mm, math.exp(random.gauss(0, 0.35))
    match kind or random.choice(["ball", "ball", "box", "box", "tin", "tin", "card"]):
        case "ball":
            return shape_of("sphere", r), 0.7 * r, r
        case "box":
            depth = 2 * r * log_uniform(random, 0.2, 1)
            return shape_of("box", 1.8 * r * stretch, 1.8 * r / stretch, depth), depth / 2, 0.9 * r / stretch
        case "tin":
            return shape_of("cylinder", 0.8 * r / stretch, 2 * r * stretch), 0.65 * r / stretch, r * stretch
        case "rod":  # a tin of which a scene can have many
            radius = 0.8 * r / stretch
            return parts.rod_of(radius, 2 * r * stretch), 0.8 * radius, r * stretch
        case _:
            return shape_of("card", 2 * r * stretch, 2 * r / stretch), 0.0, r / stretch


def _any_turn(random: Random) -> Triple:
    """A turn that still shows the front."""
    return random.uniform(-25, 25), random.uniform(-40, 40), random.uniform(-40, 40)


def _any_material(random: Random, pixels: int = 512) -> Table:
    """Noise, one colour, stripes, checks, a star, text or metal."""
    two = [colour(random, 0.1, 0.5), colour(random, 0.4, 0.9)]
    if random.random() < 0.25:
        return {"reflectance": colour(random, 0.1, 0.9)}
    if random.random() < 0.08:
        return parts.metal(random.choice(["Ag", "Au", "Cu"]), log_uniform(random, 0.08, 0.5))
    # All are drawn, and one of them is taken.
    noise = parts.noise(random, None, (0.7, 1.5), (0.1, 0.35), 0.5, 100_000)["texture"]
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


def _large_material(random: Random) -> Table:
    """What walls and floors are of: one colour, shades that change slowly, or patterns."""
    if random.random() < 0.35:
        return parts.plain(random)
    if random.random() < 0.6:
        return _any_material(random, 1024)
    shades = parts.noise(random, None, (1.6, 2.4), (0.1, 0.3), 0, 100_000)
    return {"texture": shades["texture"] | {"pixels": 512}}


def _add_wall(
    random: Random, objects: Objects, z_mm: float, material: Material, side_mm: float = 1200
) -> None:
    """Add an upright wall that fills the film."""
    objects.add("wall", (0.0, 0.0, z_mm), UPRIGHT, shape_of("card", side_mm, side_mm), material(random))


def _add_backwall(random: Random, objects: Objects, farthest_mm: float) -> None:
    """As often as not, add a wall behind all."""
    if random.random() >= 0.5:
        place = 0.0, 0.0, random.uniform(farthest_mm + 40, 880)
        objects.add("backwall", place, UPRIGHT, shape_of("card", 1200, 1200), _large_material(random))


def _add_room(random: Random, objects: Objects, wall_mm: float, floor_mm: float) -> None:
    """Add a back wall, mostly a floor and often a side wall or two."""
    _add_wall(random, objects, wall_mm, _large_material)
    middle, long = (wall_mm + 400) / 2, wall_mm - 400
    if random.random() < 0.8:
        place, shape = (0.0, floor_mm + 200, middle), shape_of("box", 1200, 400, long)
        objects.add("floor", place, UPRIGHT, shape, _large_material(random))
    for name, side in (("left-wall", -1), ("right-wall", 1)):
        if random.random() < 0.5:
            place, shape = (side * random.uniform(150, 270), 0.0, middle), shape_of("card", long, 1000)
            objects.add(name, place, (0.0, 90.0, 0.0), shape, _large_material(random))


def _plane_depths(random: Random, count: int, nearest_gap_px: float = GAP_PX[0]) -> list[int]:
    """Depths of `count` planes in mm, the nearest first, from hardly to well apart."""
    far, near = TOTAL_PX
    gaps = [math.inf]
    while sum(gaps) > near - far:
        gaps = [log_uniform(random, nearest_gap_px, GAP_PX[1]) for _ in range(count - 1)]
    totals = accumulate(gaps, initial=random.uniform(far, near - sum(gaps)))
    return sorted(round(TOTAL_PX_MM / total) for total in totals)


def _illuminate(
    random: Random,
    title: str,
    objects: Objects,
    planes_mm: list[int],
    lamp_and_sky_cd_m2: Sequence[float] = (),
) -> Scene:
    """The scene of these objects under a lamp and a sky of these luminances, or else in any light."""
    if lamp_and_sky_cd_m2:
        x, z = round(random.uniform(-300, 300)), round(random.uniform(100, 400))
        lights = parts.lamp_and_sky(x, z, *(round(value, 1) for value in lamp_and_sky_cd_m2))
        bright = colour(random, 0.1, 0.6)
    else:
        materials = [thing["material"] for thing in objects]
        bright = colour(random, 0.1, 0.6)
        lights = parts.any_lights(random, {each["finish"]["type"] for each in materials if "finish" in each})
    (reflectance,) = random.choices([[0.02, 0.02, 0.02], [0.04, 0.04, 0.05], bright], weights=[2, 2, 1])
    backdrop = {"z_mm": 2500.0, "reflectance": reflectance}
    return parts.composed(title, objects, planes_mm, lights, backdrop, has_meshes=not lamp_and_sky_cd_m2)
