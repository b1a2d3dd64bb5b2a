"""Many datasets as one collection: a series of recipes, and one index for all of them."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

from pcii.base import (
    THIS_PROCESS,
    Executor,
    InputError,
    Report,
    locked,
    named_in_errors,
    silent,
    temporaries_of,
)
from pcii.store import (
    COLLECTION,
    COLLECTION_FOLDER,
    INDEX,
    LOCK,
    MANIFEST,
    MARKER,
    check_manifest,
    index_row,
    provenance,
    read_index,
    write_index,
)
from simgen.dataset.generation import Reuse, find_finished, make
from simgen.dataset.prepared import DECISIVE, other_dataset, other_versions, prepare
from simgen.renderer import backend
from simgen.spec import Recipe

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
    series: Series, out: Path, executor: Executor = THIS_PROCESS, report: Report = silent
) -> list[str]:
    """Make all datasets of a series in the folder `out`, or go on with them; faults of those that failed.

    A dataset that cannot be made holds up no other. The index is written at the end, also of work that is
    interrupted. Raises `InputError` for a folder that holds anything else or that another run writes to,
    and what is no fault of a single dataset, such as a full disk.
    """
    backend.choose()  # before work is distributed: a missing backend is reported once
    out = out.resolve()
    rows, faults, pieces = list[Row](), list[str](), range(len(series))
    with named_in_errors(out), _claim(out):
        _begin(series, out)
        report("datasets", 0, len(pieces))
        try:
            # Other processes would have to send what they report.
            within = silent if executor.workers > 1 or executor.scheduler is not None else report
            with closing(executor.run(DatasetJob(series, out, within), pieces)) as results:
                for _, result in results:
                    if isinstance(result, str):
                        faults.append(result)
                    else:
                        rows.append(result)
                    report("datasets", len(rows) + len(faults), len(pieces))
        finally:
            write_index(out, _all_rows(series, out, rows))
    return faults


class DatasetJob:
    """Makes datasets of `series` in the folder `out`; keeps what one has in common with the next."""

    def __init__(self, series: Series, out: Path, report: Report = silent) -> None:
        self.series, self.out, self.report, self.reuse = series, out, report, Reuse()
        self.versions = provenance.versions(*DECISIVE)

    def __call__(self, piece: int) -> Row | str:
        """Make one dataset, unless it is finished; its row of the index, or why it cannot be made.

        Raises `InputError` if this process has other versions of the software than the one that made the job.
        """
        if other_versions(self.versions):
            raise other_dataset(self.out, "collection", self.versions)
        folder = self.out / self.series.folder(piece)
        try:
            prepared = prepare(self.series.recipe(piece), self.series.recipe_folder)
            # Sizes show well enough that it is whole: hashes are compared when it is read and verified.
            manifest = find_finished(folder, prepared.identity, content=False)
            manifest = manifest or make(prepared, folder, self.report, self.reuse)
        except InputError as fault:
            return str(fault)
        return index_row(folder.name, self.series.values(piece), manifest, folder / MANIFEST)


@contextmanager
def _claim(out: Path) -> Iterator[None]:
    """Keep other runs out of the folder of a collection; raises `InputError` unless it is free for one."""
    if (out / MANIFEST).exists() or (out / MARKER).exists():
        raise InputError(f"{out}: holds a single dataset; name another folder for a collection")
    COLLECTION_FOLDER.guard(out)
    with locked(out / LOCK, out):
        try:
            yield
        finally:
            (out / LOCK).unlink(missing_ok=True)


def _begin(series: Series, out: Path) -> None:
    """Write what all datasets have in common, or raise `InputError` unless it is the same as in the folder.

    Other values of the swept fields may be there already; a collection without any dataset gives way.
    """
    for temporary in [*temporaries_of(out, INDEX), *temporaries_of(out, COLLECTION)]:
        temporary.unlink()
    document = {
        "fields": list(series.fields),
        "recipe": {name: value for name, value in series.base.items() if name != "publication"},
        "versions": provenance.versions(*DECISIVE),
    }
    if not any(entry.is_dir() for entry in os.scandir(out)):
        COLLECTION_FOLDER.write(out, document)
    known = COLLECTION_FOLDER.read(out)
    if any(known.get(name) != value for name, value in document.items()):
        raise other_dataset(out, "collection", known.get("versions", {}))


def _all_rows(series: Series, out: Path, rows: Sequence[Row]) -> list[Row]:
    """These rows, and those of the index whose datasets are still there; in the order of the series."""
    by_name: dict[str, Row] = {}
    with suppress(InputError):  # of an index that is missing or damaged
        for row in read_index(out):
            with suppress(InputError):  # of a dataset that is gone or another one by now
                check_manifest(out, row)
                by_name[row["path"]] = row
    by_name |= {row["path"]: row for row in rows}
    names = [series.folder(number) for number in range(len(series))]
    return [by_name[name] for name in dict.fromkeys([*names, *by_name]) if name in by_name]
