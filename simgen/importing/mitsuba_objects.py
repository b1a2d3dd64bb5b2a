"""A Mitsuba scene as a foreign scene: its shapes, lights and cameras.

Mitsuba's world has Y up as a rule; its cameras look along their +Z with X to the left and Y up. Mitsuba 3.9,
"Shapes" and "Sensors".
"""

from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import read_meshes
from simgen.assets.triangles import MOST_FACES, Triangles
from simgen.importing.fitted_materials import fitted
from simgen.importing.foreign_scene import ForeignScene, Part, Viewpoint
from simgen.importing.mitsuba_lights import add_light
from simgen.importing.mitsuba_materials import MitsubaMaterials, Surface
from simgen.mitsuba_xml.mitsuba_contents import read_named
from simgen.mitsuba_xml.mitsuba_reader import read_mitsuba
from simgen.mitsuba_xml.mitsuba_scene import MitsubaScene, Plugin
from simgen.mitsuba_xml.mitsuba_triangles import (
    cube,
    cylinder,
    disk,
    flipped_pictures,
    laid_out,
    rectangle,
    smoothed,
    sphere,
    turned_over,
)
from simgen.mitsuba_xml.mitsuba_values import any_across
from simgen.spec.scene import MOST_OBJECTS
from simgen.spec.shapes import Box, Card, Shape, Sphere

UPRIGHT = np.diag([1.0, -1.0, -1.0])
TURN_X = np.diag([1.0, -1.0, -1.0, 1.0])
TURN_Z = np.diag([-1.0, -1.0, 1.0, 1.0])
"""Half turns."""
SQUARE = 1e-6
"""Axes of a matrix whose cosine is less than this are square to each other; so much may lengths differ."""
CLOSED = {"sphere", "cube"}
MADE = {"sphere": sphere, "rectangle": rectangle, "cube": cube, "disk": disk, "cylinder": cylinder}
FILES = {"obj", "ply"}


def foreign_mitsuba(path: Path, metres_per_unit: float) -> ForeignScene:
    """Read a scene file of Mitsuba 3 (.xml).

    Raises `InputError` for one that is wrong, or has in it what cannot be imported; see `read_mitsuba`.
    """
    source = read_mitsuba(path)
    scene = ForeignScene(title=path.stem, mm=1000 * metres_per_unit, upright=UPRIGHT)
    reader = _Reader(source, scene)
    for plugin in source.plugins:
        match plugin.category:
            case "shape":
                reader.add_shape(plugin, np.eye(4), "")
            case "emitter" if plugin.type != "area":
                add_light(plugin, scene, path.parent)
            case "sensor":
                reader.add_camera(plugin)
            case _:
                pass  # bsdfs, textures and area emitters that shapes refer to
    return scene


