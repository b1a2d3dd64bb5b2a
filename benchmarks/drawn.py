"""Scenes drawn at random, for methods to be judged on what nobody arranged.

A scene is told by its kind and number, and is the same for all time. Numbers below 100 are for tuning;
figures that are told are of numbers from 100 on. Depths, sizes, shapes, colours, textures and lights differ.

plain       two or three solids of one colour each, one before the border of another; a dark backdrop
textured    the same, with patterns
cards       16 to 40 small cards at three depths, over and under one another
room        two or three solids before a wall of detail, on a desk or not: the film is bright all over
crossing    something plain across the middle of something else of nearly the same colour
leaves      a thing of detail behind 24 to 48 small leaves, all of them of one material
checks      two or three solids of coarse checks, one before the middle of the other
shiny       two or three solids of plastic or metal, glossy or dull, each by itself
"""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Literal

TUNING = 100
"""Numbers from here on are for figures."""
REFERENCE_MM = 560.0
"""Sizes and places are drawn for this depth and scaled, so that things are as large in the picture."""
PLANES_MM: tuple[int, ...] = (480, 510, 545, 585, 630, 680)
LEAST_APART_MM = 80

Kind = Literal["plain", "textured", "cards", "room", "crossing", "leaves", "checks", "shiny"]
KINDS: dict[Kind, Literal["untextured", "textured", "cluttered"]] = {
    "plain": "untextured",
    "textured": "textured",
    "cards": "cluttered",
    "room": "cluttered",
    "crossing": "untextured",
    "leaves": "cluttered",
    "checks": "textured",
    "shiny": "untextured",
}
"""What is hard about each, in the words of corpus.toml."""


def write_drawn(folder: Path, kind: Kind, number: int) -> Path:
    """Write a scene and its recipe into a folder; gives the recipe's path. Replaces what was there."""
    random = Random(f"{kind} {number}")
    objects, planes_mm = _things(random, kind)
    name = f"{kind}_{number}"
    scene = folder / name
    scene.mkdir(parents=True, exist_ok=True)
    backdrop = "" if kind == "room" else '[backdrop]\nz_mm = 3000.0\nreflectance = "black 2"\n'
    head = f'title = "Drawn: {kind} {number}"\n'
    (scene / "scene.toml").write_text("\n".join([head, *objects, _light(random), backdrop]), encoding="utf-8")
    recipe = folder / f"{name}.toml"
    recipe.write_text(_recipe(name, number, planes_mm), encoding="utf-8")
    return recipe


def _things(random: Random, kind: Kind) -> tuple[list[str], list[int]]:
    """The objects as TOML, and the depths in mm that they are at."""
    match kind:
        case "plain":
            return _solids(random, _plain)
        case "textured":
            return _solids(random, _pattern)
        case "cards":
            return _cards(random)
        case "room":
            return _room(random)
        case "crossing":
            return _crossing(random)
        case "leaves":
            return _leaves(random)
        case "checks":
            coarse = partial(_checks, fewest=2, most=5)
            # Close together, so that borders run through the middle of what is behind.
            return _solids(
                random, coarse, first_mm=(-30, -45), apart_mm=(30, 60), radius_mm=(40, 60), high_mm=30
            )
        case "shiny":
            return _solids(
                random, _shiny, first_mm=(-60, -105), apart_mm=(95, 115), radius_mm=(30, 48), high_mm=60
            )


def _recipe(name: str, number: int, planes_mm: list[int]) -> str:
    return f"""title = "{name}"
scene = "{name}"
seed = {number}

[grid]
rows = 10
cols = 10
pitch_mm = [5.0, 5.0]
focal_mm = 50.0
pixel_mm = 0.0352
height = 1024
width = 1024

[sensor]
cfa = "GRBG"

[photons]
budget = 1000

[analysis]
z_mm = {planes_mm}
z_range_mm = [{min(planes_mm) - 60}, {max(planes_mm) + 60}]
"""


def _planes(random: Random, count: int) -> list[int]:
    """So many depths, well apart."""
    while True:
        planes: list[int] = sorted(random.sample(PLANES_MM, count))
        if all(far - near >= LEAST_APART_MM for near, far in pairwise(planes)):
            return planes


