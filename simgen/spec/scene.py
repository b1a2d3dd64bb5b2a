"""Scenes: the world as an object or in a TOML file, in millimetres; no camera in it. Shapes of its objects.

World axes: X right, Y down, Z forward, the cameras in the plane Z = 0 looking along +Z.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, PrivateAttr, Tag, field_validator, model_validator

from pcii.base import InputError, write_bytes_safely
from pcii.store import entries
from simgen.base import (
    LARGEST_MM,
    LARGEST_TOML_BYTES,
    AssetName,
    Length,
    MeshName,
    Position,
    Real,
    Strict,
    Title,
    Vector,
    asset,
    named_files,
    shorten,
    shown_value,
    suggestion,
    toml_text,
    validate,
)
from simgen.spec.lights import Level, Light, LightAround
from simgen.spec.materials import Material, Reflectance
from simgen.spec.mitsuba_file import MitsubaScene, MitsubaXml

MOST_OBJECTS = 1000
NAME = "^[A-Za-z][A-Za-z0-9_-]*$"
LONGEST_NAME = 64
MOST_LIGHTS = 100
MOST_PLANES = 1000
LARGEST_SCALE = 1e15


class Sphere(Strict):
    """A sphere about the object's position; a picture goes around it like a map around a globe.

    Its middle faces the cameras, its upper border is the pole above, its sides meet behind.
    """

    type: Literal["sphere"] = "sphere"
    radius_mm: Length


class Card(Strict):
    """A flat rectangle about the object's position; unrotated it faces the cameras, picture upright."""

    type: Literal["card"] = "card"
    width_mm: Length
    height_mm: Length


class Box(Strict):
    """A box about the object's position; each of its six sides bears the whole picture.

    Unrotated its front faces the cameras. From there the front is upright, and so are the other sides
    for whoever walks around; the top is laid with its lower border in front, the bottom with its upper.
    """

    type: Literal["box"] = "box"
    width_mm: Length
    height_mm: Length
    depth_mm: Length


class Cylinder(Strict):
    """An upright cylinder with closed ends about the object's position, its axis along Y.

    A picture goes once around, upright, its middle in front and its sides meeting behind. Each end
    bears the picture's largest circle, laid as on the top and bottom of a box.
    """

    type: Literal["cylinder"] = "cylinder"
    radius_mm: Length
    length_mm: Length


def _has_extent(scales: tuple[float, float, float]) -> tuple[float, float, float]:
    if not all(scales):
        raise ValueError("a scale is not 0")
    return scales


Factor = Annotated[Real, Field(ge=-LARGEST_SCALE, le=LARGEST_SCALE)]
Scale = Annotated[
    Annotated[Factor, Field(gt=0), Tag("number")]
    | Annotated[tuple[Factor, Factor, Factor], AfterValidator(_has_extent), Tag("three")],
    Discriminator(lambda scale: "number" if isinstance(scale, int | float) else "three"),
]
"""One number, or three along the axes, of which negative ones mirror."""


class Mesh(Strict):
    """A PLY or OBJ mesh in the scene's folder; its axes are the world's, about the object's position.

    Its own texture coordinates (in PLY named s, t or u, v) begin at the picture's lower left. Without normals
    its faces are flat.
    """

    type: Literal["mesh"] = "mesh"
    file: Annotated[str, MeshName]
    """Name of a .ply or .obj file inside the scene's folder."""
    scale: Scale = 1.0
    """Millimetres for one unit of the file; or three numbers along the mesh's own axes, negative ones of
    which mirror it."""


Shape = Annotated[Sphere | Card | Box | Cylinder | Mesh, Field(discriminator="type")]


class SceneObject(Strict):
    """One named thing that truth and scores know."""

    name: Annotated[str, Field(max_length=LONGEST_NAME, pattern=NAME)]
    """What truth, scores and pictures call it: a letter, then letters, digits, _ and -."""
    position_mm: Position
    """Where the shape's origin stands: X right, Y down, Z away from the cameras."""
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    """Turns about the X, Y and Z axes, applied in this order, in degrees."""
    shape: Shape
    material: Material
    scored: Annotated[bool, Field(exclude_if=bool)] = True
    """False for what is there but counts in no score, such as a table, a floor or a wall."""


class Backdrop(Strict):
    """A flat wall parallel to the camera plane, endless for the cameras."""

    z_mm: Length
    reflectance: Reflectance = (0.0, 0.0, 0.0)
    """sRGB, the name of a ColorChecker patch, or a spectrum; as of a material."""
    half_width_mm: Annotated[Real, Field(ge=0, le=LARGEST_MM)] = 5000.0
    """How far it reaches to each side."""