class _Reader:
    """The shapes and cameras of a file, put into a scene."""

    def __init__(self, source: MitsubaScene, scene: ForeignScene) -> None:
        self.scene = scene
        self._path = source.path
        self._files = read_named(
            source, FILES, read_meshes, lambda mesh: len(mesh.faces), MOST_FACES, "triangles"
        )
        self._materials = MitsubaMaterials(source, scene)
        self._meshes: dict[tuple[object, ...], Triangles] = {}
        self._fitted: dict[tuple[int, Surface], dict[str, Any] | None] = {}
        self._faces = self._shapes = 0

    def add_camera(self, sensor: Plugin) -> None:
        given, number = sensor.parameters, len(self.scene.viewpoints) + 1
        to_world, known = sensor.matrix("to_world"), "fov" in given and given["fov_axis"] == "x"
        if np.linalg.det(to_world[:3, :3]) < 0:
            self.scene.lose("cameras that mirror what they see")
        if given.get("principal_point_offset_x") or given.get("principal_point_offset_y"):
            self.scene.lose("principal points of cameras beside the middle of their films")
        if sensor.type == "thinlens":
            self.scene.lose("apertures of cameras, which recipes set")
        angle_deg = sensor.number("fov") if known else None
        self.scene.viewpoints.append(Viewpoint(sensor.id or f"camera {number}", to_world @ TURN_Z, angle_deg))

    def add_shape(self, plugin: Plugin, outer: np.ndarray, name: str) -> None:
        """A shape inside something that moves it by `outer` (4, 4) and lends it a name."""
        if plugin.type == "shapegroup":
            return  # its instances show it
        matrix = outer @ _matrix(plugin)
        if plugin.type == "instance":
            for part in plugin.parts[0].parts:
                self.add_shape(part, matrix, plugin.id)
            return
        self._shapes += 1
        if self._shapes > MOST_OBJECTS:
            raise InputError(
                f"{self._path}: has more than {MOST_OBJECTS} shapes, instances of a group included"
            )
        file = Path(plugin.text("filename")).stem if plugin.type in FILES else plugin.type
        name = name or plugin.id or file
        if not np.linalg.det(matrix[:3, :3]):
            self.scene.lose(f"'{name}', which is scaled to nothing")
            return
        surface = self._materials.surface(plugin)
        if surface is None:
            return
        if surface.dark_behind and plugin.type not in CLOSED:
            self.scene.lose(
                "backs of surfaces without a twosided bsdf, which are black: they look like the fronts"
            )
        plain = None if surface.has_pictures else _plain(plugin, surface, matrix)
        if plain is not None:
            shape, turn = plain
            self.scene.parts.append(Part(name, matrix @ turn, shape, file, surface.material))
            return
        if surface.finished.body == "pane":
            self.scene.lose("thin panes that are no rectangles: they are solid glass")
        mesh = self._mesh(plugin, surface, is_mirrored=bool(np.linalg.det(matrix[:3, :3]) < 0))
        key = id(mesh), surface
        if key not in self._fitted:
            repeat = surface.pictures_repeat
            self._fitted[key] = fitted(surface.material, mesh, self.scene, pictures_repeat=repeat)
        material = self._fitted[key]
        if material is not None:
            self.scene.parts.append(Part(name, matrix, mesh, file, material))

    def _mesh(self, plugin: Plugin, surface: Surface, *, is_mirrored: bool) -> Triangles:
        """The triangles of a shape, laid out for its pictures; of shapes that are the same these are one."""
        given = plugin.parameters
        turned = _is_turned(plugin, surface, is_mirrored=is_mirrored)
        names = ("filename", "face_normals", "flip_tex_coords")
        key = (
            plugin.type,
            turned,
            surface.has_pictures,
            surface.to_uv.tobytes(),
            *(given.get(name) for name in names),
        )
        if key not in self._meshes:
            mesh = self._read(plugin) if plugin.type in FILES else MADE[plugin.type]()
            mesh = laid_out(mesh, surface.to_uv) if surface.has_pictures else mesh
            self._meshes[key] = turned_over(mesh) if turned else mesh
            self._faces += len(mesh.faces)
            if self._faces > MOST_FACES:
                raise InputError(f"{self._path}: has more than {MOST_FACES} triangles; simplify its meshes")
        return self._meshes[key]

    def _read(self, plugin: Plugin) -> Triangles:
        given = plugin.parameters
        mesh = self._files[plugin.text("filename")]
        if not given["flip_tex_coords"]:
            mesh = flipped_pictures(mesh)
        if given["face_normals"]:
            return Triangles(mesh.positions, mesh.faces, None, mesh.texcoords)
        return smoothed(mesh) if mesh.normals is None else mesh


def _matrix(plugin: Plugin) -> np.ndarray:
    """From the axes in which `MADE` makes a shape, or a file has it, to those around it; (4, 4)."""
    inner = np.eye(4)
    match plugin.type:
        case "sphere":
            inner[:3, 3] = plugin.vector("center")
            inner[:3, :3] *= plugin.number("radius")
        case "cylinder":
            start, end, radius = plugin.vector("p0"), plugin.vector("p1"), plugin.number("radius")
            length = np.linalg.norm(end - start)
            if not length:
                raise InputError(f"{plugin.place}: 'p1' must not be at 'p0'")
            ahead = (end - start) / length
            across = any_across(*ahead)
            inner[:3] = np.stack(
                [radius * across, radius * np.cross(ahead, across), length * ahead, start], axis=-1
            )
        case _:
            pass
    return plugin.matrix("to_world") @ inner


def _is_turned(plugin: Plugin, surface: Surface, *, is_mirrored: bool) -> bool:
    """Whether the outside of a shape is its inside, as Mitsuba also makes it of a mirrored sphere."""
    flips = bool(plugin.parameters["flip_normals"]) != surface.finished.turned
    return flips != (is_mirrored and plugin.type == "sphere")


def _plain(plugin: Plugin, surface: Surface, matrix: np.ndarray) -> tuple[Shape, np.ndarray] | None:
    """The sphere, card or box that a shape without pictures is, if any, and the turn (4, 4) from its axes."""
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() > SQUARE:
        return None
    turned = _is_turned(plugin, surface, is_mirrored=bool(np.linalg.det(axes) < 0))
    # What neither shines nor lets light through looks the same from both sides.
    has_inside = "emission" in surface.material or surface.is_clear
    may_be_solid = surface.finished.body != "pane" and not (turned and has_inside)
    match plugin.type:
        case "sphere" if may_be_solid and np.ptp(lengths) <= SQUARE * lengths.max():
            return Sphere(radius_mm=1.0), np.eye(4)
        case "cube" if may_be_solid:
            return Box(width_mm=2.0, height_mm=2.0, depth_mm=2.0), np.eye(4)
        case "rectangle" if surface.finished.body != "solid":
            # A card shows its front towards -Z.
            return Card(width_mm=2.0, height_mm=2.0), np.eye(4) if turned else TURN_X
        case _:
            return None
