"""Rays by the million, NumPy in and NumPy out: all at once in compiled modes, one by one in scalar mode."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from simgen.renderer.backend import is_scalar, load_drjit, shape_numbers
from simgen.renderer.device_arrays import floats
from simgen.renderer.mitsuba_scene import RenderScene

SHY_OF_TARGET = 1e-4
"""A ray to a target stops this share of its length before it."""
PART = 1 << 14
"""In scalar mode so many rays are Python numbers at once: those take several times the memory of NumPy's."""


def first_objects(render_scene: RenderScene, origin_mm: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Object id (N,) int16, 0 for none, of what rays from one origin (3,) in directions (N, 3) hit first."""
    mi, scene = render_scene.mi, render_scene.scene
    unit = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    if is_scalar(mi):
        ids = objects_by_shape(render_scene)
        found = np.zeros(len(unit), dtype=np.int16)
        origin = mi.Point3f(*origin_mm)
        for number, towards in enumerate(rows_of(unit)):
            hit = scene.ray_intersect(mi.RayDifferential3f(origin, mi.Vector3f(towards)))
            if hit.is_valid():
                found[number] = ids[hit.shape.id()]
        return found
    dr = load_drjit()
    origins = np.broadcast_to(origin_mm, unit.shape)
    ray = mi.Ray3f(_vectors(mi, mi.Point3f, origins), _vectors(mi, mi.Vector3f, unit))
    hit = scene.ray_intersect_preliminary(ray)
    shape = dr.select(hit.is_valid(), dr.reinterpret_array(mi.UInt32, hit.shape), 0)
    return render_scene.object_of_shape[np.array(shape)]


def blocked(render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray) -> np.ndarray:
    """Whether something stands between origins (N, 3) and one target (3,), (N,) bool."""
    mi, scene = render_scene.mi, render_scene.scene
    away = target_mm - origin_mm
    length = np.linalg.norm(away, axis=-1)
    unit, reach = away / length[:, None], length * (1 - SHY_OF_TARGET)
    if is_scalar(mi):
        rows = rows_of(np.column_stack([origin_mm, unit, reach]))
        rays = (mi.Ray3f(mi.Point3f(row[:3]), mi.Vector3f(row[3:6]), row[6], 0.0, []) for row in rows)
        return np.fromiter((scene.ray_test(ray) for ray in rays), dtype=bool, count=len(unit))
    ray = mi.Ray3f(_vectors(mi, mi.Point3f, origin_mm), _vectors(mi, mi.Vector3f, unit))
    ray.maxt = floats(mi, reach)
    return np.array(scene.ray_test(ray))


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
