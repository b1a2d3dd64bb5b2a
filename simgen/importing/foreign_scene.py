"""What a scene file of another program says, in its own axes and unit, and where it stands in ours."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.triangles import Triangles
from simgen.base.strict_models import suggestion

LONGEST_STEM = 100


@dataclass(frozen=True, eq=False)
class Part:
    """One object: triangles in their own axes, and where they stand."""

    name: str
    matrix: np.ndarray
    """(4, 4) float64, from the axes of the triangles to those of the file; positions are columns."""
    triangles: Triangles
    """In the file's unit."""
    file: str
    """Stem of the mesh's file; parts with one stem have one mesh."""
    material: dict[str, Any]
    """As in a scene.toml."""


@dataclass(frozen=True, eq=False)
class Lamp:
    """A light at the origin of its own axes that shines along +Z."""

    matrix: np.ndarray
    values: dict[str, Any]
    """As in a scene.toml, but for position, target and direction; `intensity_cd` is in cd."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera; its axes are X right, Y down, Z forward."""

    name: str
    matrix: np.ndarray
    angle_deg: float | None
    """Its horizontal angle of view, if the file says."""


@dataclass(eq=False)
class ForeignScene:
    """All that is taken from a file."""

    title: str
    mm: float
    """Millimetres in the file's unit."""
    upright: np.ndarray
    """(3, 3) rotation from the file's axes to X right, Y down, Z forward, for a scene without a camera."""
    parts: list[Part] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    viewpoints: list[Viewpoint] = field(default_factory=list)
    images: dict[str, np.ndarray] = field(default_factory=dict)
    """Pixels (H, W) or (H, W, 3), uint8 or uint16, by the file name that materials use."""
    left_out: list[str] = field(default_factory=list)
    """What could not be represented, a clause each."""

    def keep(self, name: str, pixels: np.ndarray) -> str:
        """The file name of a picture, one for all that are the same; `name` is what it is called."""
        for known, other in self.images.items():
            if other.dtype == pixels.dtype and np.array_equal(other, pixels):
                return known
        stem, number = re.sub(r"[^A-Za-z0-9_-]+", "-", name)[:LONGEST_STEM], 1
        file = f"{stem}.png"
        while file in self.images:
            number += 1
            file = f"{stem}-{number}.png"
        self.images[file] = pixels
        return file

    def lose(self, what: str) -> None:
        """Say once what could not be represented."""
        if what not in self.left_out:
            self.left_out.append(what)


@dataclass(frozen=True, eq=False)
class Placement:
    """How the file's axes and unit become the world's, in mm."""

    rotation: np.ndarray
    """(3, 3)."""
    scale: float
    shift_mm: np.ndarray
    """(3,), added last."""
    camera: Viewpoint | None
    """The one that stands at the origin; None if the user has said where the scene stands."""

    @property
    def to_world(self) -> np.ndarray:
        """(4, 4), of columns (x, y, z, 1)."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.scale * self.rotation, self.shift_mm
        return matrix


def placement_of(
    scene: ForeignScene, camera: str | None, place_at_mm: Sequence[float] | None, fit_mm: float | None
) -> Placement:
    """Where a scene stands: a camera of the file becomes the virtual centre, or the middle of the scene's
    bounding box comes to `place_at_mm`, upright. `fit_mm` makes the longest side of that box so long.

    Raises `InputError` for a camera that is not there, for none or several of which none is chosen, and for
    options that exclude each other.
    """
    if not scene.parts:
        reasons = "".join(f"; not represented: {what}" for what in scene.left_out)
        raise InputError(f"there is no surface in it{reasons}")
    box = bounds(scene.parts, scene.upright)
    longest = float(np.ptp(box, axis=0).max())
    scale = scene.mm if fit_mm is None else fit_mm / longest
    if place_at_mm is None:
        view = _chosen(scene, camera, scale * box)
        rotation = _axes(view.matrix[:3, :3]).T
        return Placement(rotation, scale, -scale * rotation @ view.matrix[:3, 3], view)
    if camera is not None:
        raise InputError("--camera: it says where the scene stands, as does --place-at-mm; give one of them")
    return Placement(scene.upright, scale, np.array(place_at_mm) - scale * box.mean(axis=0), None)


def bounds(parts: Sequence[Part], rotation: np.ndarray) -> np.ndarray:
    """The bounding box (2, 3) of all parts, smallest and largest, in turned axes and the file's unit."""
    ends = [_ends(part, rotation) for part in parts]
    return np.array([np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)])


def _ends(part: Part, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    linear, middle = rotation @ part.matrix[:3, :3], rotation @ part.matrix[:3, 3]
    points = part.triangles.positions.astype(np.float64) @ linear.T + middle
    return points.min(axis=0), points.max(axis=0)


def _axes(matrix: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) in a camera's matrix, which may also scale: Z forward is kept, then Y down."""
    forward = matrix[:, 2] / np.linalg.norm(matrix[:, 2])
    right = np.cross(matrix[:, 1], forward)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(forward, right), forward])


def _chosen(scene: ForeignScene, camera: str | None, box_mm: np.ndarray) -> Viewpoint:
    names = [view.name for view in scene.viewpoints]
    if camera is not None:
        if camera not in names:
            raise InputError(f"--camera: the file has no camera {camera!r}{suggestion(camera, names)}")
        return scene.viewpoints[names.index(camera)]
    if len(names) == 1:
        return scene.viewpoints[0]
    if names:
        raise InputError(f"--camera: the file has {len(names)} cameras; choose one of {', '.join(names)}")
    x, y, z = np.ptp(box_mm, axis=0)
    away = round(2 * max(x, y) + z / 2, -1)
    raise InputError(
        f"--place-at-mm: the file has no camera; its {x:.4g} x {y:.4g} x {z:.4g} mm need a "
        f"place: say where its middle stands, such as --place-at-mm 0 0 {away:g}, and its size by --fit-mm"
    )
