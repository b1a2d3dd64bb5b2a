"""A finding, and the coarse look at a scene that all findings rest on: few, large pixels of the centre and
the corner cameras."""

import itertools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.types import CameraGrid, channel_count, colour_cells, sense
from simgen.base import random_streams as seeds
from simgen.cameras import apart_px, coarser, corners
from simgen.dataset import Prepared, available_bytes
from simgen.photons import Plan
from simgen.renderer import RenderScene, backend, render_view
from simgen.spec import AreaLight, EnvironmentLight, Scene, SpotLight, UniformLight
from simgen.truth import FirstHits, first_hits_at_centre, first_hits_of_view

SIDE_PX, SCALAR_SIDE_PX = 512, 256
"""Longer side of the probe's film with a compiled backend and without one."""
SAMPLES = 4
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


def probe_scene(target: Prepared) -> Facts:
    """Look at a recipe's scene. Raises `InputError` for assets or budgets that cannot be used."""
    recipe, is_compiled = target.recipe, backend.choose().kind != "scalar"
    render_scene, grid = target.render_scene(), recipe.grid.camera_grid()
    plan = target.plan(target.capture(render_scene)) if recipe.products.counts else None
    side_px = SIDE_PX if is_compiled else SCALAR_SIDE_PX
    coarse = coarser(grid, side_px)
    # As many paths on a small film, or the start of a rendering would be taken for the time of its paths.
    samples = max(SAMPLES, round(SAMPLES * side_px**2 / (coarse.height * coarse.width)))
    image, path_s = _picture(render_scene, coarse, recipe.cfa, recipe.seed, samples)
    centre = first_hits_at_centre(render_scene, coarse)
    start_s = time.perf_counter()
    corner_hits = [first_hits_of_view(render_scene, coarse, k, l) for k, l in corners(grid)]
    hit_s = (time.perf_counter() - start_s) / (len(corner_hits) * centre.z_mm.size)
    boxes_mm = _boxes_mm(render_scene)
    pixels = np.bincount(colour_cells(recipe.cfa).ravel(), minlength=channel_count(recipe.cfa))
    weight = image.sum(axis=(0, 1)) * pixels
    return Facts(
        target=target,
        objects=_object_facts(render_scene, image, centre, corner_hits, boxes_mm),
        corners=len(corner_hits),
        luminance=float(image.mean() if render_scene.filters is not None else sense(image, None).mean()),
        colour_share=weight / weight.sum() if weight.sum() > 0 else pixels / pixels.sum(),
        other_shares=_other_shares(target.scene, centre, image),
        lamps_away=_lamps_away(target.scene, list(boxes_mm.values())),
        plan=plan,
        path_s=path_s,
        hit_s=hit_s,
        is_compiled=is_compiled,
        memory_bytes=available_bytes(),
    )


def _object_facts(
    render_scene: RenderScene,
    image: np.ndarray,
    centre: FirstHits,
    corner_hits: Sequence[FirstHits],
    boxes_mm: Mapping[int, np.ndarray],
) -> tuple[ObjectFacts, ...]:
    """What the picture (H, W, C) and the first hits of the virtual centre and the corners show of each."""
    light, shining = image.sum(axis=(0, 1)), {surface.number for surface in render_scene.shining}
    objects: list[ObjectFacts] = []
    for number, name in render_scene.names.items():
        mask, views = centre.object_id == number, [hits.object_id == number for hits in corner_hits]
        near_mm, far_mm = boxes_mm[number][:, 2].tolist() if number in boxes_mm else (math.inf, math.inf)
        facts = ObjectFacts(
            name=name,
            z_mm=centre.z_mm[mask].astype(np.float64),
            film_share=float(mask.mean()),
            light_share=_share(image[mask].sum(axis=0), light),
            body_z_mm=(near_mm, far_mm),
            corners_seeing=sum(bool(view.any()) for view in views),
            corners_seeing_all=sum(bool(view.any()) and not _is_cut(view) for view in views),
            is_cut_at_centre=_is_cut(mask),
            shines=number in shining,
            is_scored=number not in render_scene.unscored,
        )
        objects.append(facts)
    return tuple(objects)


def _picture(
    render_scene: RenderScene, grid: CameraGrid, cfa: str | None, seed: int, samples: int
) -> tuple[np.ndarray, float]:
    """Radiance in the sensor's colours (H, W, C) from the virtual centre, and seconds for a path."""
    single = replace(grid, rows=1, cols=1)
    image, path_s = np.zeros((grid.height, grid.width, 1)), 0.0
    for part in range(2):  # the first compiles, the second is timed
        path_seed = seeds.integer(seed, stage="check probe", part=part)
        start_s = time.perf_counter()
        image = image + render_view(render_scene, single, 0, 0, samples_per_pixel=samples, seed=path_seed) / 2
        path_s = (time.perf_counter() - start_s) / (samples * grid.height * grid.width)
    return (image if cfa is not None else sense(image, None)[..., None]), path_s


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    return np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)


def _other_shares(scene: Scene, centre: FirstHits, image: np.ndarray) -> dict[str, np.ndarray]:
    """Shares (C,) of the light in each colour of what is no object, by its name."""
    wall_mm, is_other = math.nan if scene.backdrop is None else scene.backdrop.z_mm, centre.object_id == 0
    is_wall = is_other & np.isclose(centre.z_mm, wall_mm, rtol=1e-5)
    masks = {"the backdrop": is_wall, "lamps in view": is_other & np.isfinite(centre.z_mm) & ~is_wall}
    around = [lamp for lamp in scene.lights if isinstance(lamp, EnvironmentLight | UniformLight)]
    if scene.mitsuba is not None or any(lamp.visible for lamp in around):  # else it is that of outlines
        masks = {"what shines from all around": is_other & np.isinf(centre.z_mm), **masks}
    return {name: _share(image[mask].sum(axis=0), image.sum(axis=(0, 1))) for name, mask in masks.items()}


def _is_cut(mask: np.ndarray) -> bool:
    """Whether an object of this mask (H, W) ends at the film's border."""
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())


def _boxes_mm(render_scene: RenderScene) -> dict[int, np.ndarray]:
    """Bounding boxes (2, 3) of the objects by number, smallest and largest X, Y, Z in mm."""
    object_of_box = render_scene.object_of_shape[backend.shape_numbers(render_scene.scene)]
    numbers, corners_mm = set(object_of_box.tolist()) - {0}, render_scene.corners_mm
    parts = ((number, corners_mm[object_of_box == number].reshape(-1, 3)) for number in numbers)
    return {number: np.array([part.min(axis=0), part.max(axis=0)]) for number, part in parts}


def _lamps_away(scene: Scene, boxes_mm: list[np.ndarray]) -> tuple[int, ...]:
    """Lamps, from 1, behind whose face all objects stand."""
    if not boxes_mm:
        return ()
    points_mm, away = np.concatenate([list(itertools.product(*box.T)) for box in boxes_mm]), []
    for number, lamp in enumerate(scene.lights, start=1):
        if isinstance(lamp, AreaLight | SpotLight):
            facing = np.subtract(lamp.target_mm, lamp.position_mm)
            if np.all((points_mm - lamp.position_mm) @ facing <= 0):
                away.append(number)
    return tuple(away)
