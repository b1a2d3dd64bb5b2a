"""rows.jsonl: one JSON object per measured score, written safely by several processes at once.

A row belongs to a dataset (by its identity), a photon budget or full light, and a method. What is measured
again, since other software made it, is added below, and the last row counts.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcii.base.errors import InputError
from pcii.base.safe_files import locked, named_in_errors
from pcii.store.dataset import FULL_LIGHT, Budget, Dataset
from pcii.store.folders import EVALUATION_FOLDER, ROWS, hash_json

if TYPE_CHECKING:
    from pcii.store.manifests import DatasetManifest

Row = dict[str, Any]
Key = tuple[str, Budget, str, tuple[float, ...]]
Cells = Mapping[tuple[Budget, str], Mapping[str, Row]]
"""Rows of one scene by budget and method, and then by the identity of their dataset."""


@dataclass(frozen=True)
class Measure:
    """What methods of one kind are compared by: the value of a row, and the sign that makes more better."""

    name: str
    of: Callable[[Row], float | None]
    sign: int


def by_light(budget: Budget) -> tuple[int, float]:
    """Key that sorts budgets by light: numbers of photons, then an exposure, then full light.

    >>> sorted([FULL_LIGHT, None, 300.0, 30.0], key=by_light)
    [30.0, 300.0, None, 'full-light']
    """
    if budget == FULL_LIGHT:
        return 2, 0.0
    return (1, 0.0) if budget is None else (0, float(budget))


def identity_of(manifest: "DatasetManifest") -> str:
    """Identity of a dataset: that in its manifest, else a hash of its files' hashes."""
    return manifest.identity or hash_json(manifest.files)


def recipe_of(manifest: "DatasetManifest") -> str:
    """Hash of a dataset's recipe without the seed, and of its scene; seeds of one recipe share it."""
    recipe = {name: value for name, value in manifest.recipe.items() if name != "seed"}
    if not recipe:
        return identity_of(manifest)[:16]
    return hash_json({"recipe": recipe, "scene": manifest.get("scene")})[:16]


def described(dataset: Dataset, z_mm: Sequence[float]) -> Row:
    """The fields of a row that describe its dataset, seen at the depths `z_mm` or, of none, at its own."""
    manifest = dataset.manifest
    recipe = manifest.recipe
    settings = dict(_settings({name: recipe[name] for name in recipe if name not in ("title", "seed")}))
    row = {
        "dataset": dataset.name,
        "identity": identity_of(manifest),
        "recipe": recipe_of(manifest),
        "title": manifest.title or dataset.name,
        "scene": recipe.get("scene"),
        "seed": recipe.get("seed"),
        "settings": settings,
    }
    if not z_mm:
        return row
    apart = {
        "settings": settings | {"analysis.z_mm": [*z_mm]},
        "recipe": hash_json([row["recipe"], *z_mm])[:16],
    }
    return row | apart | {"z_mm": [*z_mm]}


def _settings(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables by its dotted name, as `--set` takes it."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _settings(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def key_of(row: Mapping[str, Any]) -> Key:
    """Identity of the dataset, photon budget and method of a row, and depths where others were asked for."""
    return row["identity"], row["budget"], row["method"], tuple(row.get("z_mm", ()))


def claim_rows(out: Path) -> None:
    """Make `out` the folder of an evaluation; `InputError` if it holds something else."""
    EVALUATION_FOLDER.guard(out)
    out.mkdir(parents=True, exist_ok=True)
    (out / ROWS).touch()


@contextmanager
def all_rows(out: Path) -> Iterator[list[Row]]:
    """The last row of each key in the folder; other processes wait until the block ends before they add any.

    A last line without a line break is left by a process that was killed, and is ignored. Raises `InputError`
    for any other line that is not a row as it was written.
    """
    with locked(out / ROWS, wait=True) as file:
        *lines, _ = file.read().split(b"\n")
        rows: dict[Key, Row] = {}
        for number, line in enumerate(lines, start=1):
            try:
                row = json.loads(line)
                rows[key_of(row)] = row
            except (ValueError, KeyError, TypeError) as fault:
                raise InputError(f"{out / ROWS}: line {number}: {fault}; delete that line") from None
        yield list(rows.values())


def append_row(out: Path, row: Row) -> None:
    """Add a row and flush it to disk, after removing an incomplete last line of a killed process."""
    # Names of files may hold bytes that are not valid characters.
    text = json.dumps(row, ensure_ascii=False, allow_nan=False)
    line = text.encode(errors="backslashreplace") + b"\n"
    with named_in_errors(out / ROWS), locked(out / ROWS, wait=True) as file:
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
        file.write(line)
        file.flush()
        os.fsync(file.fileno())
