"""The coarse probe of `simgen check`: what few, large pixels of the centre and of the corner cameras see."""

import itertools
import shutil
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.core.bayer import channel_count, colour_cells
from pcii.core.camera_grid import CameraGrid
from pcii.core.photon_limit import sense
from simgen.base import random_streams as seeds
from simgen.cameras.rig import Camera, as_rig, centre_camera, corners, with_larger_pixels
from simgen.check.scene_facts import Elsewhere, Facts, ObjectFacts, OnFilm
from simgen.dataset.prepared import Prepared
from simgen.dataset.resources import available_bytes
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.radiance import render_view
from simgen.spec.lights import AreaLight, SpotLight
from simgen.spec.materials import is_clear
from simgen.spec.scene import Scene
from simgen.truth.first_hits import FirstHits, first_hits_at_centre, first_hits_of_view

SIDE_PX, SCALAR_SIDE_PX = 512, 256
"""Longer side of the probe's film with a compiled backend and without one."""
SAME_DEPTH = 1e-3
"""This near to the backdrop's depth, as a share of it, a hit is taken to be on it."""
SAMPLES = 4


@dataclass(frozen=True, eq=False)
class _Look:
    """A scene on a coarse film: its picture in the sensor's colours, and what is hit first.

    `boxes` are the objects' bounding boxes by number.
    """

    target: Prepared
    render_scene: RenderScene
    grid: CameraGrid
    image: np.ndarray
    centre: FirstHits
    corners: dict[tuple[int, int], FirstHits]
    boxes: dict[int, np.ndarray]


def probe_scene(target: Prepared) -> Facts:
    """Look at a recipe's scene. Raises `InputError` for assets or budgets that cannot be used."""
    recipe, scene, compiled = target.recipe, target.scene, backend.choose().kind != "scalar"
    render_scene, grid = target.render_scene(), recipe.grid.camera_grid()
    made = target.plan(render_scene) if recipe.products.counts else None
    small = coarser(grid, SIDE_PX if compiled else SCALAR_SIDE_PX)
    image, path_s = _picture(render_scene, small, recipe.cfa, recipe.seed)
    centre = first_hits_at_centre(render_scene, small)
    begun = time.perf_counter()
    ends = {(k, l): first_hits_of_view(render_scene, small, k, l) for k, l in corners(grid)}
    hit_s = (time.perf_counter() - begun) / (len(ends) * centre.z_mm.size)
    boxes = _boxes(render_scene)
    look = _Look(target, render_scene, small, image, centre, ends, boxes)
    light = image.sum(axis=(0, 1))
    return Facts(
        grid=grid,
        sensor=recipe.sensor,
        photons=recipe.photons,
        render=recipe.render,
        analysis=recipe.analysis,
        needs=target.needs,
        objects=tuple(_object_facts(look, number, name) for number, name in render_scene.names.items()),
        luminance=float(image.mean() if render_scene.filters is not None else sense(image, None).mean()),
        colour_share=_colour_share(light, recipe.cfa),
        elsewhere={
            place: _share(image[mask].sum(axis=0), light) for place, mask in _elsewhere(scene, centre).items()
        },
        plan=made,
        path_s=path_s,
        hit_s=hit_s,
        compiled=compiled,
        memory_bytes=available_bytes(),
        disk_bytes=shutil.disk_usage(Path()).free,
        corners=len(ends),
        lamps_away=_lamps_away(scene, list(boxes.values())),
        level=scene.level,
        gain=render_scene.gain,
        glass=tuple(thing.name for thing in scene.objects if is_clear(thing.material.finish)),
        backdrop_mm=None if scene.backdrop is None else scene.backdrop.z_mm,
        probe_px=(small.height, small.width),
    )


def coarser(grid: CameraGrid, side_px: int) -> CameraGrid:
    """The same cameras with the same field of view on at most so many pixels to a side."""
    return with_larger_pixels(grid, max(1.0, max(grid.height, grid.width) / side_px), least_px=1)


def _picture(
    render_scene: RenderScene, grid: CameraGrid, cfa: str | None, seed: int
) -> tuple[np.ndarray, float]:
    """Radiance in the sensor's colours (H, W, C) from the virtual centre, and seconds for a path."""
    single = replace(grid, rows=1, cols=1)
    total, spent = np.zeros((grid.height, grid.width, 1)), 0.0
    for part in range(2):  # the first compiles, the second is timed
        path_seed = seeds.integer(seed, stage="check probe", part=part)
        begun = time.perf_counter()
        total = total + render_view(render_scene, single, 0, 0, samples_per_pixel=SAMPLES, seed=path_seed) / 2
        spent = time.perf_counter() - begun
    image = total if cfa is not None else sense(total, None)[..., None]
    return image, spent / (SAMPLES * grid.height * grid.width)


