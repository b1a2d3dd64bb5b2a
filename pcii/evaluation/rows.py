"""Scores as they are measured, one JSON object a line in rows.jsonl, through kills and by many processes.

A row belongs to a dataset (by its identity), a photon budget and a method; none is measured twice.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.safe_files import locked
from pcii.io.dataset import Dataset

ROWS = "rows.jsonl"
DEPTH = "depth"
"""Name by which the depth map stands among the methods."""
Row = dict[str, Any]
Key = tuple[str, float | None, str]


def identity_of(manifest: Mapping[str, Any]) -> str:
    """What tells a dataset from others: the manifest's identity, else a hash of its files' hashes."""
    return manifest.get("identity") or _hash(manifest["files"])


def recipe_of(manifest: Mapping[str, Any]) -> str:
    """Hash of a dataset's recipe but for the seed, and of its scene: datasets that share it are repeats."""
    recipe = {name: value for name, value in manifest.get("recipe", {}).items() if name != "seed"}
    if not recipe:
        return identity_of(manifest)[:16]
    return _hash({"recipe": recipe, "scene": manifest.get("scene")})[:16]


def _hash(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def described(dataset: Dataset) -> Row:
    """What a row says of its dataset."""
    manifest = dataset.manifest
    recipe = manifest.get("recipe", {})
    return {
        "dataset": dataset.name,
        "identity": identity_of(manifest),
        "recipe": recipe_of(manifest),
        "title": manifest.get("title") or dataset.name,
        "scene": recipe.get("scene"),
        "seed": recipe.get("seed"),
        "settings": dict(_settings({name: recipe[name] for name in recipe if name not in ("title", "seed")})),
    }


def _settings(table: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables by its dotted name, as `--set` takes it."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _settings(value, f"{place}{name}.")
        else:
            yield f"{place}{name}", value


def key_of(row: Mapping[str, Any]) -> Key:
    """Identity of the dataset, photon budget and method of a row."""
    return row["identity"], row["budget"], row["method"]


def claim_rows(out: Path) -> None:
    """Make `out` the folder of an evaluation; `InputError` if it holds something else."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: this is a file; name a folder for the evaluation")
    if out.is_dir() and any(out.iterdir()) and not (out / ROWS).is_file():
        raise InputError(f"{out}: holds something else; name a new or empty folder")
    out.mkdir(parents=True, exist_ok=True)
    (out / ROWS).touch()


@contextmanager
def all_rows(out: Path) -> Iterator[list[Row]]:
    """Every row that is there, each key once, while no process adds any.

    A last line without an end was being written when its process was killed: it does not count.
    Raises `InputError` for another line that is no row.
    """
    with locked(out / ROWS, wait=True) as file:
        *lines, _ = file.read().split(b"\n")
        rows: dict[Key, Row] = {}
        for number, line in enumerate(lines, start=1):
            try:
                row = json.loads(line)
                rows.setdefault(key_of(row), row)
            except (ValueError, KeyError, TypeError):
                raise InputError(f"{out / ROWS}: line {number} is damaged; delete that line") from None
        yield list(rows.values())


def append_row(out: Path, row: Row) -> None:
    """Add a row and flush it to disk; what a killed process left of a line goes first."""
    text = json.dumps(row, ensure_ascii=False, allow_nan=False)
    line = text.encode(errors="backslashreplace") + b"\n"
    with locked(out / ROWS, wait=True) as file:
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
        file.write(line)
        file.flush()
        os.fsync(file.fileno())
