"""A Mitsuba scene by reference: its own parser reads it, and Mitsuba builds all that it names, as it stands.

What is known of it here is what the rest of the house needs: where its axes are (see `world_frame`), the
names of its shapes, what of it shines, and what single photons cannot be drawn from.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE
from simgen.base.strict_models import shorten, suggestion
from simgen.renderer.backend import is_scalar, load_drjit
from simgen.renderer.device_arrays import floats
from simgen.renderer.emission import ShiningSurface
from simgen.renderer.mitsuba_surfaces import is_spectral
from simgen.renderer.world_frame import WorldFrame
from simgen.spec.mitsuba_file import MitsubaFile, files_named_by
from simgen.spec.scene import names_of_objects
from simgen.spectral.filters import Filters
from simgen.spectral.spectra import WAVELENGTH_NM, integral

BRIGHTNESS = re.compile(r"(?:radiance|irradiance|intensity)\.value|(?:sun_|sky_)?scale")
"""Parameters that say how bright a light is; pictures that shine, and lights by temperature, have none."""
AXES_OF_CAMERA = np.diag([-1.0, -1.0, 1.0])
"""Mitsuba's sensors have X to the left and Y up; the world X to the right and Y down."""
UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""Y up and Z towards the viewer, as models stand, to Y down and Z away from the cameras."""
SAMPLES_OF_LIGHT = 1 << 14
"""Directions in which each light is looked for, when it is measured what it gives a plane."""
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

    def illuminance_lux(self, z_mm: float) -> float:
        """Illuminance, in the unit of the file's lights, of a surface at (0, 0, z) that faces the cameras.

        Nothing stands in the way, as of the lights of a scene.toml. Raises `InputError` in spectral variants.
        """
        if is_spectral(self.mi):
            raise InputError(
                "level: lights of a Mitsuba file have a level only where light is linear sRGB; leave it out, "
                "or give a recipe without sensor.camera"
            )
        mi, scene = self.mi, _instantiate(self.mi, *_parsed(self.mi, self.path), self.path)
        points, total = np.random.default_rng(0).random((SAMPLES_OF_LIGHT, 2)), 0.0
        point = self.frame.points(np.array([0.0, 0.0, z_mm]))
        for light in scene.emitters():
            if is_scalar(mi):
                seen_from = mi.Interaction3f()
                seen_from.p = point.tolist()
                drawn = [light.sample_direction(seen_from, mi.Point2f(point)) for point in points.tolist()]
                towards = np.array([np.ravel(sample.d) for sample, _ in drawn])
                radiance = np.array([np.ravel(weight)[:3] for _, weight in drawn])
            else:
                seen_from = load_drjit().zeros(mi.Interaction3f, len(points))
                seen_from.p = mi.Point3f(*point.tolist())
                sample, weight = light.sample_direction(
                    seen_from, mi.Point2f(*(floats(mi, column) for column in points.T))
                )
                towards, radiance = np.array(sample.d).T, np.array(weight).T[:, :3]
            cosine = np.maximum(-self.frame.world_directions(towards)[:, 2], 0)
            total += float((radiance @ LUMINANCE * cosine).mean())
        return total

    def build(self, own: Mapping[str, Any], integrator: dict[str, Any], gain: float) -> Any:
        """Mitsuba's scene of all that the file has, its lights `gain` times as bright, and of `own` by id.

        Raises `InputError` with what Mitsuba says of a plugin, a parameter or a file.
        """
        mi = self.mi
        config, state = _parsed(mi, self.path)
        root, names = state.root.props, iter(self.names)
        for key, number in _children(mi, state.root).items():
            node = state.nodes[number]
            if _kind(node) in ("Sensor", "Integrator"):
                del root[key]
            elif _is_object(node):
                node.props.set_id(next(names))
        for name, plugin in own.items():
            root[name] = mi.load_dict(plugin) if isinstance(plugin, dict) else plugin
            root[name].set_id(name)
        root["integrator"] = mi.load_dict(integrator)
        scene = _instantiate(mi, config, state, self.path)
        for light in self._lights(scene, own) if gain != 1 else ():
            values = mi.traverse(light)
            by_name = [name for name in values.keys() if BRIGHTNESS.fullmatch(name)]  # noqa: SIM118 (no dict)
            if not by_name:
                raise InputError(
                    f"level: {self.path} has lights that cannot be made brighter, such as pictures that "
                    "shine; leave the level out"
                )
            # A light with a scale has a radiance beside it, and each of them alone makes it brighter.
            for name in ["scale"] if "scale" in by_name else by_name:
                values[name] = values[name] * gain
            values.update()
        _try_to_render(mi, scene, self.path)
        return scene

    def _lights(self, scene: Any, own: Mapping[str, Any]) -> Iterator[Any]:
        """The file's emitters."""
        yield from (
            shape.emitter() for shape in scene.shapes() if shape.id() in self.names and shape.is_emitter()
        )
        for light in scene.emitters():
            if not self.mi.has_flag(light.flags(), self.mi.EmitterFlags.Surface) and light.id() not in own:
                yield light

    def shining(
        self, scene: Any, first_number: int, filters: Filters | None
    ) -> tuple[list[ShiningSurface], str]:
        """What of the file's shapes shines, and a clause on why it cannot be drawn from, "" if it can."""
        mi, surfaces = self.mi, list[ShiningSurface]()
        for shape in scene.shapes():
            if shape.id() not in self.names or not shape.is_emitter():
                continue
            light = shape.emitter()
            triangles = _flat_triangles(shape) if shape.is_mesh() else None
            if triangles is None or mi.has_flag(light.flags(), mi.EmitterFlags.SpatiallyVarying):
                return [], f"'{shape.id()}' shines with a picture or is no mesh of flat faces"
            number = first_number + self.names.index(shape.id())
            corners_mm = self.frame.points_mm(triangles)
            surfaces.append(ShiningSurface(number, corners_mm, _radiance(mi, light, filters)))
        if self.has_media:
            return [], "a medium scatters light"
        return surfaces, ""


