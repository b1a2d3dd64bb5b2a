"""From a validated scene to Mitsuba's: we alone choose the plugins, a scene file never names one."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.errors import InputError
from simgen.backend import shape_numbers
from simgen.light import light_plugin
from simgen.scene import Card, Matt, Mesh, Metal, Plastic, Scene, SceneObject, Sphere, asset

BACKDROP = "backdrop"
LARGEST_TEXTURE_PIXELS = 1 << 26


@dataclass(frozen=True)
class Built:
    """A scene that Mitsuba can render, and which of its shapes is which object."""

    mi: Any
    scene: Any
    object_of_shape: np.ndarray
    """Object id by Mitsuba's shape number, int16; 0 for a miss, the backdrop and lamps."""
    names: Mapping[int, str]
    """Names by object id, from 1."""


def build(mi: Any, scene: Scene, folder: Path, max_depth: int) -> Built:
    """Load a scene into Mitsuba. Raises `InputError` for a mesh or texture that cannot be used."""
    names = {number: thing.name for number, thing in enumerate(scene.objects, start=1)}
    plugins: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth},
    }
    for number, thing in enumerate(scene.objects, start=1):
        plugins[f"object{number}"] = _object(mi, thing, folder)
    if scene.backdrop is not None:
        wall, half = scene.backdrop, scene.backdrop.half_width_mm
        facing = mi.ScalarTransform4f().translate([0.0, 0.0, wall.z_mm])
        plugins[BACKDROP] = {
            "type": "rectangle",
            "to_world": facing @ _card_pose(mi, 2 * half, 2 * half),
            "bsdf": _two_sided(_matt(_evenly(wall.reflectance))),
        }
    for number, light in enumerate(scene.lights, start=1):
        plugins[f"light{number}"] = light_plugin(mi, light)
    try:
        # Without optimisation: it merges shapes, and merged shapes lose their names.
        loaded = mi.load_dict(plugins, optimize=False)
    except RuntimeError as fault:
        raise InputError(f"{folder}: the renderer refuses this scene: {_last_line(fault)}") from None
    return Built(mi, loaded, _object_of_shape(loaded), names)


def _object_of_shape(loaded: Any) -> np.ndarray:
    numbers = shape_numbers(loaded)
    table = np.zeros(max(numbers, default=0) + 1, dtype=np.int16)
    for number, shape in zip(numbers, loaded.shapes(), strict=True):
        table[number] = _object_id(shape.id())
    return table


def _object_id(shape_id: str) -> int:
    return int(shape_id.removeprefix("object")) if shape_id.startswith("object") else 0


def _object(mi: Any, thing: SceneObject, folder: Path) -> dict[str, Any]:
    T = mi.ScalarTransform4f
    pose = T().translate(list(thing.position_mm))
    for axis, degrees in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), thing.rotation_deg[::-1], strict=True):
        pose = pose @ T().rotate(list(axis), degrees)
    return {**_shape(mi, thing.shape, pose, folder), "bsdf": _two_sided(_surface(mi, thing, folder))}


def _shape(mi: Any, shape: Sphere | Card | Mesh, pose: Any, folder: Path) -> dict[str, Any]:
    T = mi.ScalarTransform4f
    match shape:
        case Sphere():
            return {"type": "sphere", "to_world": pose @ T().scale(shape.radius_mm)}
        case Card():
            to_world = pose @ _card_pose(mi, shape.width_mm, shape.height_mm)
            return {"type": "rectangle", "to_world": to_world}
        case Mesh():
            path = asset(folder, shape.file, "shape.file")
            if path.suffix.lower() != ".ply":
                raise InputError(f"{path}: a mesh must be a .ply file")
            return {"type": "ply", "filename": str(path), "to_world": pose @ T().scale(shape.scale)}


def _card_pose(mi: Any, width_mm: float, height_mm: float) -> Any:
    """Mitsuba's rectangle (2 x 2, normal +Z, v upwards) as a card that faces the cameras (-Z).

    Turning about X by 180 degrees brings the normal to -Z and the texture upright: its top row
    lies at -Y, which is up.
    """
    T = mi.ScalarTransform4f
    return T().rotate([1, 0, 0], 180) @ T().scale([width_mm / 2, height_mm / 2, 1])


def _two_sided(surface: dict[str, Any]) -> dict[str, Any]:
    """The same from behind, so that a card or an open mesh is no black hole there."""
    return {"type": "twosided", "bsdf": surface}


def _matt(reflectance: dict[str, Any]) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": reflectance}


def _evenly(srgb: tuple[float, float, float]) -> dict[str, Any]:
    """One colour all over."""
    return {"type": "rgb", "value": srgb_to_linear(np.array(srgb)).tolist()}


def _surface(mi: Any, thing: SceneObject, folder: Path) -> dict[str, Any]:
    match thing.material.finish:
        case Matt():
            return _matt(_reflectance(mi, thing, folder))
        case Plastic(roughness=alpha):
            return {
                "type": "roughplastic",
                "distribution": "ggx",
                "alpha": alpha,
                "diffuse_reflectance": _reflectance(mi, thing, folder),
            }
        case Metal(name=name, roughness=alpha):
            return {"type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": name}


def _reflectance(mi: Any, thing: SceneObject, folder: Path) -> dict[str, Any]:
    material = thing.material
    if material.texture is None:
        assert material.reflectance is not None
        return _evenly(material.reflectance)
    path = asset(folder, material.texture, "material.texture")
    pixels = _read_image(path)
    if isinstance(thing.shape, Card):
        pixels = np.ascontiguousarray(pixels[::-1])  # a rectangle's v runs up, an image's rows down
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(pixels),
        "raw": True,  # linear already, so Mitsuba must not convert it
        "filter_type": "bilinear",
        # Around a sphere a texture closes on itself; elsewhere its borders must not mix.
        "wrap_mode": "repeat" if isinstance(thing.shape, Sphere) else "clamp",
    }


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 sRGB in [0, 1] to linear."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _read_image(path: Path) -> np.ndarray:
    """An image file as linear RGB, (H, W, 3) float32; size checked before it is decoded."""
    from PIL import Image

    try:
        with Image.open(path, formats=("PNG", "JPEG", "TIFF")) as image:
            if image.width * image.height > LARGEST_TEXTURE_PIXELS:
                raise InputError(
                    f"{path}: {image.width} x {image.height} pixels is more than a texture may "
                    f"have ({LARGEST_TEXTURE_PIXELS})"
                )
            pixels = np.asarray(image.convert("RGB"))
    except (OSError, SyntaxError, Image.DecompressionBombError) as fault:
        raise InputError(f"{path}: cannot be read as an image ({fault})") from None
    table = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
    return table[pixels]


def _last_line(fault: BaseException) -> str:
    return str(fault).strip().splitlines()[-1].strip()
