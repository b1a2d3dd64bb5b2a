"""A Mitsuba scene by reference: Mitsuba reads and builds all that it names, as it stands.

What is read of it here is where its axes are (see `WorldFrame`), the names of its shapes and what shines.
"""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import LUMINANCE, InputError
from simgen.assets import across_faces
from simgen.base import shorten, suggestion
from simgen.renderer.backend import is_scalar, is_spectral, load_drjit
from simgen.renderer.emission import ShiningSurface, sample_light
from simgen.renderer.mitsuba_objects import WorldFrame
from simgen.spec import OF_RECIPES, MitsubaFile, MitsubaXml, check_unscored, names_of_objects
from simgen.spectral import WAVELENGTH_NM, Filters, integral

AXES_OF_CAMERA = np.diag([-1.0, -1.0, 1.0])
"""Mitsuba's sensors have X to the left and Y up; the world X to the right and Y down."""
UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""Y up and Z towards the viewer, as models stand, to Y down and Z away from the cameras."""
BRIGHTNESS = re.compile(r"(?:radiance|irradiance|intensity)\.value|(?:sun_|sky_)?scale")
"""Parameters that say how bright a light is; pictures that shine, and lights by temperature, have none."""
REQUIRED = {"bitmap": "filename", "volume": "volume", "blendbsdf": "weight"}
"""What plugins use without a look at whether the file has it: a crash would end this process."""
MIN_CUTOFF_DEG = 0.2
"""Mitsuba compares cosines in single precision: a spot of this cutoff has its light to 1 %."""
LIGHT_SAMPLES = 1 << 14
"""Directions in which each light is looked for, to measure what it gives a plane."""
FLAT = 1e-4
"""Shading normals that differ less from a face's own are taken to be its own."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A Mitsuba scene in a scene's folder: where the world is in it, and its shapes' names in order."""

    mi: Any
    path: Path
    frame: WorldFrame
    names: tuple[str, ...]
    has_media: bool
    has_instances: bool
    foggy_sensor: str | None
    """Id of the sensor that is the virtual centre, if it stands in a medium."""

    def illuminance_lux(self, z_mm: float) -> float:
        """Illuminance, in the unit of the file's lights, of a surface at (0, 0, z) that faces the cameras.

        Nothing stands in the way, as of the lights of a scene.toml. Raises `InputError` in spectral variants.
        """
        if is_spectral(self.mi):
            raise InputError("level: it needs light in linear sRGB; leave it or sensor.camera out")
        numbers, total = np.random.default_rng(0).random((LIGHT_SAMPLES, 2)), 0.0
        position = self.frame.points(np.array([0.0, 0.0, z_mm])).tolist()
        scene = _instantiate(self.mi, *_parse(self.mi, self.path), self.path)  # whose lights go with it
        for light in scene.emitters():
            towards, radiance = sample_light(self.mi, light, numbers, position)
            cosine = np.maximum(-self.frame.world_directions(towards)[:, 2], 0)
            total += float((radiance[:, :3] @ LUMINANCE * cosine).mean())
        return total

    def build(self, plugins: Mapping[str, Any], integrator: dict[str, Any], gain: float) -> tuple[Any, Any]:
        """Mitsuba's scene of all that the file has, its lights `gain` times as bright, and of `plugins` by
        id; and the medium that the cameras stand in, None for air.

        Raises `InputError` with what Mitsuba says of a plugin, a parameter or a file.
        """
        mi = self.mi
        config, state = _parse(mi, self.path, self.foggy_sensor)
        root, ids = state.root.props, iter(self.names)
        for node in filter(_is_object, _children(mi, state, state.root).values()):
            node.props.set_id(next(ids))
        for name, plugin in plugins.items():
            root[name] = mi.load_dict(plugin) if isinstance(plugin, dict) else plugin
            root[name].set_id(name)
        root["integrator"] = mi.load_dict(integrator)
        scene = _instantiate(mi, config, state, self.path)
        for light in scene.emitters() if gain != 1 else ():
            if (light.get_shape() or light).id() in plugins:
                continue
            values = mi.traverse(light)
            names = [name for name in values.keys() if BRIGHTNESS.fullmatch(name)]  # noqa: SIM118 (no dict)
            if not names:
                raise InputError(f"level: {self.path} has lights that cannot be made brighter; leave it out")
            # A light with a scale has a radiance beside it, and each of them alone makes it brighter.
            for name in ["scale"] if "scale" in names else names:
                values[name] = values[name] * gain
            values.update()
        return scene, next((sensor.get_medium() for sensor in scene.sensors()), None)

    def shining_surfaces(
        self, scene: Any, ids: Mapping[str, int], filters: Filters | None
    ) -> tuple[list[ShiningSurface], str]:
        """What of the shapes in `build`'s scene shines, and a clause on why it cannot be drawn from or ""."""
        mi, surfaces = self.mi, list[ShiningSurface]()
        for shape in scene.shapes():
            if shape.id() not in self.names or not shape.is_emitter():
                continue
            light = shape.emitter()
            triangles = _flat_triangles(shape) if shape.is_mesh() else None
            if triangles is None or mi.has_flag(light.flags(), mi.EmitterFlags.SpatiallyVarying):
                return [], f"'{shape.id()}' shines with a picture or is no mesh of flat faces"
            corners_mm, radiance = self.frame.points_mm(triangles), _radiance(mi, light, filters)
            surfaces.append(ShiningSurface(ids[shape.id()], corners_mm, radiance))
        return ([], "a medium scatters light") if self.has_media else (surfaces, "")


