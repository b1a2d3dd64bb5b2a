"""Kinds of drawn scenes that are full: heaps of cards, rooms, leaves."""

from random import Random

from simgen.drawn.composition import (
    REFERENCE_MM,
    box_of,
    card,
    colour,
    drawn_scene,
    noise,
    pattern,
    placed,
    plain,
    planes_apart,
    solid,
    two_planes,
)
from simgen.spec.scene import Scene


def drawn_cards(random: Random) -> Scene:
    """16 to 40 small cards at three depths, over and under one another."""
    planes = [470, 550, 650]
    colours = [colour(random, 0.3, 0.7) for _ in planes]
    objects = []
    for position in range(random.randrange(16, 41)):
        layer = random.randrange(len(planes))
        z, scale = planes[layer], planes[layer] / REFERENCE_MM
        height = random.uniform(12, 40) * scale
        shape = card(height * random.uniform(1, 2.2), height)
        x, y = (random.uniform(-120, 120) * scale for _ in range(2))
        # Most are of their layer's colour; some of any, some plain.
        own = colours[layer] if random.random() < 0.6 else colour(random, 0.3, 0.7)
        material = noise(random, own) if random.random() < 0.8 else plain(random)
        turned = random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(0, 180)
        place = x, y, z + random.uniform(-6, 6)
        objects.append(placed(f"card-{position}", place, turned, shape, material))
    return drawn_scene(random, "Drawn: cards", objects, planes)


def drawn_room(random: Random) -> Scene:
    """Two or three solids before a wall of detail, on a desk or not: the film is bright all over."""
    planes, wall = planes_apart(random, random.choice([2, 2, 3])), 760
    objects = []
    for position, z in enumerate(planes):
        radius, scale = random.uniform(26, 42), z / REFERENCE_MM
        x, y = random.uniform(-90, 90) * scale, (30 - 0.2 * radius) * scale + random.uniform(-60, 0)
        place = x, y, z + 0.6 * radius * scale
        objects.append(solid(random, f"solid-{position}", place, radius * scale, pattern(random)))
    upright = 0.0, 0.0, 0.0
    detail = noise(random, colour(random, 0.3, 0.7))
    objects.append(placed("wall", (0.0, 0.0, wall + 1.0), upright, card(1000, 1000), detail))
    if random.random() < 0.5:
        top = noise(random, colour(random, 0.3, 0.7))
        objects.append(placed("desk", (0.0, 205.0, 595.0), upright, box_of(800, 240, 320), top))
    return drawn_scene(random, "Drawn: room", objects, [*planes, wall], backdrop=None)


def drawn_leaves(random: Random) -> Scene:
    """A thing of detail behind 24 to 48 small leaves, all of them of one material."""
    near, far = planes = two_planes(random)
    radius, scale = random.uniform(50, 70), far / REFERENCE_MM
    place = random.uniform(-20, 20) * scale, random.uniform(-20, 20) * scale, far + 0.6 * radius * scale
    objects = [solid(random, "thing", place, radius * scale, pattern(random))]
    green, scale = noise(random, colour(random, 0.3, 0.7)), near / REFERENCE_MM
    for position in range(random.randrange(24, 49)):
        long = random.uniform(14, 32) * scale
        shape = card(long, long * random.uniform(0.4, 0.8))
        x, y = (random.uniform(-100, 100) * scale for _ in range(2))
        turned = random.uniform(-40, 40), random.uniform(-40, 40), random.uniform(0, 180)
        place = x, y, near + random.uniform(-12, 12)
        objects.append(placed(f"leaf-{position}", place, turned, shape, green))
    return drawn_scene(random, "Drawn: leaves", objects, planes)