class _Move(Strict):
    by_mm: Position
    to_mm: Position
    rotation_deg: Vector


class Scene(Strict):
    """A world to be looked at: objects, lights, and what stands behind.

    It is frozen: what changes it gives a new scene. `folder` is that of the files that it names, and may be
    None if it names none; scenes are equal whatever their folders. A fault raises `InputError`.

    >>> from simgen import Material, SceneObject, Sphere, UniformLight
    >>> ball = SceneObject(name="ball", position_mm=(0, 0, 540), shape=Sphere(radius_mm=30),
    ...                    material=Material(reflectance=(0.8, 0.3, 0.2)))
    >>> scene = Scene(title="A ball", lights=(UniformLight(luminance_cd_m2=100),)).add(ball)
    >>> scene.move("ball", by_mm=(0, 0, 80)).object("ball").position_mm
    (0.0, 0.0, 620.0)
    """

    _folder: Path | None = PrivateAttr(default=None)
    # No field: fields are what a scene.toml holds and what digests of scenes are made of. Type checkers are
    # told that it is one, so that they know it among the arguments.
    if TYPE_CHECKING:
        folder: Path | None = None
    else:

        def __init__(self, *, folder: str | Path | None = None, **values: Any) -> None:
            super().__init__(**values)
            self._folder = None if folder is None else Path(folder)

        __init__.__pydantic_base_init__ = True

        @property
        def folder(self) -> Path | None:
            """Folder of the files that the scene names."""
            return self._folder

    title: Title
    description: Annotated[str, Field(max_length=10_000)] = ""
    objects: Annotated[tuple[SceneObject, ...], Field(max_length=MOST_OBJECTS)] = ()
    """What truth and scores know by name; none makes an empty scene."""
    lights: Annotated[tuple[Light, ...], Field(max_length=MOST_LIGHTS)] = ()
    """Lamps, and light from all around; at least one, unless an object has a `material.emission`."""
    level: Level | None = None
    """Sets how bright it is; the luminances of lights then tell only how they compare."""
    backdrop: Backdrop | None = None
    """A wall behind the objects, which is no object itself."""
    mitsuba: Annotated[MitsubaScene | None, Field(exclude_if=lambda file: file is None)] = None
    """A Mitsuba scene by the name of its XML file, or a table that says where it stands, too. All that it has
    is part of the scene, beside objects and lights of its own."""
    planes_mm: Annotated[tuple[Length, ...], Field(max_length=MOST_PLANES)] = ()
    """Depths at which something is in focus; what a recipe without `analysis.z_mm` looks at."""

    @property
    def light_around(self) -> LightAround | None:
        """What shines from all around, if anything does."""
        return next((light for light in self.lights if isinstance(light, LightAround)), None)

    @field_validator("lights")
    @classmethod
    def _one_from_all_around(cls, lights: tuple[Light, ...]) -> tuple[Light, ...]:
        if sum(isinstance(light, LightAround) for light in lights) > 1:
            raise ValueError("only one light can be 'uniform' or 'environment'")
        return lights

    @field_validator("objects")
    @classmethod
    def _names_differ(cls, objects: tuple[SceneObject, ...]) -> tuple[SceneObject, ...]:
        for name, uses in Counter(thing.name for thing in objects).items():
            if uses > 1:
                raise ValueError(f"two objects are named '{name}'; give each its own name")
        return objects

    @model_validator(mode="after")
    def _is_lit(self) -> Self:
        shines = any(thing.material.emission for thing in self.objects) or self.mitsuba is not None
        if not self.lights and not shines:
            raise ValueError("'lights': nothing shines; give a light, or an object a material.emission")
        return self

    def __eq__(self, other: Any) -> bool:
        return isinstance(other, Scene) and dict(self) == dict(other)

    def object(self, name: str) -> SceneObject:
        """The object of that name; raises `InputError` if there is none."""
        for thing in self.objects:
            if thing.name == name:
                return thing
        known = suggestion(str(name), [thing.name for thing in self.objects])
        raise InputError(f"scene: there is no object {shown_value(name)}{known}")

    def change(self, **fields: Any) -> Self:
        """A scene with other values of these fields, such as `lights`, `title` or `folder`."""
        return super().change(**{"folder": self.folder} | fields)

    def add(self, *things: SceneObject | Light) -> Self:
        """A scene with further objects and lights."""
        objects = tuple(thing for thing in things if isinstance(thing, SceneObject))
        lights = tuple(thing for thing in things if not isinstance(thing, SceneObject))
        return self.change(objects=self.objects + objects, lights=self.lights + lights)

    def remove(self, name: str) -> Self:
        """A scene without the object of that name."""
        gone = self.object(name)
        return self.change(objects=tuple(thing for thing in self.objects if thing is not gone))

    def replace(self, name: str, thing: SceneObject | None = None, /, **fields: Any) -> Self:
        """A scene with another object in the place of one, or with the same but for these fields of it.

        >>> scene = scene.replace("ball", shape=Sphere(radius_mm=20), name="marble")       # doctest: +SKIP
        """
        old = self.object(name)
        new = (thing or old).change(**fields)
        return self.change(objects=tuple(new if each is old else each for each in self.objects))

    def move(
        self,
        name: str,
        *,
        by_mm: Sequence[float] = (0.0, 0.0, 0.0),
        to_mm: Sequence[float] | None = None,
        rotation_deg: Sequence[float] | None = None,
    ) -> Self:
        """A scene in which an object stands elsewhere or further along X, Y, Z, or is turned otherwise.

        `rotation_deg` takes the place of the rotation that it has.
        """
        old = self.object(name)
        values = {
            "by_mm": by_mm,
            "to_mm": old.position_mm if to_mm is None else to_mm,
            "rotation_deg": old.rotation_deg if rotation_deg is None else rotation_deg,
        }
        move = validate(_Move, values, "move")
        place = tuple(a + b for a, b in zip(move.to_mm, move.by_mm, strict=True))
        return self.replace(name, position_mm=place, rotation_deg=move.rotation_deg)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write `folder`/scene.toml, whose path is returned, and beside it the files that the scene names.

        What else is in the folder stays. Raises `InputError`, before anything is written, if a file is there
        with other content, unless it may be overwritten.
        """
        out, text = Path(folder), toml_text(self).encode()
        entries(out, "scene")  # refuses a file
        if len(text) > LARGEST_TOML_BYTES:
            raise InputError(f"{out}: a scene.toml may have {LARGEST_TOML_BYTES} bytes, and this has more")
        source = checked_folder(self)
        files = {out / name: asset(source, name, where).read_bytes() for where, name in scene_files(self)}
        files[out / "scene.toml"] = text
        changes = [path for path in files if not path.is_file() or path.read_bytes() != files[path]]
        for path in changes:
            if path.is_dir() or (path.exists() and not overwrite):
                raise InputError(f"{path}: is there with other content; give overwrite=True")
        for path in changes:
            write_bytes_safely(path, files[path])
        return out / "scene.toml"


def scene_of(values: Mapping[str, Any], folder: Path | None, source: str) -> Scene:
    """The scene with these values and its files in this folder; raises `InputError` if anything is wrong."""
    scene = validate(Scene, values, source).change(folder=folder)
    checked_folder(scene, source)
    return scene


def checked_folder(scene: Scene, source: str = "scene") -> Path:
    """The folder of a scene's files, all of which are there; the working directory if it has and needs none.

    Raises `InputError`, beginning with `source`, for a file that is missing.
    """
    for where, name in scene_files(scene):
        if scene.folder is None:
            raise InputError(f"{source}: {where}: {name!r} is looked for in the scene's folder; give folder=")
        asset(scene.folder, name, f"{source}: {where}")
    return scene.folder or Path()


def names_of_objects(names: Sequence[str], taken: Iterable[str] = ()) -> list[str]:
    """Names like these, but as objects may have them, each different and none of those `taken`."""
    unique: list[str] = []
    used = set(taken)
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-") or "object"
        stem = (plain if plain[0].isalpha() else f"object-{plain}")[: LONGEST_NAME - 6]
        candidates = chain([stem], (f"{stem}-{number}" for number in count(2)))
        unique.append(next(candidate for candidate in candidates if candidate not in used))
        used.add(unique[-1])
    return unique


def check_unscored(unscored: Iterable[str], names: Sequence[str], source: str) -> None:
    """Raise `InputError`, beginning with `source`, if one that counts in no score is not among the names."""
    for name in unscored:
        if name not in names:
            there = shorten(", ".join(names)) or "none"
            raise InputError(f"{source}: unscored: there is no object {shown_value(name)}; it has {there}")


def scene_files(scene: Scene) -> Iterator[tuple[str, AssetName]]:
    """Every file that a scene names, and the field where: `object 'ball', material.texture`."""
    for thing in scene.objects:
        for where, name in named_files(thing):
            yield f"object '{thing.name}', {where}", name
    yield from named_files(scene.model_copy(update={"objects": ()}))
    if scene.mitsuba is not None and scene.folder is not None:
        for name in MitsubaXml(scene.folder, scene.mitsuba.file).files:
            yield f"mitsuba, {scene.mitsuba.file}", AssetName(name)
