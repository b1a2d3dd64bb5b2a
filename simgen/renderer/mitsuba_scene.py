"""From a validated scene to Mitsuba's: only this package names plugins, never a scene file."""

from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import Assets, read_assets
from simgen.assets.triangles import triangles_of
from simgen.renderer.backend import is_scalar, load_drjit, shape_numbers
from simgen.renderer.emission import (
    ShiningSurface,
    emission_plugin,
    level_gain,
    light_plugin,
    main_spectrum,
    shining_surfaces,
)
from simgen.renderer.mitsuba_reference import reference_to
from simgen.renderer.mitsuba_shapes import WorldFrame, card_pose, shape_plugin
from simgen.renderer.mitsuba_surfaces import (
    matt_plugin,
    paint_patterns,
    reflectance_plugin,
    surface_key,
    surface_plugin,
)
from simgen.spec.lights import EnvironmentLight
from simgen.spec.scene import MOST_OBJECTS, Scene
from simgen.spec.shapes import Mesh, Sphere
from simgen.spectral.filters import Filters, filters_for

BACKDROP, OBJECT, LIGHT = "simgen:backdrop", "simgen:object", "simgen:light"
"""Ids of shapes, which none of a Mitsuba file has; those of objects and lights end in their numbers."""


@dataclass(frozen=True)
class RenderScene:
    """A scene that Mitsuba can render, and which of its shapes is which object."""

    mi: Any
    scene: Any
    object_of_shape: np.ndarray
    """Object id by Mitsuba's shape number, int16; 0 for a miss, the backdrop and lamps."""
    names: Mapping[int, str]
    """Names by object id, from 1."""
    filters: Filters | None
    """What the camera's pixels see of spectra; None where light is linear sRGB."""
    gain: float = 1.0
    """By how much lights are brighter than they say, for the scene's level."""
    shining: tuple[ShiningSurface, ...] = ()
    """All that shines and can be seen, but for what shines from all around."""
    why_rendered: str = ""
    """A clause on what the tracer of single photons does not cover, so that views have to be rendered."""
    frame: WorldFrame = field(default_factory=WorldFrame)
    """Where the world is in the renderer's own axes."""
    has_instances: bool = False
    """Whether some objects are instances of a group of shapes."""


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
    are the files in the folder, if they have been read. Raises `InputError` for a mesh or texture that cannot
    be used.
    """
    if not is_scalar(mi):
        load_drjit().flush_malloc_cache()  # which keeps what earlier scenes took, in sizes of their own
    assets = assets or read_assets(scene, folder)
    reference = None if scene.mitsuba is None else reference_to(mi, scene.mitsuba, folder)
    frame = WorldFrame() if reference is None else reference.frame
    own_names = [thing.name for thing in scene.objects]
    names = dict(enumerate((*own_names, *(reference.names if reference else ())), start=1))
    _check_names(names, folder)
    around = next((light for light in scene.lights if isinstance(light, EnvironmentLight)), None)
    surroundings = None if around is None else assets.environments[around.file]
    referenced_lux = (lambda _: 0.0) if reference is None else reference.illuminance_lux
    gain = level_gain(mi, scene, assets, surroundings, referenced_lux)
    plugins = _object_plugins(mi, scene, assets, gain, frame)
    if scene.backdrop is not None:
        wall, side_mm = scene.backdrop, 2 * scene.backdrop.half_width_mm
        pose = frame.pose(mi, mi.ScalarTransform4f().translate([0.0, 0.0, wall.z_mm]))
        surface = matt_plugin(reflectance_plugin(mi, wall.reflectance))
        to_world = pose @ card_pose(mi, side_mm, side_mm)
        plugins[BACKDROP] = {"type": "rectangle", "to_world": to_world, "bsdf": surface}
    for number, light in enumerate(scene.lights, start=1):
        plugins[f"{LIGHT}{number}"] = light_plugin(mi, light, gain, surroundings, frame)
    scatters = reference is not None and reference.has_media
    integrator = {"type": "volpath" if scatters else "path", "max_depth": max_depth}
    if reference is not None:
        loaded = reference.build(plugins, integrator, gain)
    else:
        # Without optimisation: it merges shapes, and merged shapes lose their names. One after the other:
        # things are numbered as they come, and kernels that know them by other numbers are compiled anew.
        content = {"type": "scene", "integrator": integrator} | plugins
        loaded = mi.load_dict(content, parallel=False, optimize=False)
        _numbers_as_data(mi, loaded)
    filters = None if curves is None else filters_for(curves, main_spectrum(mi, scene))
    shining, why_rendered = list(shining_surfaces(mi, scene, assets, gain, filters)), ""
    if reference is not None:
        surfaces, why_rendered = reference.shining_surfaces(loaded, 1 + len(own_names), filters)
        shining += surfaces
    ids = {f"{OBJECT}{number}": number for number in range(1, len(own_names) + 1)}
    ids |= {name: number for number, name in names.items() if number > len(own_names)}
    return RenderScene(
        mi,
        loaded,
        _object_of_shape(loaded, ids),
        names,
        filters,
        gain,
        tuple(shining),
        why_rendered,
        frame,
        reference is not None and reference.has_instances,
    )


def _check_names(names: Mapping[int, str], folder: Path) -> None:
    """`InputError` for too many objects, and for one that is called like a shape of the Mitsuba file."""
    name, count = Counter(names.values()).most_common(1)[0] if names else ("", 0)
    if count > 1:
        raise InputError(f"{folder}: an object and a shape of the Mitsuba file are both named '{name}'")
    if len(names) > MOST_OBJECTS:
        raise InputError(f"{folder}: a scene may have {MOST_OBJECTS} objects, and this has {len(names)}")


def _object_plugins(mi: Any, scene: Scene, assets: Assets, gain: float, frame: WorldFrame) -> dict[str, Any]:
    """Shapes of all objects by id; objects that look alike share a surface."""
    plugins, surfaces, reach_mm = dict[str, Any](), dict[Hashable, Any](), _reach_mm(scene, assets)
    patterns = paint_patterns(scene.objects)
    for number, (thing, pattern) in enumerate(zip(scene.objects, patterns, strict=True), start=1):
        try:
            key = surface_key(thing.material, thing.shape, assets)
            if key not in surfaces:
                surfaces[key] = mi.load_dict(surface_plugin(mi, thing.material, thing.shape, assets, pattern))
            emitter = emission_plugin(mi, thing, assets, gain)
            shape = shape_plugin(mi, thing, assets, surfaces[key], emitter, reach_mm, frame)
        except InputError as fault:
            raise InputError(f"object '{thing.name}', {fault}") from None
        plugins[f"{OBJECT}{number}"] = shape
    return plugins


def _reach_mm(scene: Scene, assets: Assets) -> float:
    """A distance that no two things that the cameras see are farther apart; 0 where no ball shines."""
    if not any(isinstance(thing.shape, Sphere) and thing.material.emission for thing in scene.objects):
        return 0.0
    far_mm = 0.0 if scene.backdrop is None else scene.backdrop.z_mm
    for thing in scene.objects:
        match thing.shape:
            case Sphere(radius_mm=size_mm):
                pass
            case Mesh(file=file, scale=scale):
                size_mm = np.linalg.norm(assets.meshes[file].positions * np.asarray(scale), axis=1).max()
            case shape:
                size_mm = np.linalg.norm(triangles_of(shape, assets.meshes).positions, axis=1).max()
        far_mm = max(far_mm, float(np.linalg.norm(thing.position_mm) + size_mm))
    return 2 * far_mm


def _numbers_as_data(mi: Any, loaded: Any) -> None:
    """Pass poses, colours and the like to kernels as data, not as constants that are compiled into them.

    Scenes of the same kinds of things then share their kernels. Scalar mode compiles none.
    """
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


def _object_of_shape(loaded: Any, ids: Mapping[str, int]) -> np.ndarray:
    numbers = shape_numbers(loaded)
    table = np.zeros(max(numbers, default=0) + 1, dtype=np.int16)
    for number, shape in zip(numbers, loaded.shapes(), strict=True):
        table[number] = ids.get(shape.id(), 0)
    return table


def shape_number(render_scene: RenderScene, hit: Any) -> Any:
    """Mitsuba's number of the shapes that rays hit in compiled modes: of the instance, where it is one."""
    mi, dr = render_scene.mi, load_drjit()
    number = dr.reinterpret_array(mi.UInt32, hit.shape)
    if not render_scene.has_instances:
        return number
    instance = dr.reinterpret_array(mi.UInt32, hit.instance)
    return dr.select(instance != 0, instance, number)


def not_finite(render_scene: RenderScene, number: int) -> str:
    """The sentence for light of an object (0: none) that is no finite number."""
    name = render_scene.names.get(number)
    what = "what is seen beside the objects" if name is None else f"object '{name}'"
    return (
        f"{what}: its radiance is not a finite number in the renderer's single precision; make lamps that "
        "are tiny or almost touch it larger, or move them away"
    )
