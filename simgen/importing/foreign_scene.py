"""What a scene file of another program says, in its own axes and unit."""

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from simgen.assets.triangles import Triangles
from simgen.spec.shapes import Shape

LONGEST_STEM = 100


@dataclass(frozen=True, eq=False)
class Part:
    """One object: a shape in its own axes, and where it stands."""

    name: str
    matrix: np.ndarray
    """(4, 4) float64, from the axes of the shape to those of the file; positions are columns."""
    shape: Triangles | Shape
    """Triangles in the file's unit, or a sphere, card or box whose millimetres are the file's unit."""
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
class Surroundings:
    """Light from all around as an image (H, 2 H, 3), linear sRGB, in the axes of `EnvironmentLight`."""

    matrix: np.ndarray
    """(4, 4), from those axes (X right, Y down, Z ahead) to the file's."""
    pixels: np.ndarray
    luminance_cd_m2: float


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
    surroundings: Surroundings | None = None
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
