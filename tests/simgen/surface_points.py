"""Points of the surfaces of shapes, for tests of how far they reach."""

import numpy as np

from simgen.spec.shapes import Box, Card, Cylinder, Shape, Sphere

SHAPES: dict[str, Shape] = {
    "sphere": Sphere(radius_mm=12.0),
    "card": Card(width_mm=30.0, height_mm=12.0),
    "box": Box(width_mm=30.0, height_mm=12.0, depth_mm=7.0),
    "cylinder": Cylinder(radius_mm=9.0, length_mm=31.0),
}


def surface_points(shape: Shape) -> np.ndarray:
    """Points (N, 3) of a shape's surface among which are all that reach furthest, to a thousandth."""
    angle = np.linspace(0, 2 * np.pi, 721)
    match shape:
        case Sphere():
            around, along = np.meshgrid(angle, angle)
            points = [np.sin(around) * np.cos(along), np.sin(around) * np.sin(along), np.cos(around)]
            return shape.radius_mm * np.stack(points, axis=-1).reshape(-1, 3)
        case Card() | Box():
            depth = shape.depth_mm if isinstance(shape, Box) else 0.0
            sides = np.array([shape.width_mm, shape.height_mm, depth]) / 2
            return sides * np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
        case Cylinder():
            ring = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1) * shape.radius_mm
            along = np.array([0, shape.length_mm / 2, 0])
            return np.concatenate([ring - along, ring + along])
    raise AssertionError