def reference_to(mi: Any, file: MitsubaFile, folder: Path) -> Reference:
    """A Mitsuba scene of the scene's folder, standing where `file` says.

    Raises `InputError` for a file that names what lies elsewhere, for what Mitsuba cannot read, and for a
    camera that is not there.
    """
    path = folder / file.file
    list(files_named_by(folder, file.file))  # refuses what leads outside, before Mitsuba sees the file
    _, state = _parsed(mi, path)
    shapes = filter(_is_object, (state.nodes[number] for number in _children(mi, state.root).values()))
    names = names_of_objects(
        [node.props.id() or Path(_properties(node).get("filename", "")).stem for node in shapes]
    )
    kinds = {_kind(node) for node in state.nodes} | {node.props.plugin_name() for node in state.nodes}
    frame = _frame(mi, file, path, state)
    return Reference(mi, path, frame, tuple(names), "Medium" in kinds, "instance" in kinds)


def _parsed(mi: Any, path: Path) -> tuple[Any, Any]:
    parser = mi.parser
    config = parser.ParserConfig(mi.variant())
    config.merge_meshes = config.merge_equivalent = config.parallel = False
    try:
        state = parser.parse_file(config, str(path))
        parser.transform_upgrade(config, state)
        parser.transform_resolve(config, state)
    except RuntimeError as fault:
        raise InputError(f"{path}: Mitsuba cannot read it: {_sentence(fault)}") from None
    for node in state.nodes:
        if not re.fullmatch(r"\w+", node.props.plugin_name(), re.ASCII):
            raise InputError(f"{path}: {node.props.plugin_name()!r} is no name of a plugin")
        name = _properties(node).get("filename")
        if isinstance(name, str):
            node.props["filename"] = str((path.parent / name).resolve())
    return config, state


def _instantiate(mi: Any, config: Any, state: Any, path: Path) -> Any:
    try:
        return mi.parser.instantiate(config, state)
    except RuntimeError as fault:
        raise InputError(f"{path}: Mitsuba cannot build it: {_sentence(fault)}") from None


def _try_to_render(mi: Any, scene: Any, path: Path) -> None:
    """`InputError` for plugins that can be built and not rendered, such as a temperature without spectra."""
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    sensor = mi.load_dict({"type": "perspective", "film": film, "sampler": {"type": "independent"}})
    try:
        np.array(mi.render(scene, sensor=sensor, spp=1, seed=0))
    except RuntimeError as fault:
        reason = fault.__cause__ or fault.__context__ or fault
        raise InputError(f"{path}: Mitsuba cannot render it: {_sentence(reason)}") from None


def _sentence(fault: BaseException) -> str:
    """What Mitsuba says, without the place in its own source."""
    return shorten(re.sub(r"\[[\w.]+\.(?:cpp|h):\d+\] ?", "", str(fault)).strip())


