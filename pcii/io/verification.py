"""Comparison of all files of a dataset, of results or of a collection with its manifest."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.io.collection_layout import (
    COLLECTION,
    INDEX,
    check_manifest,
    is_collection,
    read_collection,
    read_index,
)
from pcii.io.dataset_layout import MANIFEST, REMEDY, read_manifest
from pcii.io.results_list import RESULTS, read_results
from pcii.io.sealed_json import check_file, strays

Item = TypeVar("Item")
MOST_NAMED = 5
"""Most unlisted files that an error names."""


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset, of results or of a collection with its manifest; the number of files.

    Raises `InputError` that names the faults: files that are missing, truncated or changed, or that no
    manifest lists.
    """
    if is_collection(path):
        return _verify_collection(path, report)
    return _verify_folder(path, report)


def _verify_collection(path: Path, report: Report) -> int:
    """Compare the datasets of a collection with its index, and each with its manifest."""
    read_collection(path)
    rows = read_index(path)
    files = _all_of(
        rows, lambda row: 1 + _verify_folder(check_manifest(path, row), silent), "datasets", report
    )
    listed = {COLLECTION, INDEX, *(row["path"] for row in rows)}
    _refuse(path, sorted(entry.name for entry in path.iterdir() if entry.name not in listed), INDEX)
    return 2 + files


def _verify_folder(path: Path, report: Report) -> int:
    is_results = (path / RESULTS).exists() and not (path / MANIFEST).exists()
    name, remedy = (RESULTS, "make them again") if is_results else (MANIFEST, REMEDY)
    files = read_results(path)["files"] if is_results else read_manifest(path)["files"]

    def check(listed: tuple[str, Mapping[str, Any]]) -> int:
        check_file(path, *listed, remedy, content=True)
        return 1

    number = _all_of(list(files.items()), check, "files", report)
    _refuse(path, strays(path, [name, *files]), name)
    return number


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
        named = ", ".join(extra[:MOST_NAMED]) + (", ..." if len(extra) > MOST_NAMED else "")
        raise InputError(f"{path}: not listed in {name}, and read by nothing: {named}; move it away")
