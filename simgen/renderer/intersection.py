"""Rays by the million, NumPy in and NumPy out: all at once in compiled modes, one by one in scalar mode."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from simgen.renderer.backend import floats, is_scalar, load_drjit, shape_numbers, vectors
from simgen.renderer.mitsuba_scene import RenderScene, shape_number

SHY_OF_TARGET = 1e-4
"""A ray to a target stops this share of its length before it."""
PART = 1 << 14
"""Rays that are Python numbers at once in scalar mode, where they take several times NumPy's memory."""


def first_objects(render_scene: RenderScene, origin_mm: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Object id (N,) int16, 0 for none, of what rays from one origin (3,) in directions (N, 3) hit first."""
    return np.maximum(_objects_hit(render_scene, origin_mm, direction, np.inf), 0)


def first_points(
    render_scene: RenderScene, origin_mm: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What rays from one origin (3,) in directions (N, 3) hit first: points (N, 3) in mm, infinite for a
    miss, normals (N, 3) of the surface, and object ids (N,) int16, 0 for none."""
    rays = _rays(render_scene, origin_mm, direction, np.inf)
    scene, frame = render_scene.scene, render_scene.frame
    if is_scalar(render_scene.mi):
        hits = [scene.ray_intersect(render_scene.mi.RayDifferential3f(ray)) for ray in rays]
        points = np.array([np.ravel(hit.p) for hit in hits])
        normals = np.array([np.ravel(hit.n) for hit in hits])
        is_hit = np.array([hit.is_valid() for hit in hits], dtype=bool)
        ids = first_objects(render_scene, origin_mm, direction)
    else:
        hit = scene.ray_intersect(rays)
        points, normals, is_hit = np.array(hit.p).T, np.array(hit.n).T, np.array(hit.is_valid(), dtype=bool)
        shape = np.array(load_drjit().select(hit.is_valid(), shape_number(render_scene, hit), 0))
        ids = render_scene.object_of_shape[shape]
    points_mm = np.where(is_hit[:, None], frame.points_mm(points), np.inf)
    return points_mm, frame.world_directions(normals), ids


def standing_before(
    render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray, shy_of_target: float
) -> np.ndarray:
    """Object id (N,) int16 of what stands between origins and targets (N, 3), 0 of no object, -1 for nothing;
    rays stop `shy_of_target` of their length before the target."""
    if not len(origin_mm):
        return np.zeros(0, dtype=np.int16)
    return _objects_hit(render_scene, origin_mm, target_mm - origin_mm, 1 - shy_of_target)


def blocked(render_scene: RenderScene, origin_mm: np.ndarray, target_mm: np.ndarray) -> np.ndarray:
    """Whether something stands between origins (N, 3) and one target (3,), (N,) bool."""
    rays = _rays(render_scene, origin_mm, target_mm - origin_mm, 1 - SHY_OF_TARGET)
    ray_test = render_scene.scene.ray_test
    if is_scalar(render_scene.mi):
        return np.fromiter(map(ray_test, rays), dtype=bool, count=len(origin_mm))
    return np.array(ray_test(rays))


def _objects_hit(
    render_scene: RenderScene, origin_mm: np.ndarray, away_mm: np.ndarray, share: float
) -> np.ndarray:
    """Object id (N,) int16 of what rays hit first: 0 of no object, -1 for nothing."""
    rays, scene = _rays(render_scene, origin_mm, away_mm, share), render_scene.scene
    if is_scalar(render_scene.mi):
        ids = objects_by_shape(render_scene)
        hits = (scene.ray_intersect(render_scene.mi.RayDifferential3f(ray)) for ray in rays)
        objects = [ids[(hit.instance or hit.shape).id()] if hit.is_valid() else -1 for hit in hits]
        return np.array(objects, dtype=np.int16)
    hit = scene.ray_intersect_preliminary(rays)
    shape = np.array(load_drjit().select(hit.is_valid(), shape_number(render_scene, hit), 0))
    return np.where(shape > 0, render_scene.object_of_shape[shape], np.int16(-1))


def _rays(render_scene: RenderScene, origin_mm: np.ndarray, away_mm: np.ndarray, share: float) -> Any:
    """Rays from origins (N, 3), or from one (3,), along a share of vectors (N, 3) of the world.

    In scalar mode they come one after the other.
    """
    mi, frame = render_scene.mi, render_scene.frame
    length_mm = np.sqrt(sum(component**2 for component in away_mm.T))
    origin, unit = frame.points(np.atleast_2d(origin_mm)), frame.directions(away_mm / length_mm[:, None])
    length = length_mm * share * frame.unit
    if is_scalar(mi):
        rows = rows_of(np.column_stack([np.broadcast_to(origin, unit.shape), unit, length]))
        return (mi.Ray3f(mi.Ray3f(mi.Point3f(row[:3]), mi.Vector3f(row[3:6])), row[6]) for row in rows)
    ray = mi.Ray3f(vectors(mi, mi.Point3f, origin), vectors(mi, mi.Vector3f, unit))
    ray.maxt = floats(mi, length)
    return ray


def objects_by_shape(render_scene: RenderScene) -> dict[str, int]:
    """The object that each shape belongs to, by the shape's own id; for scalar mode."""
    numbers = zip(render_scene.scene.shapes(), shape_numbers(render_scene.scene), strict=True)
    return {shape.id(): render_scene.object_of_shape[number] for shape, number in numbers}


def rows_of(array: np.ndarray) -> Iterator[list[float]]:
    """The rows of an array (N, C) as Python's numbers, never many at once; for scalar mode."""
    for start in range(0, len(array), PART):
        yield from array[start : start + PART].tolist()
