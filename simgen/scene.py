"""Scenes: the world in a TOML file, in millimetres; no camera in it.

World axes: X right, Y down, Z forward, the cameras in the plane Z = 0 looking along +Z.
"""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from pcii.errors import InputError
from simgen.locations import find, scene_roots
from simgen.schema import (
    Colour,
    NonNegative,
    Positive,
    Real,
    Strict,
    Vector,
    read_toml,
    suggestion,
    validate,
)


class Sphere(Strict):
    """A sphere about the object's position."""

    type: Literal["sphere"] = "sphere"
    radius_mm: Positive


class Card(Strict):
    """A flat rectangle about the object's position; unrotated it faces the cameras."""

    type: Literal["card"] = "card"
    width_mm: Positive
    height_mm: Positive


class Mesh(Strict):
    """A PLY mesh in the scene's folder, in millimetres about the object's position."""

    type: Literal["mesh"] = "mesh"
    file: str
    """File name, inside the scene's folder."""
    scale: Positive = 1.0


Shape = Annotated[Sphere | Card | Mesh, Field(discriminator="type")]


class Matt(Strict):
    """Scatters light evenly (Lambert)."""

    type: Literal["matt"] = "matt"


class Plastic(Strict):
    """A coloured body under a clear coat of refractive index 1.49, which gives highlights."""

    type: Literal["plastic"] = "plastic"
    roughness: Annotated[Real, Field(ge=0.001, le=1)] = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


class Metal(Strict):
    """A bare metal by its chemical symbol, with the measured refractive index of that metal."""

    type: Literal["metal"] = "metal"
    name: Literal["Ag", "Al", "Au", "Cr", "Cu", "W"]
    roughness: Annotated[Real, Field(ge=0.001, le=1)] = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


Finish = Matt | Plastic | Metal


class Material(Strict):
    """What a surface does with light: its colour, by a reflectance or a texture, and its finish."""

    reflectance: Colour | None = None
    """sRGB reflectance, three numbers from 0 to 1."""
    texture: str | None = None
    """An sRGB image file inside the scene's folder, laid out by the shape's texture coordinates."""
    finish: Finish = Field(default=Matt(), discriminator="type")
    """Matt unless told otherwise; { type = "plastic", roughness = 0.1 } adds highlights."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        coloured = not isinstance(self.finish, Metal)
        if coloured and (self.reflectance is None) == (self.texture is None):
            raise ValueError("give either 'reflectance' or 'texture'")
        if not coloured and (self.reflectance is not None or self.texture is not None):
            raise ValueError("a metal's colour is its own; give no 'reflectance' and no 'texture'")
        return self


class SceneObject(Strict):
    """One named thing that truth and scores know."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
    position_mm: Vector
    """Where the shape's origin stands: X right, Y down, Z away from the cameras."""
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    """Turns about the X, Y and Z axes, applied in this order, in degrees."""
    shape: Shape
    material: Material


class AreaLight(Strict):
    """A flat rectangular lamp that shines from its position towards a target."""

    type: Literal["area"] = "area"
    position_mm: Vector
    target_mm: Vector
    width_mm: Positive
    height_mm: Positive
    luminance_cd_m2: Positive
    illuminant: str = "D65"
    """Colour of the light: a CIE illuminant by name, such as D65, A or FL2."""


class UniformLight(Strict):
    """The same luminance from everywhere, seen by the cameras where nothing is hit."""

    type: Literal["uniform"] = "uniform"
    luminance_cd_m2: Positive
    illuminant: str = "D65"
    """Colour of the light: a CIE illuminant by name, such as D65, A or FL2."""


Light = Annotated[AreaLight | UniformLight, Field(discriminator="type")]


class Backdrop(Strict):
    """A flat wall parallel to the camera plane, endless for the cameras."""

    z_mm: Positive
    reflectance: Colour = (0.0, 0.0, 0.0)
    """sRGB reflectance, three numbers from 0 to 1."""
    half_width_mm: NonNegative = 5000.0


class Scene(Strict):
    """A world to be looked at: objects, lights, and what stands behind."""

    title: str
    description: str = ""
    objects: tuple[SceneObject, ...] = ()
    lights: Annotated[tuple[Light, ...], Field(min_length=1)]
    backdrop: Backdrop | None = None

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
        if thing.material.texture is not None:
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


def asset(folder: Path, name: str, where: str) -> Path:
    """A file of a scene, which must lie inside the scene's folder."""
    root = folder.resolve()
    path = (root / name).resolve()
    if not path.is_relative_to(root):
        raise InputError(f"{where}: {name!r} lies outside the scene's folder")
    if not path.is_file():
        raise InputError(f"{where}: there is no file {name!r} in {folder}")
    return path
