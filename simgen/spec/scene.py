"""Scenes: the world in a TOML file, in millimetres; no camera in it.

World axes: X right, Y down, Z forward, the cameras in the plane Z = 0 looking along +Z.
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, field_validator, model_validator

from pcii.base.errors import InputError
from simgen.base.asset_names import AssetName, asset, named_files
from simgen.base.locations import find, scene_roots
from simgen.base.strict_models import (
    LARGEST_MM,
    LONGEST_PART,
    Length,
    Position,
    Real,
    Strict,
    Title,
    Vector,
    at_most,
    faults_of,
    read_toml,
    shorten,
    suggestion,
    validate,
)
from simgen.spec.distributions import draw, is_distribution
from simgen.spec.lights import EnvironmentLight, Level, Light, UniformLight
from simgen.spec.materials import Material, Reflectance
from simgen.spec.recipe import SEED_LIMIT
from simgen.spec.scene_generators import generated, generators
from simgen.spec.shapes import Shape

MOST_OBJECTS = 1000
NAME = "^[A-Za-z][A-Za-z0-9_-]*$"
MOST_LIGHTS = 100
MOST_PLANES = 1000


class SceneObject(Strict):
    """One named thing that truth and scores know."""

    name: Annotated[str, Field(max_length=64, json_schema_extra={"pattern": NAME})]
    """What truth, scores and pictures call it: a letter, then letters, digits, _ and -."""
    position_mm: Position
    """Where the shape's origin stands: X right, Y down, Z away from the cameras."""
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    """Turns about the X, Y and Z axes, applied in this order, in degrees."""
    shape: Shape
    """A sphere, card, box, cylinder or mesh."""
    material: Material
    """Its colour or texture, and its finish."""

    @field_validator("name")
    @classmethod
    def _is_a_name(cls, name: str) -> str:
        if not re.fullmatch(NAME, name):
            shown = shorten(repr(name), LONGEST_PART)
            raise ValueError(
                f"a name is a letter, then letters, digits, _ and -, such as 'left-wheel', not {shown}"
            )
        return name


class Backdrop(Strict):
    """A flat wall parallel to the camera plane, endless for the cameras."""

    z_mm: Length
    """Depth of the wall."""
    reflectance: Reflectance = (0.0, 0.0, 0.0)
    """sRGB, the name of a ColorChecker patch, or a spectrum; as of a material."""
    half_width_mm: Annotated[Real, Field(ge=0, le=LARGEST_MM)] = 5000.0
    """How far it reaches to each side."""


class Scene(Strict):
    """A world to be looked at: objects, lights, and what stands behind."""

    title: Title
    """One line."""
    description: Annotated[str, Field(max_length=10_000)] = ""
    """What it is for."""
    objects: Annotated[tuple[SceneObject, ...], Field(max_length=MOST_OBJECTS), at_most(MOST_OBJECTS)] = ()
    """What truth and scores know by name; none makes an empty scene."""
    lights: Annotated[tuple[Light, ...], Field(max_length=MOST_LIGHTS), at_most(MOST_LIGHTS)] = ()
    """Lamps, and light from all around; at least one, unless an object has a `material.emission`."""
    level: Level | None = None
    """Sets how bright it is; the luminances of lights then tell only how they compare."""
    backdrop: Backdrop | None = None
    """A wall behind the objects, which is no object itself."""
    planes_mm: Annotated[tuple[Length, ...], Field(max_length=MOST_PLANES), at_most(MOST_PLANES)] = ()
    """Depths at which something is in focus; what a recipe without `analysis.z_mm` looks at."""

    @field_validator("lights")
    @classmethod
    def _one_from_all_around(cls, lights: tuple[Light, ...]) -> tuple[Light, ...]:
        if sum(isinstance(light, UniformLight | EnvironmentLight) for light in lights) > 1:
            raise ValueError("only one light can be 'uniform' or 'environment'")
        return lights

    @field_validator("objects")
    @classmethod
    def _names_differ(cls, objects: tuple[SceneObject, ...]) -> tuple[SceneObject, ...]:
        times = Counter(thing.name for thing in objects)
        twice = sorted(name for name, count in times.items() if count > 1)
        if twice:
            raise ValueError(f"two objects are named '{twice[0]}'; give each its own name")
        return objects

    @model_validator(mode="after")
    def _is_lit(self) -> Self:
        if not self.lights and not any(thing.material.emission for thing in self.objects):
            raise ValueError(
                "'lights': nothing shines; give a light, such as { type = \"uniform\", luminance_cd_m2 = "
                "100.0 }, or an object a material.emission"
            )
        return self


