"""The coarse probe of `simgen check`: what few, large pixels of the centre and of the corner cameras see."""

import itertools
import shutil
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.core.bayer import channel_count, colour_cells
from pcii.core.camera_grid import CameraGrid
from pcii.core.photon_limit import sense
from simgen.base import random_streams as seeds
from simgen.cameras.rig import as_rig, with_larger_pixels
from simgen.check.scene_facts import Elsewhere, Facts, ObjectFacts
from simgen.check.unseen import SAME_DEPTH, hidden_by, on_film, pixels_without_occluders
from simgen.dataset.prepared import Prepared, capture_of, least_samples, needs_of
from simgen.dataset.resources import available_bytes, fits
from simgen.photons.candidates import Setup
from simgen.photons.counting_plan import plan
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.radiance import render_view
from simgen.spec.lights import AreaLight
from simgen.spec.materials import Glass
from simgen.spec.scene import Scene
from simgen.truth.first_hits import FirstHits, first_hits_at_centre, first_hits_of_view

SIDE_PX, SCALAR_SIDE_PX = 512, 256
"""Longer side of the probe's film with a compiled backend and without one."""
ALONE_PX, SCALAR_ALONE_PX = 256, 128
"""The same where objects are looked at alone, which takes a pass for each."""
SAMPLES = 4


def probe_scene(target: Prepared) -> Facts:
    """Look at a recipe's scene. Raises `InputError` for assets or budgets that cannot be used."""
    recipe, scene, kind = target.recipe, target.scene, backend.choose().kind
    compiled = kind != "scalar"
    render_scene = target.render_scene()
    grid = recipe.grid.camera_grid()
    made = None
    needs = needs_of(recipe)
    if recipe.products.counts:
        capture = capture_of(recipe, target.seed)
        made = plan(
            capture,
            Setup(render_scene, capture.rig, recipe.cfa, recipe.render.max_depth),
            kind,
            least_samples(recipe),
            may_explore=fits(needs),
        )
    small = coarser(grid, SIDE_PX if compiled else SCALAR_SIDE_PX)
    image, path_s = _picture(render_scene, small, recipe.cfa, recipe.seed)
    centre = first_hits_at_centre(render_scene, small)
    rows, cols = {0, grid.rows - 1}, {0, grid.cols - 1}
    begun = time.perf_counter()
    corners = {
        (k, l): first_hits_of_view(render_scene, small, k, l) for k in sorted(rows) for l in sorted(cols)
    }
    hit_s = (time.perf_counter() - begun) / (len(corners) * centre.z_mm.size)
    boxes = _boxes(render_scene)
    alone = coarser(grid, ALONE_PX if compiled else SCALAR_ALONE_PX)
    together = first_hits_at_centre(render_scene, alone)
    hidden = _hidden_shares(render_scene, target, alone, boxes, together)
    light = image.sum(axis=(0, 1))
    objects = [
        _object_facts(number, name, centre, corners, image, boxes.get(number), hidden, small)
        for number, name in render_scene.names.items()
    ]
    return Facts(
        grid=grid,
        sensor=recipe.sensor,
        photons=recipe.photons,
        render=recipe.render,
        analysis=recipe.analysis,
        needs=needs,
        objects=tuple(
            replace(
                thing,
                stands_at_mm=scene.objects[number - 1].position_mm[2],
                on_film=None if number not in boxes else on_film(boxes[number], grid),
                hidden_by=()
                if thing.z_mm.size
                else hidden_by(render_scene, scene, target.folder, number, alone, together),
            )
            for number, thing in enumerate(objects, start=1)
        ),
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
        corners=len(corners),
        lamps_away=_lamps_away(scene, list(boxes.values())),
        level=scene.level,
        gain=render_scene.gain,
        glass=tuple(thing.name for thing in scene.objects if isinstance(thing.material.finish, Glass)),
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


def _object_facts(
    number: int,
    name: str,
    centre: FirstHits,
    corners: dict[tuple[int, int], FirstHits],
    image: np.ndarray,
    box: np.ndarray | None,
    hidden: dict[int, float],
    grid: CameraGrid,
) -> ObjectFacts:
    here = centre.object_id == number
    masks = [hits.object_id == number for hits in corners.values()]
    full = [camera for camera, mask in zip(corners, masks, strict=True) if mask.all()]
    return ObjectFacts(
        name=name,
        z_mm=centre.z_mm[here].astype(np.float64),
        film_share=float(here.mean()),
        light_share=_share(image[here].sum(axis=0), image.sum(axis=(0, 1))),
        hidden_share=hidden.get(number, 0.0),
        corners_seen=sum(bool(mask.any()) for mask in masks),
        corners_cut=sum(_at_border(mask) for mask in masks),
        centre_cut=_at_border(here),
        body_z_mm=(0.0, 0.0) if box is None else (float(box[0, 2]), float(box[1, 2])),
        encloses_camera=box is not None and any(_holds(box, grid, *camera) for camera in full),
    )


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    return np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)


