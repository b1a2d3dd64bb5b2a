"""The folder of a collection that is being made: whose it is, and the index of what is finished."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.io.collection_layout import (
    COLLECTION,
    COLLECTION_FOLDER,
    INDEX,
    check_manifest,
    index_bytes,
    index_row,
    is_collection,
    read_collection,
    read_index,
    write_index,
)
from pcii.io.dataset_layout import MANIFEST, MARKER, read_written_manifest
from pcii.store.safe_files import locked, temporaries_of
from simgen.collection.series import Series
from simgen.dataset.software import decisive_versions, other_versions

Row = Mapping[str, Any]


def begin(series: Series, out: Path) -> None:
    """Make the folder of a collection, or see that it is one of the same recipe.

    Other values of the swept fields may be there already; a collection that ended without any dataset gives
    way to another. `InputError` for a file, a dataset, the
    collection of another recipe or other software, or a folder that holds something else.
    """
    if (out / MANIFEST).exists() or (out / MARKER).exists():
        raise InputError(f"{out}: holds a single dataset; name another folder for a collection")
    document = {
        "fields": list(series.fields),
        "recipe": {name: value for name, value in series.base.items() if name != "publication"},
        "versions": decisive_versions(),
    }
    COLLECTION_FOLDER.guard(out)
    out.mkdir(parents=True, exist_ok=True)
    if _is_free(out):  # else nothing is written, not even for the lock: a finished one may be read-only
        with locked(out / COLLECTION, wait=True):
            if _is_free(out):
                COLLECTION_FOLDER.write(out, document)
    known = read_collection(out)
    if any(known.get(name) != document[name] for name in ("fields", "recipe")):
        raise InputError(
            f"{out}: holds the collection of another recipe or of other swept fields; name a new folder"
        )
    differ = other_versions(known.get("versions", {}))
    if differ:
        raise InputError(
            f"{out}: holds the collection of other software, whose photons may differ ({differ}); name a new "
            "folder, or install that software"
        )


def _is_free(out: Path) -> bool:
    """Whether no collection was begun here, or work on it ended, as its index tells, without a dataset."""
    if not is_collection(out) or not (out / COLLECTION).stat().st_size:
        return True
    return (out / INDEX).is_file() and not any(entry.is_dir() for entry in os.scandir(out))


def row_of(series: Series, number: int, out: Path, manifest: Mapping[str, Any]) -> Row:
    """The index's row of a finished dataset."""
    name = series.folder(number)
    return index_row(name, series.values(number), manifest, out / name / MANIFEST)


def write_whole_index(series: Series, out: Path, rows: Mapping[int, Row]) -> None:
    """Write the index of all finished datasets in the folder: these of the series by number, and others.

    Others are those that the index listed before, and those that other processes have finished. Nothing is
    written where that is there already, so that a folder that is read-only will do.
    """
    if temporaries_of(out, INDEX, COLLECTION) or not _is_listed(out, _finished_rows(series, out, rows)):
        with locked(out / COLLECTION, wait=True):
            for left in temporaries_of(out, INDEX, COLLECTION):
                left.unlink()
            write_index(out, _finished_rows(series, out, rows))


def _is_listed(out: Path, rows: Sequence[Row]) -> bool:
    """Whether the index is that of these rows."""
    return (out / INDEX).is_file() and (out / INDEX).read_bytes() == index_bytes(rows)


def _finished_rows(series: Series, out: Path, rows: Mapping[int, Row]) -> list[Row]:
    listed = {row["path"]: row for row in _known(out)}
    present = {entry.name for entry in os.scandir(out) if entry.is_dir()}
    found: dict[str, Row] = {}
    for number in range(len(series)):
        name = series.folder(number)
        row = rows.get(number) or listed.get(name)
        if row is None and name in present and _is_finished(out / name):
            row = row_of(series, number, out, read_written_manifest(out / name))
        if row is not None:
            found[name] = row
    others = {name: row for name, row in listed.items() if name not in found and name in present}
    return [*found.values(), *others.values()]


def _is_finished(folder: Path) -> bool:
    return (folder / MANIFEST).is_file() and not (folder / MARKER).exists()


def _known(out: Path) -> list[dict[str, Any]]:
    """Rows of the index as it is, but for those whose datasets are gone or others by now."""
    if not (out / INDEX).is_file():
        return []
    rows = []
    for row in read_index(out):
        try:
            check_manifest(out, row)
        except InputError:
            continue
        rows.append(row)
    return rows
