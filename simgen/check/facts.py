"""A finding, and the facts that findings rest on: what a coarse look at a recipe's scene shows."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.types import CameraGrid
from simgen.cameras import apart_px
from simgen.dataset import Prepared
from simgen.photons import Plan

MAX_PLANE_BLUR_PX = 2.0
"""Where a recipe names no planes, objects within this blur share one."""


@dataclass(frozen=True)
class Finding:
    """What was looked at, in one sentence: a verdict, the subject, the text, and what to change."""

    verdict: Literal["ok", "warn", "bad"]
    subject: str
    text: str
    remedy: str = ""

    def line(self) -> str:
        """The finding on one line, with its remedy after an arrow."""
        remedy = f" -> {self.remedy}" if self.remedy else ""
        return f"{self.verdict:<4}  {self.subject:<10}  {self.text}{remedy}"


@dataclass(frozen=True, eq=False)
class ObjectFacts:
    """What the probe shows of one object.

    From the virtual centre: depths `z_mm` (P,) of the pixels that see it, their share of the film, its share
    (C,) of the light in each colour, and whether it ends at the film's border. `body_z_mm` are the nearest
    and farthest depth of its bounding box, of what is hidden too. `corners_seeing` corner cameras see any of
    it, and `corners_seeing_all` see it without its ending at the border of their films.
    """

    name: str
    z_mm: np.ndarray
    film_share: float
    light_share: np.ndarray
    body_z_mm: tuple[float, float]
    corners_seeing: int = 4
    corners_seeing_all: int = 4
    is_cut_at_centre: bool = False
    shines: bool = False
    is_scored: bool = True

    @cached_property
    def middle_mm(self) -> float:
        """Median of the depths that are seen."""
        return float(np.median(self.z_mm))


@dataclass(frozen=True, eq=False)
class Facts:
    """What the findings rest on: a recipe with its scene, a coarse look at it, and a plan of the counts.

    Of the virtual centre's image: mean `luminance` in cd/m^2 (in spectral mode what its pixels see), shares
    (C,) of its light that the pixels of each colour get, which sum to 1, and by what is no object its shares
    (C,) of the light in each colour. `corners` is the number of corner cameras: 4, or fewer of a single row;
    `lamps_away` are the lamps, from 1, that shine away from all objects. `plan` is None if the recipe wants
    no counts. The probe took `path_s` for a light path and `hit_s` for a first hit.
    """

    target: Prepared
    objects: tuple[ObjectFacts, ...]
    corners: int
    luminance: float
    colour_share: np.ndarray
    other_shares: Mapping[str, np.ndarray]
    lamps_away: tuple[int, ...]
    plan: Plan | None
    path_s: float
    hit_s: float
    is_compiled: bool
    memory_bytes: float

    @cached_property
    def grid(self) -> CameraGrid:
        """The recipe's cameras."""
        return self.target.recipe.grid.camera_grid()

    @property
    def visible_objects(self) -> tuple[ObjectFacts, ...]:
        """The objects that the virtual centre sees."""
        return tuple(thing for thing in self.objects if thing.z_mm.size)

    @property
    def scored(self) -> tuple[ObjectFacts, ...]:
        """The visible objects that count in scores."""
        return tuple(thing for thing in self.visible_objects if thing.is_scored)

    @cached_property
    def planes_mm(self) -> tuple[float, ...]:
        """Depths to look at: those of the recipe, else of what is scored, each in focus at one of them."""
        planes: list[float] = []
        for middle_mm in sorted(thing.middle_mm for thing in self.scored):
            if not planes or apart_px(self.grid, planes[-1], middle_mm) > MAX_PLANE_BLUR_PX:
                planes.append(float(round(middle_mm)) or middle_mm)
        return self.target.recipe.analysis.z_mm or tuple(planes)


def listed(names: list[str], most: int = 6) -> str:
    """`a, b and 3 more`."""
    text = ", ".join(names[:most])
    return text if len(names) <= most else f"{text} and {len(names) - most} more"