def load_scene(
    name_or_path: str, recipe_folder: Path | None = None, number: int | None = None
) -> tuple[Scene, Path]:
    """A scene by name or path, and its folder.

    A name is looked up in `recipe_folder`, in the working directory's `scenes/`, among the scenes that ship,
    then among generators. `number` selects a draw from a distribution of scenes. Raises `InputError` for a
    scene that is missing or wrong, for a number with a single scene, and for a distribution without one.
    """
    values, folder, source = _plain_values(name_or_path, recipe_folder, number)
    scene = validate(Scene, values, source)
    faults: list[str] = []
    for where, name in scene_files(scene):
        try:
            asset(folder, name, where)
        except InputError as fault:
            faults.append(str(fault))
    if faults:
        raise faults_of(source, faults, len(faults))
    return scene, folder


def is_scene_distribution(name_or_path: str, recipe_folder: Path | None = None) -> bool:
    """Whether a name or path means a distribution of scenes (a file or a generator), not one scene."""
    file = find_scene(name_or_path, recipe_folder)
    return file is None or is_distribution(read_toml(file))


def _plain_values(
    name_or_path: str, recipe_folder: Path | None, number: int | None
) -> tuple[dict[str, Any], Path, str]:
    """The values of one scene as TOML holds them, its folder, and what errors call it."""
    file = find_scene(name_or_path, recipe_folder)
    source = name_or_path if file is None else str(file)
    values = {} if file is None else read_toml(file)
    if file is not None and not is_distribution(values):
        if number is not None:
            raise InputError(
                f"scene_number: {source} is one scene, of which there are no draws; leave it out"
            )
        return values, file.parent, source
    if number is None:
        raise InputError(
            f"scene_number: {source} is a distribution of scenes; say which draw, such as scene_number = 0 "
            "in a recipe or --scene 0"
        )
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < SEED_LIMIT:
        raise InputError(f"scene_number: expected a whole number from 0 to 2^63 - 1, got {number!r}")
    if file is None:
        values, folder = generated(name_or_path, number)
    else:
        values, folder = draw(values, number, source), file.parent
    return values, folder, f"{source}, draw {number}"


def scene_files(scene: Scene) -> Iterator[tuple[str, AssetName]]:
    """Every file that a scene names, and the field where: `object 'ball', material.texture`."""
    for thing in scene.objects:
        for where, name in named_files(thing):
            yield f"object '{thing.name}', {where}", name
    yield from named_files(scene.model_copy(update={"objects": ()}))


def find_scene(name_or_path: str, recipe_folder: Path | None = None) -> Path | None:
    """The scene.toml that a name or path means, None for the name of a generator.

    Raises `InputError` with a suggestion if there is neither.
    """
    given = Path(name_or_path)
    beside = [] if recipe_folder is None else [recipe_folder / given, recipe_folder / given / "scene.toml"]
    try:
        for candidate in (*beside, given, given / "scene.toml"):
            if candidate.is_file():
                return candidate
        shipped = find(scene_roots, f"{name_or_path}/scene.toml")
    except OSError:  # a name too long for a file
        shipped = None
    if shipped is not None:
        return shipped
    known = generators()
    if name_or_path in known:
        return None
    shown = shorten(repr(name_or_path), LONGEST_PART)
    raise InputError(f"scene: there is no scene {shown}{suggestion(name_or_path, [*scene_names(), *known])}")


def is_scene(name_or_path: str) -> bool:
    """Whether a name or path means a scene: a folder, a file with lights or objects, or a known name."""
    path = Path(name_or_path)
    if path.is_file():
        values = read_toml(path)
        return "scene" not in values and bool({"lights", "objects"} & set(values))
    if path.is_dir():
        return True
    try:
        find_scene(name_or_path)
    except InputError:
        return False
    return True


def scene_names() -> list[str]:
    """Names of the scenes that ship or stand in the working directory, generators left out."""
    return sorted({file.parent.name for root in scene_roots() for file in root.glob("*/scene.toml")})
