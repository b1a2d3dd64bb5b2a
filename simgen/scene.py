"""Scenes: the world in a TOML file, in millimetres; no camera in it.

World axes: X right, Y down, Z forward, the cameras in the plane Z = 0 looking along +Z.
"""

from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator

from pcii.errors import InputError
from simgen.assets import asset
from simgen.lights import EnvironmentLight, Level, Light, UniformLight
from simgen.locations import find, scene_roots
from simgen.materials import Material, Reflectance
from simgen.schema import NonNegative, Positive, Strict, Vector, read_toml, suggestion, validate
from simgen.shapes import Mesh, Shape


class SceneObject(Strict):
    """One named thing that truth and scores know."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
    position_mm: Vector
    """Where the shape's origin stands: X right, Y down, Z away from the cameras."""
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    """Turns about the X, Y and Z axes, applied in this order, in degrees."""
    shape: Shape
    material: Material


class Backdrop(Strict):
    """A flat wall parallel to the camera plane, endless for the cameras."""

    z_mm: Positive
    reflectance: Reflectance = (0.0, 0.0, 0.0)
    """sRGB, the name of a ColorChecker patch, or a spectrum; as of a material."""
    half_width_mm: NonNegative = 5000.0


class Scene(Strict):
    """A world to be looked at: objects, lights, and what stands behind."""

    title: str
    description: str = ""
    objects: tuple[SceneObject, ...] = ()
    lights: Annotated[tuple[Light, ...], Field(min_length=1)]
    level: Level | None = None
    """Sets how bright it is; the luminances of lights then tell only how they compare."""
    backdrop: Backdrop | None = None

    @field_validator("lights")
    @classmethod
    def _one_from_all_around(cls, lights: tuple[Light, ...]) -> tuple[Light, ...]:
        if sum(isinstance(light, UniformLight | EnvironmentLight) for light in lights) > 1:
            raise ValueError("only one light can be 'uniform' or 'environment'")
        return lights

    @field_validator("objects")
    @classmethod
    def _names_differ(cls, objects: tuple[SceneObject, ...]) -> tuple[SceneObject, ...]:
        names = [thing.name for thing in objects]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two objects are named '{twice[0]}'; give each its own name")
        return objects


def load_scene(name_or_path: str, near: Path | None = None) -> tuple[Scene, Path]:
    """A scene by name or path, and its folder.

    A name is looked up beside the recipe (`near`), in the working directory's `scenes/`, then among
    the scenes that ship. Raises `InputError` for a scene that is missing or wrong.
    """
    file = find_scene(name_or_path, near)
    scene = validate(Scene, read_toml(file), str(file))
    for thing in scene.objects:
        if isinstance(thing.shape, Mesh):
            asset(file.parent, thing.shape.file, f"{file}: object '{thing.name}', shape.file")
        if isinstance(thing.material.texture, str):
            where = f"{file}: object '{thing.name}', material.texture"
            asset(file.parent, thing.material.texture, where)
    return scene, file.parent


def find_scene(name_or_path: str, near: Path | None = None) -> Path:
    """The scene.toml that a name or path means; `InputError` with a suggestion if there is none."""
    given = Path(name_or_path)
    beside = [] if near is None else [near / given, near / given / "scene.toml"]
    for candidate in (*beside, given, given / "scene.toml"):
        if candidate.is_file():
            return candidate
    shipped = find(scene_roots, f"{name_or_path}/scene.toml")
    if shipped is not None:
        return shipped
    raise InputError(f"scene: there is no scene {name_or_path!r}{suggestion(name_or_path, scene_names())}")


def scene_names() -> list[str]:
    """Names of the scenes that ship or stand in the working directory."""
    return sorted({file.parent.name for root in scene_roots() for file in root.glob("*/scene.toml")})
