"""Folders and the files in them: hashes, sizes, lists of files, and whether a folder is free to write to."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pcii.base import InputError

Files = Mapping[str, Mapping[str, Any]]
"""Size (`bytes`) and hash (`sha256`) of files by their paths in a folder."""
REMEDY = "delete the folder and make or score it again"
"""How errors about damaged files end."""


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
    content = (root / name).read_bytes()
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
