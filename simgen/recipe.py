"""Recipes: one TOML file a dataset, resolved and validated before anything is rendered."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from pcii.bayer import PATTERNS
from pcii.errors import InputError
from pcii.types import CameraGrid
from simgen.locations import find, recipe_roots
from simgen.schema import Count, Positive, Strict, read_toml, suggestion, validate

Cfa = Literal["GRBG", "RGGB", "BGGR", "GBRG", "none"]
MOST_PATHS = 1 << 31
"""One rendering pass counts its paths in 32 bits."""
assert set(Cfa.__args__) == {*PATTERNS, "none"}


class Grid(Strict):
    """The camera grid: parallel pinhole cameras in the plane Z = 0."""

    rows: Count = 10
    cols: Count = 10
    pitch_mm: tuple[Positive, Positive] = (5.0, 5.0)
    """Distance between neighbouring cameras, (x, y)."""
    focal_mm: Positive = 50.0
    """Distance from pinhole to sensor."""
    pixel_mm: Positive = 0.0352
    """Side of a square pixel."""
    height: Count = 1024
    """Rows of pixels of one view."""
    width: Count = 1024
    """Columns of pixels of one view."""

    def camera_grid(self) -> CameraGrid:
        """The same grid as the type that the dataset is written with."""
        return CameraGrid(**self.model_dump())


class Sensor(Strict):
    """What stands on the pixels."""

    cfa: Cfa = "GRBG"
    """Bayer pattern by its first two rows, or "none" for a monochrome sensor."""


class Photons(Strict):
    """How much light there is."""

    budget: Positive = 1000.0
    """Expected photons in each `scope`."""
    scope: Literal["view", "channel", "scene"] = "view"
    """What `budget` is counted over: every view, each colour of every view, or all views together."""
    statistics: Literal["poisson", "multinomial"] = "poisson"
    """Poisson counts have a random total with mean `budget`; multinomial counts have it exactly."""


class Render(Strict):
    """How radiance is estimated."""

    samples_per_pixel: Count = 16
    max_depth: Count = 3
    """Longest light path in segments: 2 is direct light, 3 adds one bounce."""


class Products(Strict):
    """What the dataset holds beside its manifest."""

    counts: bool = True
    """Photon counts of every view."""
    truth: bool = True
    """Depth and object of every pixel of the virtual centre."""
    view_truth: bool = False
    """Depth and object of every pixel of every view."""
    radiance: Literal["none", "mosaic", "rgb"] = "none"
    """Full-light images as float32 EXR: behind the Bayer pattern, or all three colours."""


class Analysis(Strict):
    """Where whoever opens the dataset should look; nothing of it is rendered."""

    z_mm: tuple[Positive, ...] = ()
    """Depths of the sections that `pcii run` reconstructs unless told otherwise."""
    z_range_mm: tuple[Positive, Positive] | None = None
    """Nearest and farthest depth that a depth map considers."""

    @model_validator(mode="after")
    def _near_before_far(self) -> Self:
        if self.z_range_mm is not None and self.z_range_mm[0] >= self.z_range_mm[1]:
            raise ValueError("z_range_mm: near must be less than far")
        return self


class Recipe(Strict):
    """A dataset: which scene, seen by which cameras, in how much light, and what is kept."""

    title: str = ""
    scene: Annotated[str, Field(min_length=1)]
    """Name of a scene that ships, or path of a scene folder (relative paths: to the recipe)."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    grid: Grid = Grid()
    sensor: Sensor = Sensor()
    photons: Photons = Photons()
    render: Render = Render()
    products: Products = Products()
    analysis: Analysis = Analysis()

    @model_validator(mode="after")
    def _one_pass_renders_a_view(self) -> Self:
        paths = self.grid.height * self.grid.width * self.render.samples_per_pixel
        if paths >= MOST_PATHS:
            raise ValueError(
                f"a view of {self.grid.height} x {self.grid.width} pixels with "
                f"{self.render.samples_per_pixel} samples each is {paths} paths; fewer than "
                f"{MOST_PATHS} can be rendered at once"
            )
        return self

    @property
    def cfa(self) -> str | None:
        """Bayer pattern, None for a monochrome sensor."""
        return None if self.sensor.cfa == "none" else self.sensor.cfa


def load_recipe(name_or_path: str, overrides: Sequence[str] = ()) -> tuple[Recipe, Path]:
    """A recipe by path or shipped name, with `key=value` overrides; and its folder.

    A key is dotted (`photons.budget=300`), a value is TOML or else taken as a string.
    Raises `InputError` for a recipe that is missing or wrong.
    """
    path = _find_recipe(name_or_path)
    values = read_toml(path)
    for text in overrides:
        _override(values, text)
    source = str(path) if not overrides else f"{path} with --set {' '.join(overrides)}"
    return validate(Recipe, values, source), path.parent


def _find_recipe(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if path.is_file():
        return path
    shipped = find(recipe_roots, f"{name_or_path.removesuffix('.toml')}.toml")
    if shipped is not None and path.parent == Path():
        return shipped
    names = {file.stem for root in recipe_roots() for file in root.glob("*.toml")}
    raise InputError(f"recipe: there is no {name_or_path!r}{suggestion(path.stem, names)}")


def _override(values: dict[str, Any], text: str) -> None:
    key, equals, value = text.partition("=")
    if not equals or not all(key.split(".")):
        raise InputError(f"--set: expected key=value such as photons.budget=300, got {text!r}")
    *tables, last = key.split(".")
    target = values
    for table in tables:
        target = target.setdefault(table, {})
        if not isinstance(target, dict):
            raise InputError(f"--set: {table!r} in {key!r} is a value, not a table")
    try:
        target[last] = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        target[last] = value
