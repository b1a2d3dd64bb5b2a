"""The renderer's own axes and unit of length, which are those of a Mitsuba file if the scene refers to one.

The file is rendered as it is: cameras, and what else stands in the scene, are brought to its axes. To move
the file's shapes instead would be wrong, since not all of Mitsuba's plugins are right in every pose (in 3.9
`sdfgrid` is cut off where it is turned, and curves keep their radius when they are scaled).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class WorldFrame:
    """The similarity from the world (X right, Y down, Z forward, mm) to the renderer's axes and unit.

    A point p_mm is at `unit` R p_mm + `origin`; `unit` is that of the world, one millimetre, in the
    renderer's.
    """

    rotation: np.ndarray
    unit: float
    origin: np.ndarray

    @cached_property
    def is_world(self) -> bool:
        """Whether nothing changes, so that numbers stay what they are to the last bit."""
        return bool(self.unit == 1 and (self.rotation == np.eye(3)).all() and not self.origin.any())

    @cached_property
    def matrix(self) -> np.ndarray:
        """(4, 4), of columns (x, y, z, 1) in mm."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.unit * self.rotation, self.origin
        return matrix

    def points(self, points_mm: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world in the renderer's axes and unit."""
        return points_mm if self.is_world else self.unit * points_mm @ self.rotation.T + self.origin

    def directions(self, directions: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the world in the renderer's axes."""
        return directions if self.is_world else directions @ self.rotation.T

    def points_mm(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the renderer in the world."""
        return points if self.is_world else (points - self.origin) @ self.rotation / self.unit

    def world_directions(self, directions: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the renderer in the world's axes."""
        return directions if self.is_world else directions @ self.rotation

    def z_mm(self, point: Any) -> Any:
        """Planar depth of the renderer's own points, as one of its arrays or as a number."""
        if self.is_world:
            return point.z
        x, y, z = (float(part) for part in self.rotation[:, 2] / self.unit)
        # The origin first: of far points little is left over.
        a, b, c = (float(part) for part in self.origin)
        return x * (point.x - a) + y * (point.y - b) + z * (point.z - c)

    def placed(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """Rays of the world, as the renderer's points and vectors, in its axes and unit."""
        if self.is_world:
            return origin, direction

        def turned(vector: Any, factor: float, shift: np.ndarray) -> list[Any]:
            rows = (factor * self.rotation).tolist()
            return [
                row[0] * vector.x + row[1] * vector.y + row[2] * vector.z + float(part)
                for row, part in zip(rows, shift, strict=True)
            ]

        placed_origin = type(origin)(*turned(origin, self.unit, self.origin))
        return placed_origin, type(direction)(*turned(direction, 1.0, np.zeros(3)))


WORLD = WorldFrame(np.eye(3), 1.0, np.zeros(3))
"""Of scenes that refer to no Mitsuba file."""
