"""Objects in the renderer: where they stand, their shapes and surfaces, their colours as textures.

Shapes are Mitsuba's sphere and rectangle, or meshes; plugins are those of the variant that is set.

Cameras and objects are brought to the axes of a Mitsuba file that a scene refers to: not all of Mitsuba's
plugins could be moved (in 3.9 a turned `sdfgrid` is cut off, and scaled curves keep their radius).
"""

import math
import os
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pcii.base import InputError, srgb_to_linear
from simgen.assets import Assets, Triangles, across_faces, cut_out, globe, paint, triangles_of
from simgen.renderer.backend import is_spectral
from simgen.spec import (
    Box,
    Card,
    Cylinder,
    Glass,
    Material,
    Matt,
    Mesh,
    Metal,
    Plastic,
    Principled,
    Reflectance,
    Scene,
    SceneObject,
    Shape,
    Sphere,
    is_clear,
)
from simgen.spectral import spectra

BACKDROP, OBJECT = "simgen:backdrop", "simgen:object"
"""Ids of shapes, which none of a Mitsuba file has; those of objects end in their numbers."""
SMALL_BALL_SHARE = 0.02
"""A ball that shines is a mesh if its radius is a smaller share of the scene's size. Mitsuba aims at its own
sphere in single precision: at a radius of 0.01 of the distance light is right to 4e-4, at 0.001 to 3e-2."""
BALL_MESH_ROWS = 6, 32
"""The least and largest number of rows of such a mesh."""
STEPS_PER_EDGE = 8, 100
"""Steps of single precision along an edge of it: below the first a ball is refused, from the second on its
area is right to 1e-4."""