def _colour_share(light: np.ndarray, cfa: str | None) -> np.ndarray:
    pixels = np.bincount(colour_cells(cfa).ravel(), minlength=channel_count(cfa))
    weight = light * pixels
    return weight / weight.sum() if weight.sum() > 0 else pixels / pixels.sum()


def _elsewhere(scene: Scene, hits: FirstHits) -> dict[Elsewhere, np.ndarray]:
    """Masks (H, W) of what the centre sees that is no object."""
    wall = np.inf if scene.backdrop is None else scene.backdrop.z_mm
    other, hit = hits.object_id == 0, np.isfinite(hits.z_mm)
    on_wall = np.zeros(hit.shape, dtype=bool)
    if np.isfinite(wall):
        on_wall[hit] = np.abs(hits.z_mm[hit] - wall) <= SAME_DEPTH * wall
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
        box = np.array([np.ravel(bounds.min), np.ravel(bounds.max)], dtype=np.float64)
        parts.setdefault(int(render_scene.object_of_shape[number]), []).append(box)
    return {
        number: np.array([np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)])
        for number, boxes in parts.items()
        if number > 0
    }


def _holds(box: np.ndarray, grid: CameraGrid, k: int, l: int) -> bool:
    place = as_rig(grid).camera(k, l).position_mm
    return bool(np.all((box[0] <= place) & (place <= box[1])))


def _hidden_shares(
    render_scene: RenderScene,
    target: Prepared,
    grid: CameraGrid,
    boxes: dict[int, np.ndarray],
    together: FirstHits,
) -> dict[int, float]:
    """Share of each object, seen alone from the virtual centre, that other objects stand before.

    Only objects whose boxes appear to overlap another's are looked at alone.
    """
    owner, shares = together.object_id, dict[int, float]()
    for number in render_scene.names:
        others = [box for other, box in boxes.items() if other != number]
        if number not in boxes or not any(_overlap(boxes[number], box) for box in others):
            continue
        alone = pixels_without_occluders(render_scene, target.scene, target.folder, number, grid)
        before = alone & (owner > 0) & (owner != number)
        shares[number] = float(before.sum() / alone.sum()) if alone.any() else 0.0
    return shares


def _overlap(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two boxes may stand one before the other, seen from X = Y = 0."""
    a, b = _outline(one), _outline(other)
    return bool(np.all(a[0] <= b[1]) and np.all(b[0] <= a[1]))


def _outline(box: np.ndarray) -> np.ndarray:
    """Smallest and largest X / Z and Y / Z (2, 2) of a box; everything if it reaches the cameras."""
    if box[0, 2] <= 0:
        return np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    slopes = box[:, None, :2] / box[None, :, 2:]
    return np.array([slopes.min(axis=(0, 1)), slopes.max(axis=(0, 1))])


def _lamps_away(scene: Scene, boxes: Iterable[np.ndarray]) -> tuple[int, ...]:
    """Lamps, from 1, behind whose face all objects stand."""
    choices = itertools.product((0, 1), repeat=3)
    corners = [[[box[c, a] for a, c in enumerate(choice)] for box in boxes] for choice in choices]
    points = np.array(corners, dtype=np.float64).reshape(-1, 3)
    away = []
    for number, lamp in enumerate(scene.lights, start=1):
        if isinstance(lamp, AreaLight) and points.size:
            facing = np.subtract(lamp.target_mm, lamp.position_mm)
            if np.all((points - lamp.position_mm) @ facing <= 0):
                away.append(number)
    return tuple(away)
