"""Kinds of drawn scenes with two or three solids before a dark backdrop."""

from collections.abc import Callable
from functools import partial
from random import Random

from simgen.drawn.composition import (
    REFERENCE_MM,
    Table,
    box_of,
    chessboard,
    cylinder_of,
    drawn_scene,
    glossy,
    pattern,
    placed,
    plain,
    planes_apart,
    solid,
    sphere,
    two_planes,
)
from simgen.spec.scene import Scene


def drawn_plain(random: Random) -> Scene:
    """Two or three solids of one colour each, one before the border of another."""
    return _side_by_side(random, "plain", plain)


def drawn_textured(random: Random) -> Scene:
    """Two or three solids with patterns, one before the border of another."""
    return _side_by_side(random, "textured", pattern)


def drawn_checks(random: Random) -> Scene:
    """Two or three solids of coarse checks, one before the middle of the other."""
    # Close together, so that borders run through the middle of what is behind.
    return _side_by_side(
        random,
        "checks",
        partial(chessboard, fewest=2, most=5),
        first_mm=(-30, -45),
        apart_mm=(30, 60),
        radius_mm=(40, 60),
        high_mm=30,
    )


def drawn_shiny(random: Random) -> Scene:
    """Two or three solids of plastic or metal, glossy or dull, each by itself."""
    return _side_by_side(
        random, "shiny", glossy, first_mm=(-60, -105), apart_mm=(95, 115), radius_mm=(30, 48), high_mm=60
    )


def drawn_crossing(random: Random) -> Scene:
    """Something plain across the middle of something else of nearly the same colour."""
    near, far = planes = two_planes(random)
    mean = [random.uniform(0.3, 0.7) for _ in range(3)]
    alike = [[round(part + random.uniform(-0.04, 0.04), 2) for part in mean] for _ in planes]
    behind, across = ({"reflectance": own} for own in alike)
    x, y = random.uniform(-20, 20), random.uniform(-20, 20)
    radius, scale = random.uniform(50, 65), far / REFERENCE_MM
    place = x * scale, y * scale, far + 0.6 * radius * scale
    objects = [solid(random, "behind", place, radius * scale, behind)]
    scale = near / REFERENCE_MM
    r, long = random.uniform(11, 17) * scale, random.uniform(170, 230) * scale
    # Each with how far its middle is behind what is seen of it.
    shape, depth = random.choice(
        [(cylinder_of(r, long), 0.6 * r), (box_of(2 * r, long, 8), 4.0), (sphere(2.4 * r), 1.4 * r)]
    )
    turned = random.uniform(-8, 8), random.uniform(-8, 8), random.uniform(0, 180)
    place = (x + random.uniform(-25, 25)) * scale, (y + random.uniform(-25, 25)) * scale, near + depth
    objects.append(placed("across", place, turned, shape, across))
    return drawn_scene(random, "Drawn: crossing", objects, planes)


def _side_by_side(
    random: Random,
    kind: str,
    material: Callable[[Random], Table],
    *,
    first_mm: tuple[float, float] = (-60, -80),
    apart_mm: tuple[float, float] = (50, 85),
    radius_mm: tuple[float, float] = (36, 58),
    high_mm: float = 25,
) -> Scene:
    """From left to right; the first of two or of three is at `first_mm`, up or down by at most `high_mm`."""
    planes = planes_apart(random, random.choice([2, 2, 3]))
    objects, x = [], first_mm[len(planes) - 2]
    for position, z in enumerate(random.sample(planes, len(planes))):
        scale, radius = z / REFERENCE_MM, random.uniform(*radius_mm)
        place = x * scale, random.uniform(-high_mm, high_mm) * scale, z + 0.6 * radius * scale
        objects.append(solid(random, f"solid-{position}", place, radius * scale, material(random)))
        x += random.uniform(*apart_mm)
    return drawn_scene(random, f"Drawn: {kind}", objects, planes)