@dataclass(frozen=True, eq=False)
class WorldFrame:
    """The similarity from the world to the renderer's axes and unit: p_mm is at `unit` R p_mm + `origin`."""

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    unit: float = 1.0
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @cached_property
    def is_world(self) -> bool:
        """Whether nothing changes, so that numbers stay what they are to the last bit."""
        return bool(self.unit == 1 and (self.rotation == np.eye(3)).all() and not self.origin.any())

    def points(self, points_mm: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world in the renderer's axes and unit."""
        return points_mm if self.is_world else self.unit * points_mm @ self.rotation.T + self.origin

    def directions(self, directions: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the world in the renderer's axes."""
        return directions if self.is_world else directions @ self.rotation.T

    def points_mm(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the renderer in the world."""
        return points if self.is_world else (points - self.origin) @ self.rotation / self.unit

    def world_directions(self, directions: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the renderer in the world's axes."""
        return directions if self.is_world else directions @ self.rotation

    def z_mm(self, point: Any) -> Any:
        """Planar depth of the renderer's own points, as one of its arrays or as a number."""
        if self.is_world:
            return point.z
        # The origin is subtracted first: far points are large numbers.
        (x, y, z), (a, b, c) = (self.rotation[:, 2] / self.unit).tolist(), self.origin.tolist()
        return x * (point.x - a) + y * (point.y - b) + z * (point.z - c)

    def rigid_pose(self, pose: np.ndarray) -> np.ndarray:
        """The pose (4, 4) of what has no size, from the world to the renderer's axes."""
        result = np.eye(4)
        result[:3, :3], result[:3, 3] = self.rotation @ pose[:3, :3], self.points(pose[:3, 3])
        return result

    def pose(self, mi: Any, pose: Any) -> Any:
        """A pose of Mitsuba's from the world to the renderer's axes and unit."""
        if self.is_world:
            return pose
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.unit * self.rotation, self.origin
        return mi.ScalarTransform4f(matrix) @ pose


def pose_of(mi: Any, thing: SceneObject) -> Any:
    """From the shape's own axes to the world's."""
    T, (x, y, z) = mi.ScalarTransform4f, thing.rotation_deg
    pose = T().translate(list(thing.position_mm)) @ T().rotate([0, 0, 1], z)
    return pose @ T().rotate([0, 1, 0], y) @ T().rotate([1, 0, 0], x)


def plugins_of_shapes(
    mi: Any,
    scene: Scene,
    assets: Assets,
    frame: WorldFrame,
    emitter_of: Callable[[SceneObject], dict[str, Any] | None],
) -> dict[str, Any]:
    """The shapes of all objects, with their emitters, and of the backdrop by their ids.

    Objects that look alike share a surface. Raises `InputError` with the name of the object at fault.
    """
    plugins, surfaces, reach_mm = dict[str, Any](), dict[Hashable, Any](), _reach_mm(scene, assets)

    def paint_pattern(thing: SceneObject) -> np.ndarray | None:
        texture = thing.material.texture
        return (
            None if texture is None or isinstance(texture, str) else paint(texture, _aspect_of(thing.shape))
        )

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        patterns = pool.map(paint_pattern, scene.objects)
        for number, (thing, pattern) in enumerate(zip(scene.objects, patterns, strict=True), start=1):
            material, shape = thing.material, thing.shape
            try:
                # What a picture is laid on, and whether it says where, is part of how objects look.
                has_texcoords = not isinstance(shape, Mesh) or assets.meshes[shape.file].texcoords is not None
                kind = shape.type in ("card", "sphere") and shape.type
                key = material, kind, _aspect_of(shape), has_texcoords
                if key not in surfaces:
                    surfaces[key] = mi.load_dict(_surface_plugin(mi, material, shape, assets, pattern))
                parts = {"bsdf": surfaces[key]}
                if (emitter := emitter_of(thing)) is not None:
                    parts["emitter"] = mi.load_dict(emitter)
                plugins[f"{OBJECT}{number}"] = _shape_plugin(mi, thing, assets, parts, reach_mm, frame)
            except InputError as fault:
                raise InputError(f"object '{thing.name}', {fault}") from None
    if scene.backdrop is not None:  # a matt wall, seen from either side
        wall = scene.backdrop
        matt = {"type": "diffuse", "reflectance": _reflectance_plugin(mi, wall.reflectance)}
        pose = frame.pose(mi, mi.ScalarTransform4f().translate([0.0, 0.0, wall.z_mm]))
        to_world = pose @ _card_pose(mi, 2 * wall.half_width_mm, 2 * wall.half_width_mm)
        bsdf = {"type": "twosided", "bsdf": matt}
        plugins[BACKDROP] = {"type": "rectangle", "to_world": to_world, "bsdf": bsdf}
    return plugins


def _reach_mm(scene: Scene, assets: Assets) -> float:
    """A distance that no two things that the cameras see are farther apart; 0 where no ball shines."""
    if not any(isinstance(thing.shape, Sphere) and thing.material.emission for thing in scene.objects):
        return 0.0
    far_mm = 0.0 if scene.backdrop is None else scene.backdrop.z_mm
    for thing in scene.objects:
        match thing.shape:
            case Mesh(file=file, scale=scale):
                points_mm = assets.meshes[file].positions * np.asarray(scale)
            case shape:
                points_mm = triangles_of(shape, assets.meshes).positions
        size_mm = np.linalg.norm(points_mm, axis=1).max()
        far_mm = max(far_mm, float(np.linalg.norm(thing.position_mm) + size_mm))
    return 2 * far_mm


def _shape_plugin(
    mi: Any, thing: SceneObject, assets: Assets, parts: dict[str, Any], reach_mm: float, frame: WorldFrame
) -> Any:
    """The Mitsuba shape (or the plugin that makes it) of an object; `parts` are its bsdf and emitter.

    The scene is at most `reach_mm` large. Raises `InputError` for a ball that is too small to shine.
    """
    T, pose, shape = mi.ScalarTransform4f, frame.pose(mi, pose_of(mi, thing)), thing.shape
    matrix, is_whole = np.array(pose.matrix, dtype=np.float64), thing.material.opacity is None
    if isinstance(shape, Card) and is_whole:
        to_world = pose @ _card_pose(mi, shape.width_mm, shape.height_mm)
        return {"type": "rectangle", "to_world": to_world} | parts
    if isinstance(shape, Sphere) and is_whole:
        if "emitter" in parts and shape.radius_mm < SMALL_BALL_SHARE * reach_mm:
            return _mesh(mi, _small_ball(shape.radius_mm, matrix[:3, 3] / frame.unit), matrix, parts)
        # Mitsuba's has the first row of a texture about +Z and its middle at -X, a globe at -Y and -Z.
        globe_pose = T([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
        return {"type": "sphere", "to_world": pose @ globe_pose @ T().scale(shape.radius_mm)} | parts
    return _mesh(mi, solid_parts(shape, thing.material, assets), matrix, parts)


def _small_ball(radius_mm: float, position_mm: np.ndarray) -> Triangles:
    """A ball of the sphere's area at this position, as fine as single precision allows."""
    (fewest, most), (least_steps, steps) = BALL_MESH_ROWS, STEPS_PER_EDGE
    step_mm = float(np.spacing(np.float32(np.abs(position_mm).max() + radius_mm)))
    least_mm = least_steps * fewest * step_mm / np.pi
    if radius_mm < least_mm:
        raise InputError(
            f"shape.radius_mm: {radius_mm:g} is too small to shine at {np.linalg.norm(position_mm):.4g} mm "
            f"from the cameras; it must be at least {least_mm:.2g}"
        )
    ball = globe(radius_mm, min(max(int(np.pi * radius_mm / (steps * step_mm)), fewest), most))
    across = across_faces(ball.positions.astype(np.float64)[ball.faces])
    share = np.linalg.norm(across, axis=1).sum() / 2 / (4 * np.pi * radius_mm**2)
    return replace(ball, positions=(ball.positions / np.sqrt(share)).astype(np.float32))


def solid_parts(shape: Shape, material: Material, assets: Assets) -> Triangles:
    """Where a shape of this material is, as triangles in mm; all of it without an opacity.

    Raises `InputError` for an opacity that cannot be laid on the shape or leaves nothing of it.
    """
    triangles = triangles_of(shape, assets.meshes)
    if material.opacity is None:
        return triangles
    where = "material.opacity"
    if isinstance(shape, Sphere):
        raise InputError(f"{where}: it cannot be laid on a sphere; give a mesh")
    check_texcoords(where, shape, assets)
    try:
        rest = cut_out(triangles, assets.numbers(material.opacity, where)[..., 0], tiled=material.tiled)
    except ValueError as fault:
        raise InputError(f"{where}: {fault}") from None
    if rest is None:
        raise InputError(f"{where}: leaves nothing of the surface")
    return rest


def check_texcoords(where: str, shape: Shape, assets: Assets) -> None:
    """`InputError` for a picture on a mesh that does not say where it lies."""
    if isinstance(shape, Mesh) and assets.meshes[shape.file].texcoords is None:
        raise InputError(f"{where}: {shape.file!r} has no texture coordinates; add them, or leave it out")


def _card_pose(mi: Any, width_mm: float, height_mm: float) -> Any:
    """Mitsuba's rectangle (2 x 2, normal +Z, v upwards) as a card that faces -Z, with v towards -Y."""
    T = mi.ScalarTransform4f
    return T().rotate([1, 0, 0], 180) @ T().scale([width_mm / 2, height_mm / 2, 1])


def _mesh(mi: Any, triangles: Triangles, matrix: np.ndarray, parts: dict[str, Any]) -> Any:
    """A mesh of triangles in mm with a surface and an emitter, moved by a matrix (4, 4)."""
    properties = mi.Properties()
    for name, plugin in parts.items():
        properties[name] = plugin
    # The renderer aims at lamps as if their faces were flat; with smoothed normals it would be off.
    normals, texcoords = None if "emitter" in parts else triangles.normals, triangles.texcoords
    positions = triangles.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    mesh = mi.Mesh(
        "mesh", len(positions), len(triangles.faces), properties, normals is not None, texcoords is not None
    )
    values = mi.traverse(mesh)
    values["vertex_positions"] = positions.astype(np.float32).ravel()
    values["faces"] = triangles.faces.astype(np.uint32).ravel()
    if normals is not None:
        values["vertex_normals"] = (normals @ matrix[:3, :3].T).astype(np.float32).ravel()
    if texcoords is not None:  # Mitsuba's v runs down a picture
        values["vertex_texcoords"] = (texcoords * [1, -1] + [0, 1]).astype(np.float32).ravel()
    values.update()
    return mesh


def _surface_plugin(
    mi: Any, material: Material, shape: Shape, assets: Assets, pattern: np.ndarray | None
) -> dict[str, Any]:
    """The surface of an object of this shape, on both sides; `pattern` are its pixels if it carries one."""

    def texture(where: str, pixels: np.ndarray, raw: bool = True) -> dict[str, Any]:
        check_texcoords(where, shape, assets)
        return texture_plugin(mi, pixels, shape, raw=raw, tiled=material.tiled)

    def reflectance() -> dict[str, Any]:
        if material.reflectance is not None:
            return _reflectance_plugin(mi, material.reflectance)
        pixels = assets.image(material.texture) if isinstance(material.texture, str) else pattern
        assert pixels is not None
        # Pixels are linear, so they are colours as they stand, which spectral variants make spectra.
        return texture("material.texture", pixels, raw=not is_spectral(mi))

    def number_or_texture(field: str) -> float | dict[str, Any]:
        value, where = getattr(material.finish, field), f"material.finish.{field}"
        return texture(where, assets.numbers(value, where)) if isinstance(value, str) else value

    match material.finish:
        case Matt():
            surface = {"type": "diffuse", "reflectance": reflectance()}
        case Plastic(roughness=alpha):
            surface = {"type": "roughplastic", "distribution": "ggx", "alpha": alpha}
            surface["diffuse_reflectance"] = reflectance()
        case Metal(name=name, roughness=alpha):
            surface = {"type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": name}
        case Glass(refractive_index=index):
            pane = isinstance(shape, Card)
            surface = {"type": "thindielectric" if pane else "dielectric", "int_ior": index, "ext_ior": 1.0}
        case Principled(refractive_index=index, clearcoat_gloss=gloss):
            surface = {"type": "principled", "base_color": reflectance(), "eta": index}
            surface |= {field: number_or_texture(field) for field in ("metallic", "roughness")}
            surface["spec_trans"] = number_or_texture("transmission")
            surface |= {"clearcoat": number_or_texture("clearcoat"), "clearcoat_gloss": gloss}
    if material.normal_map is not None:
        tilts = texture("material.normal_map", assets.stored(material.normal_map))
        surface = {"type": "normalmap", "normalmap": tilts, "bsdf": surface}
    return surface if is_clear(material.finish) else {"type": "twosided", "bsdf": surface}


def texture_plugin(
    mi: Any, pixels: np.ndarray, shape: Shape, *, raw: bool, tiled: bool = False
) -> dict[str, Any]:
    """Pixels (H, W, C) as the texture of this shape; `raw` ones are no colours that become spectra."""
    if isinstance(shape, Card):
        pixels = pixels[::-1]  # a rectangle's v runs up, an image's rows down
    pixels = np.ascontiguousarray(pixels)
    # A bitmap is converted, which takes as long as tracing 500 000 paths; only that can become spectra.
    source: dict[str, Any] = {"data": mi.TensorXf(pixels)} if raw else {"bitmap": linear_bitmap(mi, pixels)}
    # Around a sphere a texture closes on itself; elsewhere its borders must not mix.
    wrap_mode = "repeat" if tiled or isinstance(shape, Sphere) else "clamp"
    return source | {"type": "bitmap", "raw": raw, "filter_type": "bilinear", "wrap_mode": wrap_mode}


def linear_bitmap(mi: Any, pixels: np.ndarray) -> Any:
    """Linear pixels (H, W, C) as Mitsuba's bitmap."""
    bitmap = mi.Bitmap(pixels)
    bitmap.set_srgb_gamma(False)  # otherwise a spectral variant takes them for sRGB
    return bitmap


def _aspect_of(shape: Shape) -> float:
    """Width over height of what a shape's texture is laid on: a sphere's and a cylinder's go once round."""
    match shape:
        case Card() | Box():
            return shape.width_mm / shape.height_mm
        case Sphere():
            return 2.0
        case Cylinder():
            return 2 * math.pi * shape.radius_mm / shape.length_mm
        case _:
            return 1.0


def _reflectance_plugin(mi: Any, reflectance: Reflectance) -> dict[str, Any]:
    """One reflectance all over. In a spectral variant sRGB is turned into a smooth spectrum by Mitsuba."""
    if isinstance(reflectance, tuple):
        return {"type": "rgb", "value": srgb_to_linear(np.array(reflectance)).tolist()}
    if isinstance(reflectance, str):
        spectrum = spectra.patch(reflectance)
    else:
        spectrum = np.interp(spectra.WAVELENGTH_NM, reflectance.wavelength_nm, reflectance.value)
    if is_spectral(mi):
        return spectrum_plugin(spectrum)
    return {"type": "rgb", "value": spectra.linear_srgb(spectrum).tolist()}


def spectrum_plugin(values: np.ndarray) -> dict[str, Any]:
    """Values (N,) at evenly spaced wavelengths."""
    first, last = spectra.WAVELENGTH_NM[[0, -1]].tolist()
    numbers = ", ".join(map(repr, values.tolist()))
    return {"type": "regular", "wavelength_min": first, "wavelength_max": last, "values": numbers}