def _solids(
    random: Random,
    material: Callable[[Random], str],
    *,
    first_mm: tuple[float, float] = (-60, -80),
    apart_mm: tuple[float, float] = (50, 85),
    radius_mm: tuple[float, float] = (36, 58),
    high_mm: float = 25,
) -> tuple[list[str], list[int]]:
    """From left to right; the first of two or of three is at `first_mm`, up or down by at most `high_mm`."""
    planes = _planes(random, random.choice([2, 2, 3]))
    objects, x = [], first_mm[len(planes) - 2]
    for number, z in enumerate(random.sample(planes, len(planes))):
        scale, radius = z / REFERENCE_MM, random.uniform(*radius_mm)
        place = x * scale, random.uniform(-high_mm, high_mm) * scale, z + 0.6 * radius * scale
        objects.append(_solid(random, f"solid-{number}", place, radius * scale, material(random)))
        x += random.uniform(*apart_mm)
    return objects, planes


def _cards(random: Random) -> tuple[list[str], list[int]]:
    planes = [470, 550, 650]
    colours = [_colour(random, 0.3, 0.7) for _ in planes]
    objects = []
    for number in range(random.randrange(16, 41)):
        layer = random.randrange(len(planes))
        z, scale = planes[layer], planes[layer] / REFERENCE_MM
        height = random.uniform(12, 40) * scale
        shape = f'type = "card", width_mm = {height * random.uniform(1, 2.2):.1f}, height_mm = {height:.1f}'
        x, y = (random.uniform(-120, 120) * scale for _ in range(2))
        # Most are of their layer's colour; some of any, some plain.
        own = colours[layer] if random.random() < 0.6 else _colour(random, 0.3, 0.7)
        material = _noise(random, own) if random.random() < 0.8 else _plain(random)
        turned = random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(0, 180)
        objects.append(_object(f"card-{number}", (x, y, z + random.uniform(-6, 6)), turned, shape, material))
    return objects, planes


def _room(random: Random) -> tuple[list[str], list[int]]:
    planes, wall = _planes(random, random.choice([2, 2, 3])), 760
    objects = []
    for number, z in enumerate(planes):
        radius, scale = random.uniform(26, 42), z / REFERENCE_MM
        x, y = random.uniform(-90, 90) * scale, (30 - 0.2 * radius) * scale + random.uniform(-60, 0)
        place = x, y, z + 0.6 * radius * scale
        objects.append(_solid(random, f"solid-{number}", place, radius * scale, _pattern(random)))
    flat = 'type = "card", width_mm = 1000.0, height_mm = 1000.0'
    own = _noise(random, _colour(random, 0.3, 0.7))
    objects.append(_object("wall", (0.0, 0.0, wall + 1.0), (0.0, 0.0, 0.0), flat, own))
    if random.random() < 0.5:
        box = 'type = "box", width_mm = 800.0, height_mm = 240.0, depth_mm = 320.0'
        top = _noise(random, _colour(random, 0.3, 0.7))
        objects.append(_object("desk", (0.0, 205.0, 595.0), (0.0, 0.0, 0.0), box, top))
    return objects, [*planes, wall]


def _crossing(random: Random) -> tuple[list[str], list[int]]:
    near, far = planes = _two_planes(random)
    colour = [random.uniform(0.3, 0.7) for _ in range(3)]
    alike = [", ".join(f"{part + random.uniform(-0.04, 0.04):.2f}" for part in colour) for _ in planes]
    behind, across = (f"reflectance = [{own}]" for own in alike)
    x, y = random.uniform(-20, 20), random.uniform(-20, 20)
    radius, scale = random.uniform(50, 65), far / REFERENCE_MM
    place = x * scale, y * scale, far + 0.6 * radius * scale
    objects = [_solid(random, "behind", place, radius * scale, behind)]
    scale = near / REFERENCE_MM
    r, long = random.uniform(11, 17) * scale, random.uniform(170, 230) * scale
    # Each with how far its middle is behind what is seen of it.
    shape, depth = random.choice(
        [
            (f'type = "cylinder", radius_mm = {r:.1f}, length_mm = {long:.1f}', 0.6 * r),
            (f'type = "box", width_mm = {2 * r:.1f}, height_mm = {long:.1f}, depth_mm = 8.0', 4.0),
            (f'type = "sphere", radius_mm = {2.4 * r:.1f}', 1.4 * r),
        ]
    )
    turned = random.uniform(-8, 8), random.uniform(-8, 8), random.uniform(0, 180)
    place = (x + random.uniform(-25, 25)) * scale, (y + random.uniform(-25, 25)) * scale, near + depth
    return [*objects, _object("across", place, turned, shape, across)], list(planes)


