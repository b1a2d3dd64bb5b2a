"""What a scene file of another program says, in its own axes and unit, and where it stands in ours."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.triangles import Triangles
from simgen.base.strict_models import suggestion

MAX_STEM = 100


@dataclass(frozen=True, eq=False)
class Part:
    """One object: triangles in their own axes, and a matrix (4, 4) from these to the axes of the file.

    Parts with the same triangles share a file, which is called by the `stem` of the first. The material is as
    in a scene.toml.
    """

    name: str
    matrix: np.ndarray
    triangles: Triangles
    stem: str
    material: dict[str, Any]


@dataclass(eq=False)
class ForeignScene:
    """All that is taken from a file.

    Matrices are (4, 4) float64, of columns (x, y, z, 1), from own axes to those of the file.
    """

    path: Path
    mm: float
    """Millimetres in the file's unit."""
    upright: np.ndarray
    """(4, 4) rotation from the file's axes to X right, Y down, Z forward, for a scene without a camera."""
    parts: list[Part] = field(default_factory=list)
    lamps: list[tuple[np.ndarray, dict[str, Any]]] = field(default_factory=list)
    """Lights that stand at the origin of their axes and shine along +Z: matrix, and values as in a scene.toml
    but for position, target and direction."""
    cameras: dict[str, tuple[np.ndarray, float | None]] = field(default_factory=dict)
    """By name: matrix from axes X right, Y down, Z forward, and horizontal angle of view in degrees."""
    images: dict[str, np.ndarray] = field(default_factory=dict)
    """Pixels (H, W) or (H, W, 3), uint8 or uint16, by the file name that materials use."""
    left_out: dict[str, None] = field(default_factory=dict)
    """Names of what the file says and the scene does not have, in order and each once."""
    _files: dict[tuple[str, tuple[int, ...], bytes], str] = field(default_factory=dict)

    def keep(self, name: str, pixels: np.ndarray) -> str:
        """The file name of a picture, one for all that are the same; `name` is what it is called."""
        key = pixels.dtype.str, pixels.shape, hashlib.sha256(pixels.tobytes()).digest()
        if key not in self._files:
            stem, number = re.sub(r"[^A-Za-z0-9_-]+", "-", name)[:MAX_STEM], 1
            file = f"{stem}.png"
            while file in self.images:
                number += 1
                file = f"{stem}-{number}.png"
            self.images[file], self._files[key] = pixels, file
        return self._files[key]

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
        scene without a surface, for a camera that is not there, and for none or several of which none is
        chosen.
        """
        if not self.parts:
            reasons = "".join(f"; not represented: {what}" for what in self.left_out)
            raise InputError(f"{self.path}: there is no surface in it{reasons}")
        box = self.bounds(self.upright)
        scale = self.mm if fit_mm is None else fit_mm / float(np.ptp(box, axis=0).max())
        to_world = np.eye(4)
        if place_at_mm is None:
            camera = self._chosen(camera, scale * np.ptp(box, axis=0))
            matrix = self.cameras[camera][0]
            # The camera's axes may also be scaled: Z forward is kept, then Y down.
            forward = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
            right = np.cross(matrix[:3, 1], forward)
            right /= np.linalg.norm(right)
            to_world[:3, :3] = scale * np.stack([right, np.cross(forward, right), forward])
            to_world[:3, 3] = -to_world[:3, :3] @ matrix[:3, 3]
        else:
            to_world[:3, :3] = scale * self.upright[:3, :3]
            to_world[:3, 3] = np.array(place_at_mm) - scale * box.mean(axis=0)
        return to_world, camera

    def _chosen(self, camera: str | None, size_mm: np.ndarray) -> str:
        if camera is None and len(self.cameras) == 1:
            return next(iter(self.cameras))
        if camera in self.cameras:
            return camera
        if camera is not None:
            known = suggestion(camera, self.cameras)
            raise InputError(f"--camera: {self.path} has no camera {camera!r}{known}")
        if self.cameras:
            names = ", ".join(self.cameras)
            raise InputError(f"--camera: {self.path} has several cameras; choose one of {names}")
        x, y, z = size_mm
        raise InputError(
            f"--place-at-mm: {self.path} has no camera; say where the middle of its {x:.4g} x {y:.4g} x "
            f"{z:.4g} mm stands, such as --place-at-mm 0 0 {round(2 * max(x, y) + z / 2, -1):g}"
        )
