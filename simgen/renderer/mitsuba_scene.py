"""From a validated scene to Mitsuba's, and what rays hit in it.

Only this package names plugins, never a scene file. Rays come by the million, NumPy in and NumPy out: all at
once in compiled modes, one by one in scalar mode.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError
from pcii.types import CameraGrid
from simgen.assets import Assets, read_assets
from simgen.renderer.backend import floats, is_scalar, load_drjit, shape_numbers, vectors
from simgen.renderer.emission import SceneLights, ShiningSurface
from simgen.renderer.mitsuba_objects import OBJECT, WorldFrame, plugins_of_shapes
from simgen.renderer.mitsuba_reference import Reference, reference_to
from simgen.spec import MOST_OBJECTS, Scene
from simgen.spectral import Filters, filters_for

LIGHT = "simgen:light"
"""What ids of lights begin with, which end in their numbers; as of `OBJECT`."""
SHY_OF_TARGET = 1e-4
"""A ray to a target stops this share of its length before it."""
PART = 1 << 14
"""Rays that are Python numbers at once in scalar mode, where they take several times NumPy's memory."""


@dataclass(frozen=True)
class RenderScene:
    """A scene that Mitsuba can render, and which of its shapes is which object.

    `object_of_shape` has object ids by Mitsuba's shape number, int16, 0 for a miss, the backdrop and lamps;
    `names` are those of objects by id, from 1; those of `unscored` count in no score. `filters` are what the
    camera's pixels see of spectra, None where light is linear sRGB. Light paths have at most `max_depth`
    segments. `shining` is all that shines and can be seen but for what is all around, and `why_rendered` a
    clause on what the tracer of single photons does not cover. With `has_instances` some objects are
    instances of a group of shapes. The cameras stand in `medium`, None for air. With `hides_surroundings`
    they see nothing of what shines from all around where nothing is hit.
    """

    mi: Any
    scene: Any
    object_of_shape: np.ndarray
    names: Mapping[int, str]
    filters: Filters | None
    max_depth: int
    shining: tuple[ShiningSurface, ...] = ()
    why_rendered: str = ""
    frame: WorldFrame = field(default_factory=WorldFrame)
    has_instances: bool = False
    unscored: frozenset[int] = frozenset()
    medium: Any = None
    hides_surroundings: bool = False

    @property
    def corners_mm(self) -> np.ndarray:
        """Corners (N, 8, 3), in the world, of the boxes around Mitsuba's shapes."""
        boxes = [shape.bbox() for shape in self.scene.shapes()]
        corners = [[np.ravel(box.corner(number)) for number in range(8)] for box in boxes]
        return self.frame.points_mm(np.array(corners, dtype=np.float64).reshape(-1, 8, 3))

    def shape_number(self, hit: Any) -> Any:
        """Mitsuba's number of the shapes that rays hit in compiled modes; of an instance its own."""
        mi, dr = self.mi, load_drjit()
        number = dr.reinterpret_array(mi.UInt32, hit.shape)
        if not self.has_instances:
            return number
        instance = dr.reinterpret_array(mi.UInt32, hit.instance)
        return dr.select(instance != 0, instance, number)

    def not_finite(self, number: int, view: tuple[int, int], pixel: tuple[int, int], grid: CameraGrid) -> str:
        """The sentence for light of an object (0: none) in a pixel of a view that is no finite number."""
        name = self.names.get(number)
        what = "what is seen beside the objects" if name is None else f"object '{name}'"
        # The size tells views of the dataset from the coarse ones that are looked at before.
        where = f"row {pixel[0]}, column {pixel[1]} of view {view}, of {grid.height} x {grid.width} px"
        return (
            f"{what}: its radiance in {where}, is not a finite number; make tiny lamps larger, or move them "
            "away from it"
        )

    def first_objects(self, origin_mm: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Object id (N,) int16, 0 for none, of what rays from an origin (3,) in directions (N, 3) hit."""
        return np.maximum(self.objects_hit(origin_mm, direction, np.inf), 0)

    def first_points(
        self, origin_mm: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What rays from one origin (3,) in directions (N, 3) hit first: points (N, 3) in mm, infinite for a
        miss, normals (N, 3) of the surface, and object ids (N,) int16, 0 for none."""
        rays = self._rays(origin_mm, direction, np.inf)
        scene, frame = self.scene, self.frame
        if is_scalar(self.mi):
            hits = [scene.ray_intersect(self.mi.RayDifferential3f(ray)) for ray in rays]
            points = np.array([np.ravel(hit.p) for hit in hits])
            normals = np.array([np.ravel(hit.n) for hit in hits])
            is_hit = np.array([hit.is_valid() for hit in hits], dtype=bool)
        else:
            hit = scene.ray_intersect(rays)
            points, normals = np.array(hit.p).T, np.array(hit.n).T
            is_hit = np.array(hit.is_valid(), dtype=bool)
        points_mm = np.where(is_hit[:, None], frame.points_mm(points), np.inf)
        return points_mm, frame.world_directions(normals), self.first_objects(origin_mm, direction)

    def blocked(self, origin_mm: np.ndarray, target_mm: np.ndarray) -> np.ndarray:
        """Whether something stands between origins (N, 3) and one target (3,), (N,) bool."""
        rays = self._rays(origin_mm, target_mm - origin_mm, 1 - SHY_OF_TARGET)
        ray_test = self.scene.ray_test
        if is_scalar(self.mi):
            return np.fromiter(map(ray_test, rays), dtype=bool, count=len(origin_mm))
        return np.array(ray_test(rays))

    def objects_hit(self, origin_mm: np.ndarray, away_mm: np.ndarray, share: float) -> np.ndarray:
        """Object id (N,) int16 of what rays from origins (N, 3), or from one (3,), hit first within a `share`
        of the vectors `away_mm` (N, 3): 0 of no object, -1 for nothing."""
        if not len(away_mm):
            return np.zeros(0, dtype=np.int16)
        rays, scene = self._rays(origin_mm, away_mm, share), self.scene
        if is_scalar(self.mi):
            ids = self.objects_by_shape()
            hits = (scene.ray_intersect(self.mi.RayDifferential3f(ray)) for ray in rays)
            objects = [ids[(hit.instance or hit.shape).id()] if hit.is_valid() else -1 for hit in hits]
            return np.array(objects, dtype=np.int16)
        hit = scene.ray_intersect_preliminary(rays)
        shape = np.array(load_drjit().select(hit.is_valid(), self.shape_number(hit), 0))
        return np.where(shape > 0, self.object_of_shape[shape], np.int16(-1))

    def _rays(self, origin_mm: np.ndarray, away_mm: np.ndarray, share: float) -> Any:
        """Rays from origins (N, 3), or from one (3,), along a share of vectors (N, 3) of the world.

        In scalar mode they come one after the other.
        """
        mi, frame = self.mi, self.frame
        length_mm = np.sqrt(sum(component**2 for component in away_mm.T))
        origin, unit = frame.points(np.atleast_2d(origin_mm)), frame.directions(away_mm / length_mm[:, None])
        length = length_mm * share * frame.unit
        if is_scalar(mi):
            rows = rows_of(np.column_stack([np.broadcast_to(origin, unit.shape), unit, length]))
            return (mi.Ray3f(mi.Ray3f(mi.Point3f(row[:3]), mi.Vector3f(row[3:6])), row[6]) for row in rows)
        ray = mi.Ray3f(vectors(mi, mi.Point3f, origin), vectors(mi, mi.Vector3f, unit))
        ray.maxt = floats(mi, length)
        return ray

    def objects_by_shape(self) -> dict[str, int]:
        """The object that each shape belongs to, by the shape's own id; for scalar mode."""
        numbers = zip(self.scene.shapes(), shape_numbers(self.scene), strict=True)
        return {shape.id(): self.object_of_shape[number] for shape, number in numbers}


def build(
    mi: Any,
    scene: Scene,
    folder: Path,
    max_depth: int,
    curves: np.ndarray | None = None,
    assets: Assets | None = None,
) -> RenderScene:
    """Load a scene into Mitsuba, in the variant that is set.

    `curves` (C, N) are the camera's sensitivities (see `spectra`), which a spectral variant needs; `assets`
    are the files in the folder, if they have been read. Raises `InputError` for what cannot be rendered.
    """
    if not is_scalar(mi):
        load_drjit().flush_malloc_cache()  # which keeps what earlier scenes took, in sizes of their own
    assets = assets or read_assets(scene, folder)
    reference = None if scene.mitsuba is None else reference_to(mi, scene.mitsuba, folder)
    ids, names = _numbered_objects(scene, reference, folder)
    frame, has_media, referenced_lux = WorldFrame(), False, 0.0
    if reference is not None:
        frame, has_media = reference.frame, reference.has_media
        if scene.level is not None:
            referenced_lux = reference.illuminance_lux(scene.level.z_mm)
    around = scene.light_around
    hides_surroundings = around is not None and not around.visible
    if hides_surroundings and has_media:
        raise InputError(
            f"{folder}: lights: one that is not visible does not go with a medium; leave out visible"
        )
    lights = SceneLights(mi, scene, assets, frame, referenced_lux)
    plugins = plugins_of_shapes(mi, scene, assets, frame, lights.object_plugin)
    for number, light in enumerate(scene.lights, start=1):
        plugins[f"{LIGHT}{number}"] = lights.light_plugin(light)
    filters = None if curves is None else filters_for(curves, lights.main_spectrum())
    shining, why_rendered = list(lights.surfaces(filters)), ""
    integrator, medium = {"type": "volpath" if has_media else "path", "max_depth": max_depth}, None
    if reference is not None:
        loaded, medium = reference.build(plugins, integrator, lights.gain)
        surfaces, why_rendered = reference.shining_surfaces(loaded, ids, filters)
        shining += surfaces
    else:
        # Without optimisation: it merges shapes, and merged shapes lose their names. One after the other:
        # things are numbered as they come, and kernels that know them by other numbers are compiled anew.
        content = {"type": "scene", "integrator": integrator} | plugins
        loaded = mi.load_dict(content, parallel=False, optimize=False)
        _numbers_as_data(mi, loaded)
    numbers = shape_numbers(loaded)
    object_of_shape = np.zeros(max(numbers, default=0) + 1, dtype=np.int16)
    object_of_shape[numbers] = [ids.get(shape.id(), 0) for shape in loaded.shapes()]
    unscored = {thing.name for thing in scene.objects if not thing.scored}
    unscored.update(() if scene.mitsuba is None else scene.mitsuba.unscored)
    return RenderScene(
        mi,
        loaded,
        object_of_shape,
        names,
        filters,
        max_depth,
        shining=tuple(shining),
        why_rendered=why_rendered,
        frame=frame,
        has_instances=reference is not None and reference.has_instances,
        unscored=frozenset(number for number, name in names.items() if name in unscored),
        medium=medium,
        hides_surroundings=hides_surroundings,
    )


def _numbered_objects(
    scene: Scene, reference: Reference | None, folder: Path
) -> tuple[dict[str, int], dict[int, str]]:
    """Numbers of the objects by the ids of their shapes, from 1, and names by these numbers."""
    ids = {f"{OBJECT}{number}": number for number in range(1, len(scene.objects) + 1)}
    names = {number: thing.name for number, thing in enumerate(scene.objects, start=1)}
    if reference is not None:
        for name in set(names.values()) & set(reference.names):
            raise InputError(f"{folder}: an object and a shape of the Mitsuba file are both named '{name}'")
        ids |= {name: number for number, name in enumerate(reference.names, start=1 + len(names))}
        names |= {ids[name]: name for name in reference.names}
        if len(names) > MOST_OBJECTS:
            raise InputError(f"{folder}: a scene may have {MOST_OBJECTS} objects, and this has {len(names)}")
    return ids, names


def _numbers_as_data(mi: Any, loaded: Any) -> None:
    """Pass poses, colours and the like to kernels as data: scenes of like things then share their kernels."""
    if is_scalar(mi):
        return
    dr, parameters = load_drjit(), mi.traverse(loaded)
    for name in parameters.keys():  # noqa: SIM118 (it is no dict)
        value = parameters[name]
        is_one = dr.is_jit_v(value) and not dr.is_tensor_v(value) and dr.width(value) == 1
        if is_one or name.endswith("to_world"):  # a transform, which is no array
            dr.make_opaque(value)
            parameters[name] = value
    parameters.update()


def rows_of(array: np.ndarray) -> Iterator[list[float]]:
    """The rows of an array (N, C) as Python's numbers, never many at once; for scalar mode."""
    for start in range(0, len(array), PART):
        yield from array[start : start + PART].tolist()