def reference_to(mi: Any, file: MitsubaFile, folder: Path) -> Reference:
    """A Mitsuba scene of the scene's folder, standing where `file` says.

    Raises `InputError` for a file that names what lies elsewhere, cannot be read, or has no such camera or
    object.
    """
    path = folder / file.file
    MitsubaXml(folder, file.file)  # refuses what leads outside, before Mitsuba sees the file
    _, state = _parse(mi, path)
    shapes = filter(_is_object, _children(mi, state, state.root).values())
    ids = [node.props.id() or Path(_properties(node).get("filename", "")).stem for node in shapes]
    has_media = any(_kind(node) == "Medium" for node in state.nodes)
    has_instances = any(node.props.plugin_name() == "instance" for node in state.nodes)
    (frame, sensor), names = _frame(mi, file, path, state), tuple(names_of_objects(ids))
    check_unscored(file.unscored, names, str(path))
    foggy_sensor = None
    if sensor is not None and "Medium" in map(_kind, _children(mi, state, sensor).values()):
        foggy_sensor = sensor.props.id()
    return Reference(mi, path, frame, names, has_media, has_instances, foggy_sensor)


def _parse(mi: Any, path: Path, sensor: str | None = None) -> tuple[Any, Any]:
    """Mitsuba's settings and tree of a file, whose own files are named by their whole paths.

    What recipes have instead is not built: it is cut off the tree but for one `sensor`, whose medium is of
    interest; the nodes have all sensors still. Raises `InputError` for plugins and materials that Mitsuba
    does not ship, and for what would end this process.
    """
    parser, resolver = mi.parser, mi.FileResolver()
    config = parser.ParserConfig(mi.variant())
    config.merge_meshes = config.merge_equivalent = config.parallel = False
    resolver.clear()
    resolver.append(str(path.parent))
    shipped = mi.file_resolver()
    try:
        mi.set_file_resolver(resolver)  # while spectra and included files are read
        state = parser.parse_file(config, str(path))
        parser.transform_upgrade(config, state)
        parser.transform_resolve(config, state)
    except RuntimeError as fault:
        raise _refusal(path, "read", fault) from None
    finally:
        mi.set_file_resolver(shipped)
    if _kind(state.root) != "Scene":
        raise InputError(f"{path}: expected a <scene>, not a single plugin")

    def is_kept(node: Any) -> bool:
        return _kind(node) == "Sensor" and node.props.id() == sensor  # without an id it is ""

    for node in state.nodes:
        for key, child in _children(mi, state, node).items():
            if _kind(child) in OF_RECIPES.values() and not is_kept(child):
                del node.props[key]
        if _kind(node) in (*OF_RECIPES.values(), "Scene") and not is_kept(node):
            continue
        values = _properties(node)
        if fault := _fault(node.props.plugin_name(), values, Path(mi.__file__).parent):
            raise InputError(f"{parser.file_location(state, node)}: {fault}")
        if isinstance(name := values.get("filename"), str):
            node.props["filename"] = str((path.parent / name).resolve())
    return config, state


def _fault(plugin: str, values: dict[str, Any], own_files: Path) -> str:
    """What is wrong with a plugin of these parameters that Mitsuba would not say, or ""."""
    material, needed = values.get("material", "none"), REQUIRED.get(plugin)
    # Mitsuba would look for what it does not ship in the working directory. Its plugin for Blender reads
    # memory at addresses that the file states.
    if plugin not in _names_in(own_files / "plugins") - {"blender"}:
        return f"{plugin!r} is none of Mitsuba's plugins for scene files"
    if isinstance(material, str) and material not in _names_in(own_files / "data/ior") | {"none"}:
        return f"{material!r} is none of Mitsuba's materials"
    if plugin == "spot" and values.get("cutoff_angle", MIN_CUTOFF_DEG) < MIN_CUTOFF_DEG:
        return f"a spot is right from a cutoff_angle of {MIN_CUTOFF_DEG:g} degrees on; use a projector"
    return "" if needed is None or needed in values else f"a {plugin} needs a {needed}"


@cache
def _names_in(folder: Path) -> frozenset[str]:
    return frozenset(file.name.split(".")[0] for file in folder.iterdir())