def _leaves(random: Random) -> tuple[list[str], list[int]]:
    near, far = planes = _two_planes(random)
    radius, scale = random.uniform(50, 70), far / REFERENCE_MM
    place = random.uniform(-20, 20) * scale, random.uniform(-20, 20) * scale, far + 0.6 * radius * scale
    objects = [_solid(random, "thing", place, radius * scale, _pattern(random))]
    green, scale = _noise(random, _colour(random, 0.3, 0.7)), near / REFERENCE_MM
    for number in range(random.randrange(24, 49)):
        long = random.uniform(14, 32) * scale
        shape = f'type = "card", width_mm = {long:.1f}, height_mm = {long * random.uniform(0.4, 0.8):.1f}'
        x, y = (random.uniform(-100, 100) * scale for _ in range(2))
        turned = random.uniform(-40, 40), random.uniform(-40, 40), random.uniform(0, 180)
        objects.append(
            _object(f"leaf-{number}", (x, y, near + random.uniform(-12, 12)), turned, shape, green)
        )
    return objects, list(planes)


def _two_planes(random: Random) -> tuple[int, int]:
    """From 90 to 140 mm apart, the nearer first."""
    near = random.randrange(470, 531)
    return near, near + random.randrange(90, 141)


def _solid(
    random: Random, name: str, place_mm: tuple[float, float, float], radius_mm: float, material: str
) -> str:
    turned = random.uniform(-25, 25), random.uniform(-40, 40), random.uniform(-25, 25)
    r = radius_mm
    shape = random.choice(
        [
            f'type = "sphere", radius_mm = {r:.1f}',
            f'type = "cylinder", radius_mm = {0.7 * r:.1f}, length_mm = {2.1 * r:.1f}',
            f'type = "box", width_mm = {1.5 * r:.1f}, height_mm = {1.7 * r:.1f}, depth_mm = {1.3 * r:.1f}',
        ]
    )
    return _object(name, place_mm, turned, shape, material)


def _object(
    name: str,
    place_mm: tuple[float, float, float],
    turned_deg: tuple[float, float, float],
    shape: str,
    material: str,
) -> str:
    place, turned = (", ".join(f"{value:.1f}" for value in three) for three in (place_mm, turned_deg))
    return f"""[[objects]]
name = "{name}"
position_mm = [{place}]
rotation_deg = [{turned}]
shape = {{ {shape} }}
material = {{ {material} }}
"""


def _colour(random: Random, low: float, high: float) -> str:
    return f"[{', '.join(f'{random.uniform(low, high):.2f}' for _ in range(3))}]"


def _plain(random: Random) -> str:
    return f"reflectance = {_colour(random, 0.15, 0.85)}"


def _noise(random: Random, colour: str) -> str:
    exponent, contrast = random.uniform(0.8, 1.3), random.uniform(0.15, 0.3)
    return (
        f'texture = {{ type = "noise", exponent = {exponent:.2f}, contrast = {contrast:.2f}, '
        f"colour = {colour}, chroma = {random.uniform(0, 0.4):.2f}, seed = {random.randrange(1000)} }}"
    )


def _shiny(random: Random) -> str:
    roughness = f"roughness = {10 ** random.uniform(-1.4, -0.3):.2f}"
    if random.random() < 0.5:
        return f'{_plain(random)}, finish = {{ type = "plastic", {roughness} }}'
    metal = random.choice(["Ag", "Al", "Au", "Cr", "Cu", "W"])
    return f'finish = {{ type = "metal", name = "{metal}", {roughness} }}'


def _pattern(random: Random) -> str:
    if random.random() < 0.6:
        return _noise(random, _colour(random, 0.3, 0.7))
    return _checks(random)


def _checks(random: Random, fewest: int = 4, most: int = 8) -> str:
    colours = f"{_colour(random, 0.15, 0.85)}, {_colour(random, 0.15, 0.85)}"
    rows, columns = random.randint(fewest, most), random.randint(fewest, most)
    return f'texture = {{ type = "checks", rows = {rows}, columns = {columns}, colours = [{colours}] }}'


def _light(random: Random) -> str:
    return f"""[[lights]]
type = "area"
position_mm = [{random.uniform(-300, 300):.0f}.0, -430.0, {random.uniform(150, 400):.0f}.0]
target_mm = [0.0, 0.0, 600.0]
width_mm = 400.0
height_mm = 300.0
luminance_cd_m2 = 2000.0

[[lights]]
type = "uniform"
luminance_cd_m2 = {random.uniform(60, 150):.0f}.0
"""
