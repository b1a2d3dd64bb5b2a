"""Pydantic models of the manifests; members that they do not name are allowed and ignored.

Imported when a manifest is read, not with the package: pydantic takes a tenth of a second to load.
"""

import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.types.arrays import MOST_DEPTHS
from pcii.types.bayer import check_cfa
from pcii.types.camera_grid import CameraGrid
from pcii.types.photon_events import MOST_BITS, MOST_FRAMES

MOST_FILE_BYTES = 1 << 50
MOST_PHOTONS = 1 << 62
"""Sums of more may not fit in 64 bits."""


def _relative(path: str) -> str:
    parts = PurePosixPath(path).parts
    if not parts or path != "/".join(parts) or ".." in parts or path.startswith("/") or "\0" in path:
        raise ValueError(f"expected a path inside the folder such as counts.zarr/k/zarr.json, got {path!r}")
    return path


def _text(value: Any) -> str:
    # The str of pydantic rejects names of files with bytes that are not valid characters.
    if not isinstance(value, str):
        raise ValueError(f"expected text, got {type(value).__name__}")
    return value


class _Model(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow", frozen=True, allow_inf_nan=False)


Real = Annotated[float, Field(strict=False)]
Text = Annotated[Any, AfterValidator(_text)]
Seconds = Annotated[Real, Field(ge=0)]
Photons = Annotated[Real, Field(ge=0, le=MOST_PHOTONS)]
Depth = Annotated[Real, Field(gt=0)]
FileName = Annotated[str, AfterValidator(_relative)]
ObjectKey = Annotated[str, Field(pattern=re.compile(r"\A-?[0-9]{1,9}\Z"))]


class FileEntry(_Model):
    """Size and hash of a file."""

    bytes: Annotated[int, Field(ge=0, le=MOST_FILE_BYTES)]
    sha256: Annotated[str, Field(pattern=re.compile(r"\A[0-9a-f]{64}\Z"))]


class Analysis(_Model):
    """Depths that the recipe suggests."""

    z_mm: Annotated[list[Depth] | None, Field(max_length=MOST_DEPTHS)] = None
    z_range_mm: Annotated[list[Depth] | None, Field(min_length=2, max_length=2)] = None


class RecipePhotons(_Model):
    """Photon budgets of the recipe."""

    scope: str | None = None
    budget: Photons | None = None
    nested: list[Photons] | None = None


class RecipeRender(_Model):
    """How the recipe asked for radiance."""

    samples_per_pixel: int | None = None


class Recipe(_Model):
    """The fields of the recipe that this package reads."""

    scene: str | None = None
    seed: int | None = None
    photons: RecipePhotons = RecipePhotons()
    render: RecipeRender | None = None


class Backend(_Model):
    """The renderer that made the data."""

    variant: str
    mitsuba: str


class PhotonLog(_Model):
    """How the photons were drawn."""

    method: str | None = None
    total: int | None = None
    paths: int | None = None
    dense_paths_instead: int | None = None
    samples_per_pixel: int | None = None
    rendering_noise: Real | None = None


class SkippedWork(_Model):
    """Work that was skipped: what, why, and how much of `unit` that saved."""

    what: Text
    why: Text
    saved: Real
    unit: Text


class Grid(_Model):
    """The fields of a `CameraGrid`, which checks their values."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rows: Any
    cols: Any
    pitch_mm: Any
    focal_mm: Any
    pixel_mm: Any
    height: Any
    width: Any
    shear_px: Any = (0.0, 0.0)


class DatasetManifest(_Model):
    """The manifest of a dataset."""

    title: Text | None = None
    licence: Text | None = None
    citation: Text | None = None
    origin: Text | None = None
    identity: str | None = None
    grid: Grid
    cfa: str | None
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)] = 1
    bits: Annotated[int, Field(ge=1, le=MOST_BITS)] | None = None
    radiance_channels: Literal[1, 3] | None = None
    objects: dict[ObjectKey, Text] = {}
    analysis: Analysis | None = None
    photon_budget: Photons | None = None
    recipe: Recipe = Recipe()
    backend: Backend | None = None
    photons: PhotonLog | None = None
    skipped: list[str | SkippedWork] = []  # sentences in older manifests
    timings_s: dict[str, Seconds] = {}
    versions: dict[str, Text] = {}
    files: dict[FileName, FileEntry]


class CollectionDocument(_Model):
    """What the datasets of a collection have in common."""

    fields: list[str]
    recipe: dict[str, Any] = {}
    versions: dict[str, Text] = {}


class FileList(_Model):
    """A list of the files of a folder."""

    files: dict[FileName, FileEntry]


class ResultsManifest(FileList):
    """The list of a folder of results."""

    format_version: Literal[3]
    dataset: Text
    identity: str
    light: Photons | Literal["full-light"] | None
    versions: dict[str, Text]


def validate(model: type[BaseModel], document: Mapping[str, Any], path: Path, remedy: str) -> None:
    """Raise `InputError`, naming path and member, for the first member that does not fit the model."""
    try:
        model.model_validate(document)
        if model is DatasetManifest:
            CameraGrid(**document["grid"])
            check_cfa(document["cfa"])
    except ValidationError as fault:
        first = fault.errors(include_url=False)[0]
        member = ".".join(str(step) for step in first["loc"] if step != "[key]")
        sentence = f"{member}: {first['msg'].removeprefix('Value error, ')}"
        raise InputError(f"{path}: {visible(sentence)}; {remedy}") from None
    except InputError as fault:
        raise InputError(f"{path}: {visible(str(fault))}; {remedy}") from None