def _instantiate(mi: Any, config: Any, state: Any, path: Path) -> Any:
    try:
        return mi.parser.instantiate(config, state)
    except RuntimeError as fault:
        raise _refusal(path, "build", fault) from None


def _refusal(path: Path, verb: str, fault: BaseException) -> InputError:
    """With what Mitsuba says, without the place in its own source."""
    sentence = shorten(re.sub(r"\[[\w.]+\.(?:cpp|h):\d+\] ?", "", str(fault)).strip())
    return InputError(f"{path}: Mitsuba cannot {verb} it: {sentence}")


def _kind(node: Any) -> str:
    return str(node.type).removeprefix("ObjectType.")


def _is_object(node: Any) -> bool:
    return _kind(node) == "Shape" and node.props.plugin_name() != "shapegroup"


def _children(mi: Any, state: Any, node: Any) -> dict[str, Any]:
    """The nodes of a tree that one of them refers to, by key."""
    of_kind = mi.Properties.ResolvedReference
    values = _properties(node).items()
    return {key: state.nodes[value.index()] for key, value in values if isinstance(value, of_kind)}


def _properties(node: Any) -> dict[str, Any]:
    """Parameters of a node by name."""
    values = dict(node.props.items())
    for name in values:  # Mitsuba refuses those that nobody has queried
        node.props.mark_queried(name, False)
    return values


def _frame(mi: Any, file: MitsubaFile, path: Path, state: Any) -> tuple[WorldFrame, Any]:
    """Where the world's axes are in those of the file, and the node of the sensor if they are of one."""
    unit, middle = 1 / file.unit_mm, np.zeros(3)
    if file.place_at_mm is not None or file.fit_mm is not None:
        scene = _instantiate(mi, *_parse(mi, path), path)
        if not scene.shapes():
            raise InputError(f"{path}: there is no shape in it")
        low, high = np.ravel(scene.bbox().min), np.ravel(scene.bbox().max)
        middle = (low + high) / 2
        if file.fit_mm is not None:
            unit = float((high - low).max()) / file.fit_mm
    if file.place_at_mm is not None:
        return WorldFrame(UPRIGHT, unit, middle - unit * UPRIGHT @ np.array(file.place_at_mm)), None
    cameras = {node.props.id(): node for node in state.nodes if _kind(node) == "Sensor"}
    if file.camera is not None and file.camera not in cameras:
        raise InputError(f"{path}: there is no sensor {file.camera!r}{suggestion(file.camera, cameras)}")
    if file.camera is None and len(cameras) != 1:
        raise InputError(f"{path}: it has {len(cameras)} sensors; give mitsuba.camera or mitsuba.place_at_mm")
    node = cameras[next(iter(cameras)) if file.camera is None else file.camera]
    transform = node.props.get("to_world", None)
    pose = np.eye(4) if transform is None else np.array(transform.matrix, dtype=np.float64)
    if np.linalg.det(pose[:3, :3]) < 0:
        warnings.warn(
            f"{path}: the sensor {node.props.id()!r} mirrors its picture left to right, for Mitsuba; cameras "
            "here stand where it does and mirror nothing",
            UserWarning,
            stacklevel=2,
        )
    forward = pose[:3, 2] / np.linalg.norm(pose[:3, 2])
    left = np.cross(pose[:3, 1], forward)
    left /= np.linalg.norm(left)
    axes = np.column_stack([left, np.cross(forward, left), forward]) @ AXES_OF_CAMERA
    return WorldFrame(axes, unit, pose[:3, 3]), node


def _flat_triangles(mesh: Any) -> np.ndarray | None:
    """Corners (M, 3, 3) of a mesh that is shaded by its faces' own normals; None of another."""
    faces = np.array(mesh.faces_buffer()).reshape(-1, 3)
    corners = np.array(mesh.vertex_positions_buffer(), dtype=np.float64).reshape(-1, 3)[faces]
    if mesh.has_vertex_normals() and not mesh.has_face_normals():
        across = across_faces(corners)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
        normals = np.array(mesh.vertex_normals_buffer(), dtype=np.float64).reshape(-1, 3)[faces]
        if np.abs(normals - across[:, None]).max() > FLAT:
            return None
    return corners


def _radiance(mi: Any, light: Any, filters: Filters | None) -> np.ndarray:
    """Radiance (C,) of a light that is the same everywhere, in the unit of rendered views."""
    hit = mi.SurfaceInteraction3f() if is_scalar(mi) else load_drjit().zeros(mi.SurfaceInteraction3f, 1)
    hit.wi = [0.0, 0.0, 1.0]
    if filters is None:
        return np.ravel(light.eval(hit)).astype(np.float64)
    spectrum = np.empty(WAVELENGTH_NM.size)
    for number, wavelength_nm in enumerate(WAVELENGTH_NM.tolist()):
        hit.wavelengths = [wavelength_nm] * 4
        spectrum[number] = np.ravel(light.eval(hit))[0]
    return integral(filters.sensitivity * spectrum)
