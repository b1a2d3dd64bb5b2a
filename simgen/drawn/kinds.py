"""Ten kinds of drawn scenes that methods are judged on: two or three solids, many cards or leaves, a room,
a desk.

Scenes with numbers below `FIRST_UNSEEN` are for tuning, and the network of depth was trained on some of them.
What is reported is of others.
"""

import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from random import Random

from simgen.drawn import parts
from simgen.drawn.parts import UPRIGHT, Material, Objects, Table, Triple, colour, noise, shape_of
from simgen.spec import Scene

FIRST_UNSEEN = 100
"""The least number of a scene that no method was tuned or trained on."""
REFERENCE_MM = 560.0
"""Sizes and places are drawn for this depth and scaled, so that things are as large in the picture."""
PLANES_MM: tuple[int, ...] = (480, 510, 545, 585, 630, 680)
MIN_DEPTH_GAP_MM = 80
DARK = {"z_mm": 3000.0, "reflectance": "black 2"}
DESK_TOP_MM = 65.0
MIN_GAP_MM = 2.0
MAX_TRIES = 1000


def _chessboard(random: Random, fewest: int = 4, most: int = 8) -> Table:
    """Checks of two colours, from `fewest` to `most` to a side."""
    colours = [colour(random, 0.15, 0.85), colour(random, 0.15, 0.85)]
    rows, columns = random.randint(fewest, most), random.randint(fewest, most)
    return {"texture": {"type": "checks", "rows": rows, "columns": columns, "colours": colours}}


def drawn_plain(random: Random) -> Scene:
    """Two or three solids of one colour each, one before the border of another."""
    return _side_by_side(random, "plain", parts.plain)


def drawn_textured(random: Random) -> Scene:
    """Two or three solids with patterns, one before the border of another."""
    return _side_by_side(random, "textured", _pattern)


def drawn_checks(random: Random) -> Scene:
    """Two or three solids of coarse checks, one before the middle of the other."""
    # Close together, so that borders run through the middle of what is behind.
    coarse = partial(_chessboard, fewest=2, most=5)
    return _side_by_side(random, "checks", coarse, (-30, -45), (30, 60), (40, 60), 30)


def drawn_shiny(random: Random) -> Scene:
    """Two or three solids of plastic or metal, glossy or dull, each by itself."""
    return _side_by_side(random, "shiny", parts.glossy, (-60, -105), (95, 115), (30, 48), 60)


def drawn_crossing(random: Random) -> Scene:
    """Something plain across the middle of something else of nearly the same colour."""
    near, far = planes = _two_planes(random)
    mean = [random.uniform(0.3, 0.7) for _ in range(3)]
    alike = [[round(part + random.uniform(-0.04, 0.04), 2) for part in mean] for _ in planes]
    behind, across = ({"reflectance": one} for one in alike)
    x, y = random.uniform(-20, 20), random.uniform(-20, 20)
    radius, scale = random.uniform(50, 65), far / REFERENCE_MM
    place = x * scale, y * scale, far + 0.6 * radius * scale
    objects = Objects()
    _add_solid(random, objects, "behind", place, radius * scale, behind)
    scale = near / REFERENCE_MM
    r, long = random.uniform(11, 17) * scale, random.uniform(170, 230) * scale
    # Each with how far its middle is behind what is seen of it.
    tin, box = shape_of("cylinder", r, long), shape_of("box", 2 * r, long, 8)
    shape, depth = random.choice([(tin, 0.6 * r), (box, 4.0), (shape_of("sphere", 2.4 * r), 1.4 * r)])
    rotation_deg = random.uniform(-8, 8), random.uniform(-8, 8), random.uniform(0, 180)
    place = (x + random.uniform(-25, 25)) * scale, (y + random.uniform(-25, 25)) * scale, near + depth
    objects.add("across", place, rotation_deg, shape, across)
    return _drawn_scene(random, "Drawn: crossing", objects, planes)


def _side_by_side(
    random: Random,
    kind: str,
    material: Material,
    first_mm: tuple[float, float] = (-60, -80),
    apart_mm: tuple[float, float] = (50, 85),
    radius_mm: tuple[float, float] = (36, 58),
    high_mm: float = 25,
) -> Scene:
    """From left to right; the first of two or of three is at `first_mm`, up or down by at most `high_mm`."""
    planes = _planes_apart(random)
    objects, x = Objects(), first_mm[len(planes) - 2]
    for position, z in enumerate(random.sample(planes, len(planes))):
        scale, radius = z / REFERENCE_MM, random.uniform(*radius_mm)
        place = x * scale, random.uniform(-high_mm, high_mm) * scale, z + 0.6 * radius * scale
        _add_solid(random, objects, f"solid-{position}", place, radius * scale, material(random))
        x += random.uniform(*apart_mm)
    return _drawn_scene(random, f"Drawn: {kind}", objects, planes)


