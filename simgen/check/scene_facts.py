"""What a coarse look at a scene shows, and what follows from it: the types of `simgen check`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.core.camera_grid import CameraGrid
from simgen.cameras.disparities import apart_px
from simgen.dataset.resources import Needs
from simgen.photons.counting_plan import Plan
from simgen.spec.lights import Level
from simgen.spec.recipe import Analysis, Photons, Render, Sensor

Verdict = Literal["ok", "note", "warn", "bad"]
Elsewhere = Literal["backdrop", "a lamp in view", "nothing"]

PLANES_APART_PX = 2.0
"""Where a recipe names no planes, objects within this blur share one."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: a verdict, what it is about, what was found, what to change."""

    verdict: Verdict
    subject: str
    text: str
    remedy: str = ""

    def line(self) -> str:
        """The finding on one line, with its remedy after an arrow."""
        return f"{self.verdict:<4}  {self.subject:<11}  {self.text}" + (
            f" -> {self.remedy}" if self.remedy else ""
        )


@dataclass(frozen=True)
class OnFilm:
    """Where an object's bounding box falls."""

    size_px: tuple[float, float]
    """Columns and rows that it covers of the virtual centre's film, however far that reaches."""
    in_view: bool
    """Whether part of it falls on the film of the virtual centre or of a corner camera."""


@dataclass(frozen=True, eq=False)
class ObjectFacts:
    """What is known of one object. Shares are of the film, of the object, or of the photons of a view."""

    name: str
    z_mm: np.ndarray
    """Depths (P,) of the probe's pixels that see it from the virtual centre."""
    film_share: float
    """Share of the virtual centre's pixels that see it."""
    light_share: np.ndarray
    """Share (C,) of the light in each colour of the virtual centre's image that comes from it."""
    corners_seen: int = 4
    """Corner cameras that see any of it."""
    corners_cut: int = 0
    """Corner cameras at whose film's border it is cut."""
    centre_cut: bool = False
    """Whether the virtual centre's film cuts it too."""
    body_z_mm: tuple[float, float] = (0.0, 0.0)
    """Nearest and farthest depth of its bounding box, of what is hidden too."""
    stands_at_mm: float = math.inf
    """The scene's depth of its origin."""
    on_film: OnFilm | None = None
    """Where its bounding box falls."""
    encloses_camera: bool = False
    """Whether a camera stands in its bounding box and sees nothing else."""
    shines: bool = False
    """Whether it is a lamp, too."""

    @cached_property
    def middle_mm(self) -> float:
        """Median of the depths that are seen."""
        return float(np.median(self.z_mm))


@dataclass(frozen=True, eq=False)
class Facts:
    """What the findings rest on: parts of a recipe, a coarse probe of its scene, and a plan."""

    grid: CameraGrid
    sensor: Sensor
    photons: Photons
    render: Render
    analysis: Analysis
    needs: Needs
    objects: tuple[ObjectFacts, ...]
    luminance: float
    """Mean luminance of the virtual centre's image in cd/m^2; in spectral mode what its pixels see."""
    colour_share: np.ndarray
    """Share (C,) of that image's light that the pixels of each colour get; sums to 1."""
    elsewhere: Mapping[Elsewhere, np.ndarray]
    """Share (C,) of the light in each colour that comes from none of the objects."""
    plan: Plan | None
    """How the counts will be made; None if the recipe wants none."""
    path_s: float
    """Seconds that the probe took for a light path."""
    hit_s: float
    """Seconds that the probe took for a first hit."""
    compiled: bool = True
    """Whether a compiled backend renders."""
    memory_bytes: float = math.inf
    """Memory of this machine that is available."""
    disk_bytes: float = math.inf
    """What is left on the disk of the working directory."""
    corners: int = 4
    """Corner cameras: fewer for a single row or column."""
    lamps_away: tuple[int, ...] = ()
    """Lamps, from 1, that shine away from all objects."""
    level: Level | None = None
    gain: float = 1.0
    """By how much the level makes lights brighter than they say."""
    glass: tuple[str, ...] = ()
    """Names of the objects that are of glass."""
    backdrop_mm: float | None = None
    probe_px: tuple[int, int] = (256, 256)
    """Rows and columns of the probe's film."""

    @property
    def seen(self) -> tuple[ObjectFacts, ...]:
        """The objects that the virtual centre sees."""
        return tuple(thing for thing in self.objects if thing.z_mm.size)

    @cached_property
    def planes_mm(self) -> tuple[float, ...]:
        """Depths to look at: those of the recipe, else the objects', each in focus at one of them."""
        planes: list[float] = []
        for middle_mm in sorted(thing.middle_mm for thing in self.seen):
            if not planes or apart_px(self.grid, planes[-1], middle_mm) > PLANES_APART_PX:
                planes.append(float(round(middle_mm)) or middle_mm)
        return self.analysis.z_mm or tuple(planes)


def listed(names: list[str], most: int = 6) -> str:
    """`a, b and 3 more`."""
    text = ", ".join(names[:most])
    return text if len(names) <= most else f"{text} and {len(names) - most} more"