def _kind(node: Any) -> str:
    return str(node.type).removeprefix("ObjectType.")


def _children(mi: Any, node: Any) -> dict[str, int]:
    """Numbers of the nodes that a node refers to, by key."""
    of_kind = mi.Properties.ResolvedReference
    return {key: value.index() for key, value in _properties(node).items() if isinstance(value, of_kind)}


def _properties(node: Any) -> dict[str, Any]:
    """Parameters of a node by name. A look at one is no use of it: Mitsuba names those that are not used."""
    values = dict(node.props.items())
    for name in values:
        node.props.mark_queried(name, False)
    return values


def _cameras(state: Any) -> Iterator[tuple[str, np.ndarray]]:
    for node in state.nodes:
        if _kind(node) == "Sensor":
            pose = node.props.get("to_world", None)
            matrix = np.eye(4) if pose is None else np.array(pose.matrix, dtype=np.float64)
            yield node.props.id(), matrix


def _frame(mi: Any, file: MitsubaFile, path: Path, state: Any) -> WorldFrame:
    """Where the world's axes are in those of the file."""
    box = np.zeros((2, 3))
    if file.place_at_mm is not None or file.fit_mm is not None:
        bounds = [shape.bbox() for shape in _instantiate(mi, *_parsed(mi, path), path).shapes()]
        if not bounds:
            raise InputError(f"{path}: there is no shape in it")
        box[0] = np.min([np.ravel(one.min) for one in bounds], axis=0)
        box[1] = np.max([np.ravel(one.max) for one in bounds], axis=0)
    unit = 1 / file.unit_mm if file.fit_mm is None else float(np.ptp(box, axis=0).max()) / file.fit_mm
    if file.place_at_mm is not None:
        return WorldFrame(UPRIGHT, unit, box.mean(axis=0) - unit * UPRIGHT @ np.array(file.place_at_mm))
    cameras = dict(_cameras(state))
    if file.camera is not None and file.camera not in cameras:
        raise InputError(f"{path}: there is no sensor {file.camera!r}{suggestion(file.camera, cameras)}")
    if file.camera is None and len(cameras) != 1:
        known = f", one of {', '.join(filter(None, cameras))}" if cameras else ""
        raise InputError(
            f"{path}: it has {len(cameras)} sensors; give mitsuba.camera{known}, or mitsuba.place_at_mm"
        )
    pose = cameras[file.camera] if file.camera is not None else next(iter(cameras.values()))
    forward = pose[:3, 2] / np.linalg.norm(pose[:3, 2])
    left = np.cross(pose[:3, 1], forward)
    left /= np.linalg.norm(left)
    axes = np.column_stack([left, np.cross(forward, left), forward]) @ AXES_OF_CAMERA
    return WorldFrame(axes, unit, pose[:3, 3])


def _is_object(node: Any) -> bool:
    return _kind(node) == "Shape" and node.props.plugin_name() != "shapegroup"


def _flat_triangles(mesh: Any) -> np.ndarray | None:
    """Corners (M, 3, 3) in mm of a mesh that is shaded by its faces' own normals; None of another."""
    faces = np.array(mesh.faces_buffer()).reshape(-1, 3)
    corners = np.array(mesh.vertex_positions_buffer(), dtype=np.float64).reshape(-1, 3)[faces]
    if mesh.has_vertex_normals() and not mesh.has_face_normals():
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
        normals = np.array(mesh.vertex_normals_buffer(), dtype=np.float64).reshape(-1, 3)[faces]
        if np.abs(normals - across[:, None]).max() > FLAT:
            return None
    return corners


def _radiance(mi: Any, light: Any, filters: Filters | None) -> np.ndarray:
    """Radiance (C,) of a light that is the same everywhere, in the unit of rendered views."""

    def radiance_at(wavelengths_nm: list[float]) -> np.ndarray:
        hit = mi.SurfaceInteraction3f() if is_scalar(mi) else load_drjit().zeros(mi.SurfaceInteraction3f, 1)
        hit.wi = [0.0, 0.0, 1.0]
        if wavelengths_nm:
            hit.wavelengths = wavelengths_nm
        return np.ravel(light.eval(hit))

    if filters is None:
        return radiance_at([]).astype(np.float64)
    spectrum = [radiance_at([float(nm)] * 4)[0] for nm in WAVELENGTH_NM]
    return integral(filters.sensitivity * np.array(spectrum))