def drawn_cards(random: Random) -> Scene:
    """16 to 40 small cards at three depths, over and under one another."""
    planes = [470, 550, 650]
    colours = [colour(random, 0.3, 0.7) for _ in planes]
    objects = Objects()
    for position in range(random.randrange(16, 41)):
        layer = random.randrange(len(planes))
        z, scale = planes[layer], planes[layer] / REFERENCE_MM
        height = random.uniform(12, 40) * scale
        shape = shape_of("card", height * random.uniform(1, 2.2), height)
        x, y = (random.uniform(-120, 120) * scale for _ in range(2))
        # Most are of their layer's colour; some of any, some plain.
        mean = colours[layer] if random.random() < 0.6 else colour(random, 0.3, 0.7)
        material = noise(random, mean) if random.random() < 0.8 else parts.plain(random)
        rotation_deg = random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(0, 180)
        place = x, y, z + random.uniform(-6, 6)
        objects.add(f"card-{position}", place, rotation_deg, shape, material)
    return _drawn_scene(random, "Drawn: cards", objects, planes)


def drawn_room(random: Random) -> Scene:
    """Two or three solids before a wall of detail, on a desk or not: the film is bright all over."""
    planes, wall = _planes_apart(random), 760
    objects = Objects()
    for position, z in enumerate(planes):
        radius, scale = random.uniform(26, 42), z / REFERENCE_MM
        x, y = random.uniform(-90, 90) * scale, (30 - 0.2 * radius) * scale + random.uniform(-60, 0)
        place = x, y, z + 0.6 * radius * scale
        _add_solid(random, objects, f"solid-{position}", place, radius * scale, _pattern(random))
    detail = noise(random, colour(random, 0.3, 0.7))
    objects.add("wall", (0.0, 0.0, wall + 1.0), UPRIGHT, shape_of("card", 1000, 1000), detail)
    if random.random() < 0.5:
        top = noise(random, colour(random, 0.3, 0.7))
        objects.add("desk", (0.0, 205.0, 595.0), UPRIGHT, shape_of("box", 800, 240, 320), top)
    return _drawn_scene(random, "Drawn: room", objects, [*planes, wall], backdrop=None)


def drawn_leaves(random: Random) -> Scene:
    """A thing of detail behind 24 to 48 small leaves, all of them of one material."""
    near, far = planes = _two_planes(random)
    radius, scale = random.uniform(50, 70), far / REFERENCE_MM
    place = random.uniform(-20, 20) * scale, random.uniform(-20, 20) * scale, far + 0.6 * radius * scale
    objects = Objects()
    _add_solid(random, objects, "thing", place, radius * scale, _pattern(random))
    green, scale = noise(random, colour(random, 0.3, 0.7)), near / REFERENCE_MM
    for position in range(random.randrange(24, 49)):
        long = random.uniform(14, 32) * scale
        shape = shape_of("card", long, long * random.uniform(0.4, 0.8))
        x, y = (random.uniform(-100, 100) * scale for _ in range(2))
        rotation_deg = random.uniform(-40, 40), random.uniform(-40, 40), random.uniform(0, 180)
        place = x, y, near + random.uniform(-12, 12)
        objects.add(f"leaf-{position}", place, rotation_deg, shape, green)
    return _drawn_scene(random, "Drawn: leaves", objects, planes)


def drawn_solids(random: Random) -> Scene:
    """Boxes, a tin, a ball and a few marbles on a desk before a wall; nothing touches anything else."""
    near = random.randint(470, 490)
    middle = near + random.randint(75, 90)
    far = middle + random.randint(80, 100)
    standing = Objects()
    reaches: list[tuple[tuple[float, float], float]] = []

    def stand(name: str, shape: Table, half_mm: float, radius_mm: float, z_mm: float, x_mm: float) -> None:
        """Put something of this half height on the desk, drawn again until it is apart from all others."""
        for _ in range(MAX_TRIES):
            x = random.uniform(-x_mm, x_mm)
            gaps = (math.dist((x, z_mm), place) - reach - radius_mm for place, reach in reaches)
            if all(gap >= MIN_GAP_MM for gap in gaps):
                break
        else:
            return  # the desk is full
        reaches.append(((x, z_mm), radius_mm))
        place, turned = (x, DESK_TOP_MM - half_mm, z_mm), (0.0, random.uniform(-60, 60), 0.0)
        standing.add(name, place, turned, shape, _material(random, name))

    radius = random.uniform(32, 46)
    stand("ball", shape_of("sphere", radius), radius, radius, far + 25, 90)
    radius, height = random.uniform(20, 32), random.uniform(40, 75)
    stand("tin", shape_of("cylinder", radius, height), height / 2, radius, middle + 20, 95)
    for number in range(random.randint(1, 2)):
        width, height, depth = random.uniform(28, 42), random.uniform(28, 50), random.uniform(28, 38)
        reach = math.hypot(width, depth) / 2
        stand(f"block-{number + 1}", shape_of("box", width, height, depth), height / 2, reach, near + 20, 110)
    for number in range(random.randint(0, 4)):
        radius, depth = random.uniform(7, 12), random.choice([near, middle])
        stand(f"marble-{number + 1}", shape_of("sphere", radius), radius, radius, depth + 12, 115)
    wood = random.choice([[0.62, 0.52, 0.4], [0.62, 0.52, 0.4], [0.35, 0.25, 0.18], [0.42, 0.44, 0.5]])
    objects = Objects()
    objects.add("desk", (0.0, 185.0, 590.0), UPRIGHT, shape_of("box", 640, 240, 320), noise(random, wood))
    paper = noise(random, colour(random, 0.5, 0.75))
    objects.add("wall", (0.0, 0.0, 761.0), UPRIGHT, shape_of("card", 700, 700), paper)
    objects += standing
    return _drawn_scene(random, "Solids on a desk", objects, [near, middle, far, 760], None)


