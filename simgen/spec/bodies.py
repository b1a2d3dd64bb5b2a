"""How far a shape reaches in its pose: bounding sphere and bounding box, without a renderer."""

import math
from dataclasses import dataclass

from simgen.spec.shapes import Box, Card, Cylinder, Mesh, Shape, Sphere

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Body:
    """What an object takes of the world, in mm, about its position."""

    centre_mm: Triple
    radius_mm: float
    """Of the bounding sphere."""
    reach_mm: Triple
    """From the middle to the sides of the bounding box along X, Y and Z."""


def body_of(shape: Shape, position_mm: Triple, rotation_deg: Triple) -> Body | None:
    """The body of a shape in its pose; None for a mesh, which is known only from its file."""
    across, along, away = (_row(axis, rotation_deg) for axis in range(3))
    match shape:
        case Sphere():
            radius = shape.radius_mm
            reach = radius, radius, radius
        case Card() | Box():
            halves = (
                shape.width_mm / 2,
                shape.height_mm / 2,
                (0 if isinstance(shape, Card) else shape.depth_mm / 2),
            )
            radius = math.hypot(*halves)
            reach = tuple(
                sum(abs(part) * half for part, half in zip(row, halves, strict=True))
                for row in (across, along, away)
            )
        case Cylinder():
            radius = math.hypot(shape.radius_mm, shape.length_mm / 2)
            reach = tuple(
                abs(row[1]) * shape.length_mm / 2 + math.hypot(row[0], row[2]) * shape.radius_mm
                for row in (across, along, away)
            )
        case Mesh():
            return None
    return Body(position_mm, radius, (reach[0], reach[1], reach[2]))


def _row(axis: int, rotation_deg: Triple) -> Triple:
    """A row of the matrix that turns about the fixed X, then Y, then Z axis: Rz Ry Rx."""
    (cx, cy, cz), (sx, sy, sz) = (
        [turn(math.radians(angle)) for angle in rotation_deg] for turn in (math.cos, math.sin)
    )
    rows = (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )
    return rows[axis]
