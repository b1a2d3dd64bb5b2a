"""A scene of another program, whatever its format: objects, lamps, cameras, and where it stands in ours."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pcii.base import InputError
from simgen.assets import Triangles

UPRIGHT = np.diag([1.0, -1.0, -1.0, 1.0])
"""From X right, Y up, Z towards who looks, as models stand, to X right, Y down, Z forward; and back."""


class Part(NamedTuple):
    """One object: triangles in their own axes, and a matrix (4, 4) from these to the axes of the file.

    Parts with the same triangles share a file, which is called by the `stem` of the first. The material is as
    in a scene.toml.
    """

    name: str
    matrix: np.ndarray
    triangles: Triangles
    stem: str
    material: dict[str, Any]


class ForeignScene:
    """All that is taken from a file, in its own axes: X right, Y up, Z towards who looks.

    Matrices are (4, 4) float64, of columns (x, y, z, 1), from own axes to those of the file.
    """

    def __init__(self, path: Path, unit_mm: float) -> None:
        self.path, self.unit_mm = path, unit_mm
        self.parts: list[Part] = []
        self.lamps: list[tuple[np.ndarray, dict[str, Any]]] = []
        """Lights that stand at the origin of their axes and shine along +Z: matrix, and values as in a
        scene.toml but for position, target and direction."""
        self.cameras: dict[str, tuple[np.ndarray, float | None]] = {}
        """By name: matrix from axes X right, Y down, Z forward, and horizontal angle of view in degrees."""
        self.left_out: dict[str, None] = {}
        """Names of what the file says and the scene does not have, in order and each once."""
        self.images: dict[str, np.ndarray] = {}
        """Pictures by the file name that materials of the scene use."""

    def lose(self, what: str) -> None:
        """Name what the scene does not have."""
        self.left_out[what] = None

    def bounds(self, matrix: np.ndarray) -> np.ndarray:
        """The bounding box (2, 3) of all parts, smallest and largest, in axes to which a matrix leads."""
        ends = []
        for part in self.parts:
            to_axes = matrix @ part.matrix
            points = part.triangles.positions.astype(np.float64) @ to_axes[:3, :3].T + to_axes[:3, 3]
            ends += [points.min(axis=0), points.max(axis=0)]
        return np.array([np.min(ends, axis=0), np.max(ends, axis=0)])

    def placement(
        self, camera: str | None, place_at_mm: Sequence[float] | None, fit_mm: float | None
    ) -> tuple[np.ndarray, str | None]:
        """The matrix from the file's axes to the world's, in mm, and the camera that stands at its origin.

        A camera of the file becomes the virtual centre, or the middle of the scene's bounding box comes to
        `place_at_mm`, upright. `fit_mm` makes the longest side of that box so long. Raises `InputError` for a
        scene without a surface, and unless one camera or a place is chosen.
        """
        if not self.parts:
            reasons = "".join(f"; not represented: {what}" for what in self.left_out)
            raise InputError(f"{self.path}: there is no surface in it{reasons}")
        box = self.bounds(UPRIGHT)
        scale = self.unit_mm if fit_mm is None else fit_mm / float(np.ptp(box, axis=0).max())
        to_world = np.eye(4)
        if place_at_mm is not None:
            to_world[:3, :3] = scale * UPRIGHT[:3, :3]
            to_world[:3, 3] = np.array(place_at_mm) - scale * box.mean(axis=0)
            return to_world, None
        if camera is None and len(self.cameras) == 1:
            (camera,) = self.cameras
        if camera not in self.cameras:
            if self.cameras:
                raise InputError(
                    f"--camera: {self.path} has the cameras {', '.join(self.cameras)}; choose one"
                )
            x, y, z = scale * np.ptp(box, axis=0)
            raise InputError(
                f"--place-at-mm: {self.path} has no camera; say where the middle of its {x:.4g} x "
                f"{y:.4g} x {z:.4g} mm stands, such as --place-at-mm 0 0 {round(2 * max(x, y) + z / 2, -1):g}"
            )
        # The camera's axes may also be scaled: Z forward is kept, then Y down.
        matrix = self.cameras[camera][0]
        forward = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        right = np.cross(matrix[:3, 1], forward)
        right /= np.linalg.norm(right)
        to_world[:3, :3] = scale * np.stack([right, np.cross(forward, right), forward])
        to_world[:3, 3] = -to_world[:3, :3] @ matrix[:3, 3]
        return to_world, camera
