"""Many datasets as one collection: a series of recipes, each made as a job, one index for all of them."""

import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Protocol

from pcii.base.errors import InputError
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Report, silent
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
from pcii.store.safe_files import locked, named_in_errors, temporaries_of
from simgen.dataset.dataset_folder import decisive_versions, finished, other_versions
from simgen.dataset.generation import make
from simgen.dataset.prepared import prepare
from simgen.dataset.reuse import Reuse
from simgen.renderer import backend
from simgen.spec.recipe import Recipe

Row = Mapping[str, Any]


class Series(Protocol):
    """Datasets of one collection, in order; a sweep over the fields of a recipe is one."""

    @property
    def fields(self) -> Sequence[str]:
        """Names of what distinguishes the datasets."""
        ...

    @property
    def base(self) -> Mapping[str, Any]:
        """What all datasets have in common."""
        ...

    @property
    def recipe_folder(self) -> Path:
        """Where files are that recipes name."""
        ...

    def __len__(self) -> int: ...

    def values(self, number: int) -> Mapping[str, Any]:
        """Value of each of the fields of a dataset."""
        ...

    def folder(self, number: int) -> str:
        """Name of a dataset's folder, the same whatever other datasets there are."""
        ...

    def recipe(self, number: int) -> Recipe:
        """The recipe of a dataset; raises `InputError` if its values make none."""
        ...


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


class DatasetJob:
    """Makes datasets of `series` in the folder `out`; keeps what one has in common with the next."""

    def __init__(self, series: Series, out: Path) -> None:
        self.series, self.out, self.reuse = series, out, Reuse()
        self.versions = decisive_versions()

    def __call__(self, piece: int) -> Row:
        """Make one dataset, unless it is finished; its row of the index.

        Raises `BusyError` if another process is at it, `InputError` if it cannot be made, or if this process
        has other versions of the software than the one that made the job.
        """
        differ = other_versions(self.versions)
        if differ:
            raise InputError(
                f"{self.name(piece)}: the collection is made with other software ({differ}); install that"
            )
        prepared = prepare(self.series.recipe(piece), self.series.recipe_folder)
        folder = self.out / self.series.folder(piece)
        # Sizes show well enough that it is whole: hashes are compared when it is read and verified.
        manifest = finished(folder, prepared.identity, content=False)
        return row_of(self.series, piece, self.out, manifest or make(prepared, folder, silent, self.reuse))

    def name(self, piece: int) -> str:
        """The dataset's folder."""
        return str(self.out / self.series.folder(piece))

    def use_threads(self, count: int) -> None:
        """Let the renderer run on so many threads."""
        backend.use_threads(count)


def generate_collection(
    series: Series, out: Path, executor: Executor = ALONE, report: Report = silent
) -> list[str]:
    """Make all datasets of a series in the folder `out`, or go on with them; faults of those that failed.

    A dataset that cannot be made holds up no other. The index is written at the end, also of work that is
    interrupted. Raises `InputError` for a folder that holds anything else, and what is no fault of a
    single dataset, such as a full disk.
    """
    backend.choose()  # before work is distributed: a missing backend is reported once
    out = out.resolve()
    with named_in_errors(out):
        begin(series, out)
    rows, faults, pieces = dict[int, Row](), list[str](), range(len(series))
    try:
        with closing(executor.run(DatasetJob(series, out), pieces, report)) as work:
            for done in work:
                if done.result is None:
                    faults.append(done.fault)
                else:
                    rows[done.piece] = done.result
                report("datasets", len(rows) + len(faults), len(pieces))
    finally:
        with named_in_errors(out):
            write_whole_index(series, out, rows)
    return faults
