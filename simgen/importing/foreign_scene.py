"""What a scene file of another program says, in its own axes and unit."""

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pcii.base.srgb import LUMINANCE
from simgen.assets.triangles import Triangles
from simgen.base.srgb import srgb_of
from simgen.spec.shapes import Shape

LONGEST_STEM = 100
LARGEST_CONE_DEG = 89.0
LEAST_EDGE_DEG = 0.1
"""A spot's light falls off within so many degrees at least."""


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


def light_values(field: str, rgb: np.ndarray) -> dict[str, Any]:
    """The values of a light or emission: its luminance, as `field`, and its colour, of linear sRGB (3,)."""
    values: dict[str, Any] = {field: float(f"{rgb @ LUMINANCE:.9g}")}
    if np.ptp(rgb):
        values["illuminant"] = srgb_of(rgb / rgb.max())
    return values


def cone_values(beam_deg: float, cutoff_deg: float) -> dict[str, float]:
    """The angles of a spot, within what a scene allows."""
    cutoff_deg = min(max(cutoff_deg, LEAST_EDGE_DEG), LARGEST_CONE_DEG)
    beam_deg = min(max(beam_deg, 0.0), cutoff_deg - LEAST_EDGE_DEG)
    return {"beam_deg": round(beam_deg, 6), "cutoff_deg": round(cutoff_deg, 6)}
