"""Folders that list their files: hashes, and the documents that make folders finished ones.

manifest.json     of a dataset, written last: what it does not list does not belong to the dataset
collection.json   of a collection: the recipe that its datasets have in common, and the fields that differ
results.json      of results: their dataset by name and identity, the light, the software
evaluation.json   of an evaluation: what measured its rows; beside it rows.jsonl, a line of JSON for each
                  dataset, light and method

A document is JSON: its format and version and, of all kinds but collections, every file with size and
SHA-256. It ends in "sha256", a checksum of itself: the SHA-256 of its bytes with 64 zeros in that place.
Members that the models here do not name are kept.
"""

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Generic, Literal, TypeVar

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

from pcii.base import InputError, json_bytes, visible, write_bytes_safely
from pcii.types import MOST_BITS, MOST_DEPTHS, MOST_FRAMES, MOST_PHOTONS, CameraGrid, Scope, check_cfa

Files = Mapping[str, Mapping[str, Any]]
"""Size (`bytes`) and hash (`sha256`) of files by their paths in a folder."""
REMEDY = "delete the folder and make or score it again"
"""How errors about damaged files end."""
MANIFEST = "manifest.json"
MARKER = ".unfinished.json"
"""Present in the folder of a dataset while it is being generated."""
COLLECTION = "collection.json"
LOCK = ".lock"
"""Locked while a run writes to the folder of a collection, and then removed."""
RESULTS = "results.json"
EVALUATION = "evaluation.json"
ROWS = "rows.jsonl"
_NO_CHECKSUM = "0" * 64
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


ListedFiles = dict[Annotated[str, AfterValidator(_path_inside)], FileEntry]


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
    files: ListedFiles
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
    files: ListedFiles


class EvaluationManifest(Manifest):
    """The manifest of an evaluation, beside the figures of its tables."""

    files: ListedFiles


AnyModel = TypeVar("AnyModel", bound=BaseModel)
AnyManifest = TypeVar("AnyManifest", bound=Manifest)


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


def _hash_bytes(content: bytes) -> str:
    """SHA-256 of bytes, in hex."""
    return hashlib.sha256(content).hexdigest()