def drawn_foliage(random: Random) -> Scene:
    """Seeing through what stands in front: 20 to 45 leaves of one kind before a patterned solid."""
    near = random.randint(465, 500)
    far = near + random.randint(95, 140)
    greens = [[0.3, 0.5, 0.2], [0.45, 0.55, 0.25], [0.6, 0.45, 0.2], [0.55, 0.25, 0.2]]
    (green,) = random.choices(greens, weights=[4, 3, 1, 1])
    objects = Objects()
    for number in range(random.randint(20, 45)):
        place = random.gauss(0, 33), random.gauss(0, 33), near + random.gauss(0, 2)
        rotation_deg = random.uniform(-45, 45), random.uniform(-45, 45), random.uniform(0, 180)
        shape = shape_of("card", random.uniform(12, 28), random.uniform(8, 16))
        # Each a little lighter or darker than the green of all.
        light = random.uniform(0.8, 1.25)
        material = noise(random, [round(min(light * part, 1.0), 3) for part in green])
        objects.add(f"leaf-{number + 1}", place, rotation_deg, shape, material)
    ball = shape_of("sphere", random.uniform(58, 72))
    tin = shape_of("cylinder", random.uniform(42, 54), random.uniform(110, 150))
    shape = random.choice([ball, tin, shape_of("box", random.uniform(85, 110), random.uniform(95, 130), 60)])
    rotation_deg = random.uniform(-20, 20), random.uniform(-40, 40), random.uniform(-30, 30)
    place = random.uniform(-15, 15), random.uniform(-15, 15), far + 25.0
    objects.add("hidden", place, rotation_deg, shape, _material(random, "hidden"))
    backdrop = {"z_mm": 2500.0, "reflectance": [0.03, 0.035, 0.04]}
    return _drawn_scene(random, "Something behind leaves", objects, [near, far], backdrop)


def _material(random: Random, name: str) -> Table:
    """Metal or plastic for marbles, checks for blocks, checks, noise or stripes for the rest."""
    kind = name.partition("-")[0]
    if kind == "marble" and random.random() < 0.5:
        return parts.metal(random.choice(["Ag", "Au", "Cu"]), random.uniform(0.05, 0.4))
    if kind == "marble":
        return {"reflectance": colour(random, 0.2, 0.9), "finish": {"type": "plastic", "roughness": 0.1}}
    if kind == "block" or random.random() < 0.4:
        return _chessboard(random)
    if random.random() < 0.5:
        return noise(random, colour(random, 0.3, 0.6))
    periods, angle = random.randint(6, 16), round(random.uniform(-90, 90), 1)
    colours = [colour(random, 0.1, 0.6), [0.9, 0.88, 0.8]]
    return {"texture": {"type": "stripes", "periods": periods, "angle_deg": angle, "colours": colours}}


def _pattern(random: Random) -> Table:
    """Noise or checks."""
    if random.random() < 0.6:
        return noise(random, colour(random, 0.3, 0.7))
    return _chessboard(random)


def _drawn_scene(
    random: Random, title: str, objects: Objects, planes_mm: Sequence[int], backdrop: Table | None = DARK
) -> Scene:
    """The scene of these objects, its lamps drawn last."""
    x, z = round(random.uniform(-300, 300), 0), round(random.uniform(150, 400), 0)
    lights = parts.lamp_and_sky(x, z, 2000, round(random.uniform(60, 150)))
    return parts.composed(title, objects, planes_mm, lights, backdrop)


def _planes_apart(random: Random) -> list[int]:
    """Two or three depths, in mm, well apart."""
    count = random.choice([2, 2, 3])
    while True:
        planes: list[int] = sorted(random.sample(PLANES_MM, count))
        if all(far - near >= MIN_DEPTH_GAP_MM for near, far in pairwise(planes)):
            return planes


def _two_planes(random: Random) -> tuple[int, int]:
    """Two depths, from 90 to 140 mm apart, the nearer first."""
    near = random.randrange(470, 531)
    return near, near + random.randrange(90, 141)


def _add_solid(
    random: Random, objects: Objects, name: str, place_mm: Triple, radius_mm: float, material: Table
) -> None:
    """Add a turned sphere, cylinder or box, about as large as a sphere of this radius."""
    rotation_deg = random.uniform(-25, 25), random.uniform(-40, 40), random.uniform(-25, 25)
    r = radius_mm
    shapes = [
        shape_of("sphere", r),
        shape_of("cylinder", 0.7 * r, 2.1 * r),
        shape_of("box", 1.5 * r, 1.7 * r, 1.3 * r),
    ]
    objects.add(name, place_mm, rotation_deg, random.choice(shapes), material)
