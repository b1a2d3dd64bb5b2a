"""Rays by the million, NumPy in and NumPy out: all at once in compiled modes, one by one in scalar mode."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from simgen.renderer.backend import is_scalar, load_drjit, shape_numbers
from simgen.renderer.device_arrays import floats
from simgen.renderer.mitsuba_scene import RenderScene, shape_number

SHY_OF_TARGET = 1e-4
"""A ray to a target stops this share of its length before it."""
PART = 1 << 14
"""In scalar mode so many rays are Python numbers at once: those take several times the memory of NumPy's."""


def first_objects(render_scene: RenderScene, origin_mm: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Object id (N,) int16, 0 for none, of what rays from one origin (3,) in directions (N, 3) hit first."""
    mi, scene = render_scene.mi, render_scene.scene
    unit = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    unit, origin = render_scene.frame.directions(unit), render_scene.frame.points(origin_mm)
    if is_scalar(mi):
        ids = objects_by_shape(render_scene)
        found = np.zeros(len(unit), dtype=np.int16)
        start = mi.Point3f(*origin)
        for number, towards in enumerate(rows_of(unit)):
            hit = scene.ray_intersect(mi.RayDifferential3f(start, mi.Vector3f(towards)))
            if hit.is_valid():
                found[number] = ids[(hit.instance or hit.shape).id()]
        return found
    dr = load_drjit()
    origins = np.broadcast_to(origin, unit.shape)
    ray = mi.Ray3f(_vectors(mi, mi.Point3f, origins), _vectors(mi, mi.Vector3f, unit))
    hit = scene.ray_intersect_preliminary(ray)
    shape = dr.select(hit.is_valid(), shape_number(render_scene, hit), 0)
    return render_scene.object_of_shape[np.array(shape)]


def blocked(render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray) -> np.ndarray:
    """Whether something stands between origins (N, 3) and one target (3,), (N,) bool."""
    mi, scene = render_scene.mi, render_scene.scene
    if is_scalar(mi):
        rays = _scalar_rays(render_scene, origin_mm, target_mm, SHY_OF_TARGET)
        return np.fromiter((scene.ray_test(ray) for ray in rays), dtype=bool, count=len(origin_mm))
    return np.array(scene.ray_test(_rays_to(render_scene, origin_mm, target_mm, SHY_OF_TARGET)))


def standing_before(
    render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray, shy_of_target: float
) -> np.ndarray:
    """Object id (N,) int16 of what stands between origins and targets (N, 3): 0 of no object, -1 for nothing.

    Rays stop `shy_of_target` of their length before the target.
    """
    mi, scene = render_scene.mi, render_scene.scene
    if not len(origin_mm):
        return np.zeros(0, dtype=np.int16)
    if is_scalar(mi):
        ids, hits = objects_by_shape(render_scene), []
        for ray in _scalar_rays(render_scene, origin_mm, target_mm, shy_of_target):
            hit = scene.ray_intersect(mi.RayDifferential3f(ray))
            hits.append(ids[(hit.instance or hit.shape).id()] if hit.is_valid() else -1)
        return np.array(hits, dtype=np.int16)
    dr = load_drjit()
    hit = scene.ray_intersect_preliminary(_rays_to(render_scene, origin_mm, target_mm, shy_of_target))
    shape = np.array(dr.select(hit.is_valid(), shape_number(render_scene, hit), 0))
    return np.where(shape > 0, render_scene.object_of_shape[shape], np.int16(-1))


def _rays_to(
    render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray, shy_of_target: float
) -> Any:
    mi = render_scene.mi
    origin, unit, length = _segments(render_scene, origin_mm, target_mm)
    ray = mi.Ray3f(_vectors(mi, mi.Point3f, origin), _vectors(mi, mi.Vector3f, unit))
    ray.maxt = floats(mi, length * (1 - shy_of_target))
    return ray


def _scalar_rays(
    render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray, shy_of_target: float
) -> Iterator[Any]:
    mi = render_scene.mi
    origin, unit, length = _segments(render_scene, origin_mm, target_mm)
    rows = rows_of(np.column_stack([origin, unit, length * (1 - shy_of_target)]))
    return (mi.Ray3f(mi.Point3f(row[:3]), mi.Vector3f(row[3:6]), row[6], 0.0, []) for row in rows)


def _segments(
    render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Origins, unit directions and lengths in the renderer's axes and unit, of segments in the world."""
    away = target_mm - origin_mm
    length = np.linalg.norm(away, axis=-1)
    frame = render_scene.frame
    return frame.points(origin_mm), frame.directions(away / length[:, None]), length * frame.unit


def _vectors(mi: Any, kind: Any, rows: np.ndarray) -> Any:
    return kind(*(floats(mi, column) for column in rows.T))


def objects_by_shape(render_scene: RenderScene) -> dict[str, int]:
    """The object that each shape belongs to, by the shape's own id; for scalar mode."""
    numbers = zip(render_scene.scene.shapes(), shape_numbers(render_scene.scene), strict=True)
    return {shape.id(): render_scene.object_of_shape[number] for shape, number in numbers}


def rows_of(array: np.ndarray) -> Iterator[list[float]]:
    """The rows of an array (N, C) as Python's numbers, never many at once; for scalar mode."""
    for start in range(0, len(array), PART):
        yield from array[start : start + PART].tolist()
