"""Many datasets as one collection: a series of recipes, each made as a job, one index for all of them."""

import os
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Protocol

from pcii.base.errors import InputError
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Report, silent
from pcii.base.safe_files import locked, named_in_errors, temporaries_of
from pcii.store.collection import (
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
from pcii.store.dataset_layout import MANIFEST, MARKER, read_written_manifest
from simgen.dataset.dataset_folder import decisive_versions, find_finished, other_dataset, other_versions
from simgen.dataset.generation import Reuse, make
from simgen.dataset.prepared import prepare
from simgen.renderer import backend
from simgen.spec.recipe import Recipe

Row = Mapping[str, Any]


class Series(Protocol):
    """Datasets of one collection, in order: a sweep over the fields of a recipe, or a benchmark.

    `fields` are names of what distinguishes the datasets, `base` is what all have in common, and files that
    recipes name are in `recipe_folder`. Of each dataset there are the `values` of the fields, the name of its
    `folder`, the same whatever other datasets there are, and its `recipe`, which raises `InputError` if its
    values make none.
    """

    @property
    def fields(self) -> Sequence[str]: ...
    @property
    def base(self) -> Mapping[str, Any]: ...
    @property
    def recipe_folder(self) -> Path: ...
    def __len__(self) -> int: ...
    def values(self, number: int) -> Mapping[str, Any]: ...
    def folder(self, number: int) -> str: ...
    def recipe(self, number: int) -> Recipe: ...


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
        _begin(series, out)
    rows, faults, pieces = list[Row](), list[str](), range(len(series))
    try:
        with closing(executor.run(DatasetJob(series, out), pieces, report)) as work:
            for done in work:
                if done.result is None:
                    faults.append(done.fault)
                else:
                    rows.append(done.result)
                report("datasets", len(rows) + len(faults), len(pieces))
    finally:
        with named_in_errors(out):
            _write_whole_index(series, out, rows)
    return faults


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
        if other_versions(self.versions):
            raise other_dataset(self.out, "collection", self.versions)
        prepared = prepare(self.series.recipe(piece), self.series.recipe_folder)
        folder = self.out / self.series.folder(piece)
        # Sizes show well enough that it is whole: hashes are compared when it is read and verified.
        manifest = find_finished(folder, prepared.identity, content=False)
        manifest = manifest or make(prepared, folder, silent, self.reuse)
        return index_row(folder.name, self.series.values(piece), manifest, folder / MANIFEST)

    def name(self, piece: int) -> str:
        """The dataset's folder."""
        return str(self.out / self.series.folder(piece))

    def use_threads(self, count: int) -> None:
        """Let the renderer run on so many threads."""
        backend.use_threads(count)


def _begin(series: Series, out: Path) -> None:
    """Make the folder of a collection, or raise `InputError` unless it is one of the same recipe.

    Other values of the swept fields may be there already; a collection that ended without any dataset gives
    way to another.
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
    if any(known.get(name) != value for name, value in document.items()):
        raise other_dataset(out, "collection", known.get("versions", {}))


def _is_free(out: Path) -> bool:
    """Whether no collection was begun here, or work on it ended, as its index tells, without a dataset."""
    if not is_collection(out) or not (out / COLLECTION).stat().st_size:
        return True
    return (out / INDEX).is_file() and not any(entry.is_dir() for entry in os.scandir(out))


def _write_whole_index(series: Series, out: Path, rows: Sequence[Row]) -> None:
    """Write the index of all finished datasets in the folder, `rows` and those that others have made.

    Nothing is written where it is there already, so that a folder that is read-only will do.
    """
    content = index_bytes(_all_rows(series, out, rows))
    is_written = (out / INDEX).is_file() and (out / INDEX).read_bytes() == content
    if temporaries_of(out, INDEX, COLLECTION) or not is_written:
        with locked(out / COLLECTION, wait=True):
            for temporary in temporaries_of(out, INDEX, COLLECTION):
                temporary.unlink()
            write_index(out, _all_rows(series, out, rows))


def _all_rows(series: Series, out: Path, rows: Sequence[Row]) -> list[Row]:
    """These rows, those of the index as it is, and of what other processes have finished; in order."""
    by_name: dict[str, Row] = {}
    for row in read_index(out) if (out / INDEX).is_file() else ():
        with suppress(InputError):  # of a dataset that is gone or another one by now
            check_manifest(out, row)
            by_name[row["path"]] = row
    by_name |= {row["path"]: row for row in rows}
    present = {entry.name for entry in os.scandir(out) if entry.is_dir()}
    names = [series.folder(number) for number in range(len(series))]
    for number, name in enumerate(names):
        folder = out / name
        is_missing = name in present and name not in by_name
        if is_missing and (folder / MANIFEST).is_file() and not (folder / MARKER).exists():
            manifest, values = read_written_manifest(folder), series.values(number)
            by_name[name] = index_row(name, values, manifest, folder / MANIFEST)
    return [by_name[name] for name in dict.fromkeys([*names, *by_name]) if name in by_name]
