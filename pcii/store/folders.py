"""Folders that list their files: hashes, lists of files, and the document that makes a folder a finished one.

The document is JSON: its format and version and, of all kinds but collections, every file with size and
SHA-256. It ends in "sha256", a checksum of itself: the SHA-256 of its bytes with 64 zeros in that place.

results.json      of results: their dataset by name and identity, the light, the software
evaluation.json   of an evaluation: what measured its rows; beside it rows.jsonl, a line of JSON for each
                  dataset, light and method
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pcii.base import InputError, json_bytes, write_bytes_safely

if TYPE_CHECKING:
    from pcii.store.manifests import EvaluationManifest, Manifest, ResultsManifest

AnyManifest = TypeVar("AnyManifest", bound="Manifest")
Files = Mapping[str, Mapping[str, Any]]
"""Size (`bytes`) and hash (`sha256`) of files by their paths in a folder."""
LARGEST_DOCUMENT_BYTES = 1 << 27
"""JSON takes up to 30 times its length in memory."""
RESULTS = "results.json"
ROWS = "rows.jsonl"
EVALUATION = "evaluation.json"
LOCK = ".lock"
"""Locked while a run writes to the folder of a collection, and then removed."""
REMEDY = "delete the folder and make or score it again"
"""How errors about damaged files end."""
_NO_CHECKSUM = "0" * 64


def hash_bytes(content: bytes) -> str:
    """SHA-256 of bytes, in hex."""
    return hashlib.sha256(content).hexdigest()


def hash_file(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_json(value: Any) -> str:
    """SHA-256, in hex, of a value that JSON can hold; the order of members of objects does not matter.

    >>> hash_json({"a": 1, "b": [2]}) == hash_json({"b": (2,), "a": 1})
    True
    """
    return hash_bytes(json.dumps(value, sort_keys=True).encode())


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
    try:
        content = (root / name).read_bytes()
    except OSError as fault:
        raise InputError(f"{root / name}: cannot be read ({fault.strerror}); {REMEDY}") from None
    if hash_bytes(content) != entry["sha256"]:
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


def read_small(path: Path, limit: int, remedy: str) -> bytes:
    """Content of a regular file of at most `limit` bytes; raises `InputError` for any other."""
    if not path.is_file():
        raise InputError(f"{path}: missing; {remedy}")
    try:
        with path.open("rb") as file:
            content = file.read(limit + 1)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror}); {remedy}") from None
    if len(content) > limit:
        raise InputError(f"{path}: larger than the {limit} bytes that such a file has at most; {remedy}")
    return content


@dataclass(frozen=True)
class FolderKind:
    """A kind of folder, such as that of a dataset, and the document that makes a folder a finished one."""

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
        write_bytes_safely(folder / self.document, before + hash_bytes(blank).encode() + after)

    def read(self, folder: Path, model: "type[AnyManifest]") -> "AnyManifest":
        """The document as `model`; `InputError` if it is missing, changed, of another format, or no such."""
        from pcii.store.manifests import validated

        path = folder / self.document
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such {self.what} folder")
        if not path.is_file():
            raise InputError(
                f"{folder}: not a finished {self.what} (no {self.document}); `{self.command}` makes one"
            )
        content = read_small(path, LARGEST_DOCUMENT_BYTES, REMEDY)
        try:
            document = json.loads(content)
            checksum = document.pop("sha256").encode()
            before, _, after = content.rpartition(checksum)
            if hash_bytes(before + _NO_CHECKSUM.encode() + after).encode() != checksum:
                raise ValueError("its checksum does not match")
            if (document.get("format"), document.get("format_version")) != (self.format, self.version):
                raise ValueError(f"expected a {self.format} of version {self.version}")
            return validated(model, document)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as fault:
            raise InputError(f"{path}: damaged, or of another release ({fault}); {REMEDY}") from None


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


RESULTS_FOLDER = FolderKind("results", RESULTS, 4, "pcii run", frozenset({RESULTS}))
EVALUATION_FOLDER = FolderKind("evaluation", EVALUATION, 3, "pcii evaluate", frozenset({ROWS}))


def read_results(out: Path) -> "ResultsManifest":
    """The document of a folder of results; raises `InputError` if it is missing or damaged."""
    from pcii.store.manifests import ResultsManifest

    return RESULTS_FOLDER.read(out, ResultsManifest)


def read_evaluation(out: Path) -> "EvaluationManifest":
    """Content of evaluation.json; raises `InputError` if it is missing, not yet there or damaged."""
    from pcii.store.manifests import EvaluationManifest

    return EVALUATION_FOLDER.read(out, EvaluationManifest)