def _object_facts(look: _Look, number: int, name: str) -> ObjectFacts:
    target, box, here = look.target, look.boxes.get(number), look.centre.object_id == number
    masks = {camera: hits.object_id == number for camera, hits in look.corners.items()}
    full = [camera for camera, mask in masks.items() if mask.all()]
    own_objects = target.scene.objects
    stands_at_mm = own_objects[number - 1].position_mm[2] if number <= len(own_objects) else np.inf
    return ObjectFacts(
        name=name,
        z_mm=look.centre.z_mm[here].astype(np.float64),
        film_share=float(here.mean()),
        light_share=_share(look.image[here].sum(axis=0), look.image.sum(axis=(0, 1))),
        corners_seen=sum(bool(mask.any()) for mask in masks.values()),
        corners_cut=sum(_at_border(mask) for mask in masks.values()),
        centre_cut=_at_border(here),
        body_z_mm=(0.0, 0.0) if box is None else (float(box[0, 2]), float(box[1, 2])),
        stands_at_mm=stands_at_mm,
        on_film=None if box is None else on_film(box, target.recipe.grid.camera_grid()),
        shines=any(number == one.number for one in look.render_scene.shining),
        encloses_camera=box is not None and any(_holds(box, look.grid, *camera) for camera in full),
    )


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    return np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)


def _colour_share(light: np.ndarray, cfa: str | None) -> np.ndarray:
    pixels = np.bincount(colour_cells(cfa).ravel(), minlength=channel_count(cfa))
    weight = light * pixels
    return weight / weight.sum() if weight.sum() > 0 else pixels / pixels.sum()


def _elsewhere(scene: Scene, hits: FirstHits) -> dict[Elsewhere, np.ndarray]:
    """Masks (H, W) of what the centre sees that is no object."""
    other, hit, on_wall = hits.object_id == 0, np.isfinite(hits.z_mm), on_backdrop(scene, hits.z_mm)
    return {"backdrop": other & on_wall, "a lamp in view": other & hit & ~on_wall, "nothing": other & ~hit}


def _at_border(mask: np.ndarray) -> bool:
    return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())


def _boxes(render_scene: RenderScene) -> dict[int, np.ndarray]:
    """Bounding boxes (2, 3) of the objects, smallest and largest X, Y, Z in mm."""
    parts: dict[int, list[np.ndarray]] = {}
    for number, shape in zip(
        backend.shape_numbers(render_scene.scene), render_scene.scene.shapes(), strict=True
    ):
        bounds: Any = shape.bbox()
        corners = np.array([np.ravel(bounds.corner(number)) for number in range(8)], dtype=np.float64)
        corners_mm = render_scene.frame.points_mm(corners)
        box = np.array([corners_mm.min(axis=0), corners_mm.max(axis=0)])
        parts.setdefault(int(render_scene.object_of_shape[number]), []).append(box)
    return {
        number: np.array([np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)])
        for number, boxes in parts.items()
        if number > 0
    }


def _holds(box: np.ndarray, grid: CameraGrid, k: int, l: int) -> bool:
    place = as_rig(grid).camera(k, l).position_mm
    return bool(np.all((box[0] <= place) & (place <= box[1])))


def _lamps_away(scene: Scene, boxes: Iterable[np.ndarray]) -> tuple[int, ...]:
    """Lamps, from 1, behind whose face all objects stand."""
    choices = itertools.product((0, 1), repeat=3)
    corners = [[[box[c, a] for a, c in enumerate(choice)] for box in boxes] for choice in choices]
    points = np.array(corners, dtype=np.float64).reshape(-1, 3)
    away = []
    for number, lamp in enumerate(scene.lights, start=1):
        if isinstance(lamp, AreaLight | SpotLight) and points.size:
            facing = np.subtract(lamp.target_mm, lamp.position_mm)
            if np.all((points - lamp.position_mm) @ facing <= 0):
                away.append(number)
    return tuple(away)


def on_backdrop(scene: Scene, z_mm: np.ndarray) -> np.ndarray:
    """Which first hits at these depths, +inf for none, are so near the backdrop that they are on it; bool."""
    if scene.backdrop is None:
        return np.zeros(z_mm.shape, dtype=bool)
    wall_mm = scene.backdrop.z_mm
    return np.abs(z_mm - wall_mm) <= SAME_DEPTH * wall_mm


def on_film(box: np.ndarray, grid: CameraGrid) -> OnFilm:
    """Where a bounding box (2, 3), smallest and largest X, Y, Z in mm, falls on the films."""
    if box[0, 2] <= 0:
        return OnFilm((np.inf, np.inf), in_view=True)
    rig, centre = as_rig(grid), centre_camera(grid)
    ends = [rig.camera(k, l) for k, l in corners(grid)]
    points = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
    across, down = np.ptp(centre.film_px(points), axis=0).tolist()
    return OnFilm((across, down), any(_meets(points, one) for one in (centre, *ends)))


def _meets(points: np.ndarray, camera: Camera) -> bool:
    """Whether the outline of points reaches onto the film."""
    px, half = camera.film_px(points), np.array([camera.grid.width, camera.grid.height]) / 2
    return bool(np.all(px.min(axis=0) < half) and np.all(px.max(axis=0) > -half))
