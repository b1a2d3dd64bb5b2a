"""Comparison of all files of a dataset, a collection, results or an evaluation with its manifest."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pcii.base.command_output import answer_json, say
from pcii.base.errors import InputError
from pcii.base.progress import Report, Stages, silent
from pcii.store.collection_layout import (
    COLLECTION,
    INDEX,
    check_manifest,
    is_collection,
    read_collection,
    read_index,
)
from pcii.store.dataset_layout import CARD, DATASET_FOLDER, MANIFEST, MARKER, read_manifest
from pcii.store.evaluation_layout import EVALUATION_FOLDER, ROWS
from pcii.store.file_list import check_file, strays
from pcii.store.folder_kind import FolderKind
from pcii.store.results_list import FINISH, RESULTS, RESULTS_FOLDER, read_results

Item = TypeVar("Item")
MOST_NAMED = 5
"""Most unlisted files, or unfinished datasets, that an error names."""


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Returns the number of files. Raises `InputError` that names the faults: files that are missing, truncated
    or changed, or that no manifest lists.
    """
    if is_collection(path):
        return _verify_collection(path, report)
    return _verify_folder(path, report)


def verify_and_tell(path: Path, *, as_json: bool) -> None:
    """Verify for a command: print the number of files or, as JSON, that and the fault, also raised."""
    with Stages() as report:
        try:
            files = verify(path, report)
        except InputError as fault:
            if as_json:
                answer_json({"folder": str(path), "files": None, "fault": str(fault)})
            raise
    if as_json:
        answer_json({"folder": str(path), "files": files, "fault": None})
    else:
        say(f"{path}: {files} files match the manifest")


def _verify_collection(path: Path, report: Report) -> int:
    """Compare the datasets of a collection with its index, and each with its manifest."""
    read_collection(path)
    rows = read_index(path)
    files = _all_of(
        rows, lambda row: 1 + _verify_folder(check_manifest(path, row), silent), "datasets", report
    )
    listed = {COLLECTION, INDEX, CARD, *(row["path"] for row in rows)}
    extra = sorted(entry.name for entry in path.iterdir() if entry.name not in listed)
    begun = [name for name in extra if (path / name / MARKER).is_file()]
    _refuse(path, [name for name in extra if name not in begun], INDEX)
    if begun:
        raise InputError(
            f"{path}: not finished: {_named(begun)}; the same `simgen generate` command goes on with them; "
            "the others match the index"
        )
    return 2 + files


def _verify_folder(path: Path, report: Report) -> int:
    kind, held = _kind_and_document(path)
    files = held["files"]

    def check(listed: tuple[str, Mapping[str, Any]]) -> int:
        check_file(path, *listed, kind.remedy, content=True)
        return 1

    number = _all_of(list(files.items()), check, "files", report)
    _refuse(path, strays(path, [kind.document, *files, CARD]), kind.document)
    if kind is RESULTS_FOLDER and (due := held["due"]):
        raise InputError(
            f"{path}: not finished: {_named(due)} are missing, or older than the other results here; {FINISH}"
        )
    return number


def _kind_and_document(path: Path) -> tuple[FolderKind, dict[str, Any]]:
    """What a folder that is no collection is taken for, and the document that lists its files."""
    if not (path / MANIFEST).exists():
        if (path / RESULTS).exists():
            return RESULTS_FOLDER, read_results(path)
        if (path / ROWS).exists():
            return EVALUATION_FOLDER, EVALUATION_FOLDER.read(path)
    return DATASET_FOLDER, read_manifest(path)


def _all_of(items: Sequence[Item], check: Callable[[Item], int], what: str, report: Report) -> int:
    """Sum of the files that `check` compares of each item; raises `InputError` of the first that is wrong."""
    files, faults = 0, list[str]()
    for done, item in enumerate(items, start=1):
        try:
            files += check(item)
        except InputError as fault:
            faults.append(str(fault))
        report("verify", done, len(items))
    if faults:
        more = f", and {len(faults) - 1} more of {len(items)} {what} are wrong" if len(faults) > 1 else ""
        raise InputError(f"{faults[0]}{more}")
    return files


def _refuse(path: Path, extra: list[str], name: str) -> None:
    """Raise `InputError` if there are files or folders that `name` does not list."""
    if extra:
        raise InputError(f"{path}: not listed in {name}, and read by nothing: {_named(extra)}; move it away")


def _named(files: list[str]) -> str:
    """The first few names of files or folders."""
    return ", ".join(files[:MOST_NAMED]) + (", ..." if len(files) > MOST_NAMED else "")