def hash_file(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_json(value: Any) -> str:
    """SHA-256, in hex, of a value that JSON can hold; the order of members of objects does not matter."""
    return _hash_bytes(json.dumps(value, sort_keys=True).encode())


def list_files(root: Path, parts: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Size and SHA-256 of every file of the named parts (files or folders), by path relative to `root`."""
    entries: dict[str, dict[str, Any]] = {}
    for part in parts:
        top = root / part
        for file in [top] if top.is_file() else sorted(p for p in top.rglob("*") if p.is_file()):
            name = file.relative_to(root).as_posix()
            entries[name] = {"bytes": file.stat().st_size, "sha256": hash_file(file)}
    return entries


def lists_part(files: Iterable[str], part: str) -> bool:
    """Whether any of the listed files is `part`, or lies in the folder of this name."""
    return any(name == part or name.startswith(f"{part}/") for name in files)


def check_size(root: Path, name: str, entry: Mapping[str, Any]) -> None:
    """Raise `InputError` if a listed file is missing, or has another size."""
    path = root / name
    if not path.is_file():
        raise InputError(f"{path}: listed in the manifest but missing; {REMEDY}")
    if path.stat().st_size != entry["bytes"]:
        raise InputError(f"{path}: truncated or changed, expected {entry['bytes']} bytes; {REMEDY}")


def read_listed(root: Path, name: str, entry: Mapping[str, Any]) -> bytes:
    """Content of a listed file; `InputError` if it is missing, or has another size or hash."""
    check_size(root, name, entry)
    content = (root / name).read_bytes()
    if _hash_bytes(content) != entry["sha256"]:
        raise InputError(f"{root / name}: its content does not match the manifest's SHA-256; {REMEDY}")
    return content


def read_part(root: Path, files: Files, part: str) -> dict[str, bytes]:
    """Content of the listed files of the folder `part` by their paths; `InputError` as `read_listed`."""
    listed = {name: entry for name, entry in files.items() if name.startswith(f"{part}/")}
    return {name: read_listed(root, name, entry) for name, entry in listed.items()}


def unlisted_files(root: Path, listed: Iterable[str]) -> list[str]:
    """Paths, relative to `root`, of the files in it that are not listed."""
    present = {path.relative_to(root).as_posix() for path in root.rglob("*") if not path.is_dir()}
    return sorted(present - set(listed))


def entries(folder: Path, what: str) -> set[str]:
    """Names in a folder for `what`, none if there is no folder; raises `InputError` for a file."""
    try:
        return {entry.name for entry in folder.iterdir()}
    except FileNotFoundError:
        return set()
    except NotADirectoryError:
        raise InputError(f"{folder}: this is a file; name a folder for the {what}") from None


def check_free(folder: Path, what: str) -> None:
    """Raise `InputError` unless a folder for `what` is new or empty."""
    if entries(folder, what):
        raise InputError(f"{folder}: holds something else; name a new or empty folder")


@dataclass(frozen=True)
class FolderKind(Generic[AnyManifest]):
    """A kind of folder, such as that of a dataset, and the document that makes a folder a finished one."""

    model: type[AnyManifest]
    what: str
    document: str
    version: int
    command: str
    """The command that makes such folders."""
    marks: frozenset[str]
    """Files of which every such folder has one, finished or not."""

    @property
    def format(self) -> str:
        """Name of the document's format."""
        return f"photon-integral-imaging {self.what}"

    def guard(self, folder: Path) -> set[str]:
        """Names of what is in a folder to be written to: none in a new one, else those of one of this kind.

        Raises `InputError` for a file, and for a folder that holds something else.
        """
        left_by_a_kill = f".{self.document}."
        names = {name for name in entries(folder, self.what) if not name.startswith((LOCK, left_by_a_kill))}
        if names and not names & self.marks:
            raise InputError(f"{folder}: holds something else; name a new or empty folder")
        return names

    def write(self, folder: Path, content: Mapping[str, Any]) -> None:
        """Write the document, atomically."""
        document = {"format": self.format, "format_version": self.version, **content}
        blank = json_bytes({**document, "sha256": _NO_CHECKSUM})
        before, after = blank.rsplit(_NO_CHECKSUM.encode(), 1)
        write_bytes_safely(folder / self.document, before + _hash_bytes(blank).encode() + after)

    def read(self, folder: Path) -> AnyManifest:
        """The document; `InputError` if it is missing, changed, or of another format or content."""
        path = folder / self.document
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such {self.what} folder")
        if not path.is_file():
            raise InputError(
                f"{folder}: not a finished {self.what} (no {self.document}); `{self.command}` makes one"
            )
        content = path.read_bytes()
        try:
            document = json.loads(content)
            checksum = document.pop("sha256").encode()
            before, _, after = content.rpartition(checksum)
            if _hash_bytes(before + _NO_CHECKSUM.encode() + after).encode() != checksum:
                raise ValueError("its checksum does not match")
            if (document.get("format"), document.get("format_version")) != (self.format, self.version):
                raise ValueError(f"expected a {self.format} of version {self.version}")
            return validated(self.model, document)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as fault:
            raise InputError(f"{path}: damaged, or of another release ({fault}); {REMEDY}") from None


DATASET_FOLDER = FolderKind(
    DatasetManifest, "dataset", MANIFEST, 2, "simgen generate", frozenset({MANIFEST, MARKER})
)
COLLECTION_FOLDER = FolderKind(
    CollectionManifest, "collection", COLLECTION, 1, "simgen generate", frozenset({COLLECTION})
)
RESULTS_FOLDER = FolderKind(ResultsManifest, "results", RESULTS, 4, "pcii run", frozenset({RESULTS}))
EVALUATION_FOLDER = FolderKind(
    EvaluationManifest, "evaluation", EVALUATION, 3, "pcii evaluate", frozenset({ROWS})
)


def read_manifest(root: Path) -> DatasetManifest:
    """The manifest of a finished dataset; `InputError` if it is unfinished, or the manifest is damaged."""
    if (root / MARKER).is_file():
        raise InputError(f"{root}: unfinished; the same `simgen generate` command goes on from here")
    return DATASET_FOLDER.read(root)
