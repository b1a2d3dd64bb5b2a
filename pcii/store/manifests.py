"""Manifests as pydantic models; members that they do not name are kept.

Imported when a manifest is read, not with the package: pydantic takes a tenth of a second to load.
"""

import re
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    InstanceOf,
    ValidationError,
)
from typing_extensions import TypedDict  # pydantic takes that of the standard library from Python 3.12 on

from pcii.base import InputError, visible
from pcii.types import MOST_BITS, MOST_DEPTHS, MOST_FRAMES, MOST_PHOTONS, CameraGrid, Scope, check_cfa

OPEN = ConfigDict(extra="allow", strict=True, frozen=True, allow_inf_nan=False)


class Manifest(BaseModel):
    """A manifest: attributes for the members that are named here, `[name]` and `get` for all."""

    model_config = OPEN

    def __getitem__(self, name: str) -> Any:
        return dict(self)[name]

    def get(self, name: str, default: Any = None) -> Any:
        """The member of this name, `default` if there is none."""
        return dict(self).get(name, default)


def _path_inside(path: str) -> str:
    parts = PurePosixPath(path).parts
    if not parts or path != "/".join(parts) or ".." in parts or path.startswith("/") or "\0" in path:
        raise ValueError(f"expected a path inside the folder such as counts.zarr/k/zarr.json, got {path!r}")
    return path


def _text(value: Any) -> str:
    # The str of pydantic rejects names of files with bytes that are not valid characters.
    if not isinstance(value, str):
        raise ValueError(f"expected text, got {type(value).__name__}")
    return value


def _camera_grid(value: Any) -> CameraGrid:
    try:
        return CameraGrid(**value)
    except TypeError as fault:
        raise ValueError(f"expected the fields of a CameraGrid ({fault})") from None


Real = Annotated[float, Field(strict=False)]
Text = Annotated[Any, AfterValidator(_text)]
Seconds = Annotated[Real, Field(ge=0)]
Photons = Annotated[Real, Field(gt=0, le=MOST_PHOTONS)]
Depth = Annotated[Real, Field(gt=0)]
ObjectId = Annotated[int, Field(strict=False, gt=-(10**9), lt=10**9)]


class FileEntry(TypedDict):
    """Size and hash of a file."""

    bytes: Annotated[int, Field(ge=0)]
    sha256: Annotated[str, Field(pattern=re.compile(r"\A[0-9a-f]{64}\Z"))]


Files = dict[Annotated[str, AfterValidator(_path_inside)], FileEntry]


class Analysis(TypedDict, total=False):
    """Depths that the recipe suggests."""

    z_mm: Annotated[list[Depth] | None, Field(max_length=MOST_DEPTHS)]
    z_range_mm: Annotated[list[Depth] | None, Field(min_length=2, max_length=2)]


class RecipePhotons(TypedDict, total=False):
    """Photon budgets of the recipe."""

    __pydantic_config__ = OPEN  # type: ignore[misc]
    scope: Scope | None
    budget: Photons | None
    nested: list[Photons] | None


class Recipe(TypedDict, total=False):
    """The members of a recipe that this package reads."""

    __pydantic_config__ = OPEN  # type: ignore[misc]
    scene: str | None
    seed: int | None
    photons: RecipePhotons


class DatasetManifest(Manifest):
    """The manifest of a dataset."""

    title: Text | None = None
    licence: Text | None = None
    citation: Text | None = None
    origin: Text | None = None
    identity: str | None = None
    grid: Annotated[InstanceOf[CameraGrid], BeforeValidator(_camera_grid)]
    cfa: Annotated[str | None, AfterValidator(check_cfa)]
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)] = 1
    bits: Annotated[int, Field(ge=1, le=MOST_BITS)] | None = None
    radiance_channels: Literal[1, 3] | None = None
    radiance_unit: Text | None = None
    objects: dict[ObjectId, Text] = {}
    unscored: list[ObjectId] = []
    are_objects_known: bool = True
    analysis: Analysis | None = None
    photon_budget: Photons | None = None
    recipe: Recipe = {}
    backend: dict[str, Any] | None = None
    photons: dict[str, Any] | None = None
    skipped: list[dict[str, Any]] = []
    timings_s: dict[str, Seconds] = {}
    versions: dict[str, Text] = {}
    files: Files
    packed: list[Text] = []
    """Paths of the files that are in its archive `arrays.zip`."""


class CollectionManifest(Manifest):
    """What the datasets of a collection have in common: their recipe, but for the `fields` that differ."""

    fields: list[str]
    recipe: dict[str, Any] = {}
    versions: dict[str, Text] = {}


class ResultsManifest(Manifest):
    """The manifest of results: the dataset and light that they are of, and `own_software` of then."""

    dataset: Text
    identity: str
    light: Photons | Literal["full-light"] | None
    versions: dict[str, Text] = {}
    files: Files


class EvaluationManifest(Manifest):
    """The manifest of an evaluation, beside the figures of its tables."""

    files: Files


AnyModel = TypeVar("AnyModel", bound=BaseModel)


def validated(model: type[AnyModel], document: Mapping[str, Any]) -> AnyModel:
    """The document as a model; raises `InputError` that names the first member that does not fit."""
    try:
        return model.model_validate(document)
    except ValidationError as fault:
        raise InputError(first_fault(fault)) from None


def first_fault(fault: ValidationError) -> str:
    """The first member that does not fit a model, and what is wrong with it."""
    first = fault.errors(include_url=False)[0]
    member = ".".join(str(step) for step in first["loc"] if step != "[key]")
    return visible(": ".join(filter(None, (member, first["msg"].removeprefix("Value error, ")))))
