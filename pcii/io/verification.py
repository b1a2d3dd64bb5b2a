"""Comparison of all files of a dataset, of results or of a collection with its manifest."""

from pathlib import Path

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
    rows, files, faults = read_index(path), 2, list[str]()
    for done, row in enumerate(rows, start=1):
        try:
            files += 1 + _verify_folder(check_manifest(path, row), silent)
        except InputError as fault:
            faults.append(str(fault))
        report("verify", done, len(rows))
    if faults:
        more = f", and {len(faults) - 1} more of {len(rows)} datasets are wrong" if len(faults) > 1 else ""
        raise InputError(f"{faults[0]}{more}")
    listed = {COLLECTION, INDEX, *(row["path"] for row in rows)}
    _refuse(path, sorted(entry.name for entry in path.iterdir() if entry.name not in listed), INDEX)
    return files


def _verify_folder(path: Path, report: Report) -> int:
    is_results = (path / RESULTS).exists() and not (path / MANIFEST).exists()
    name, remedy = (RESULTS, "make them again") if is_results else (MANIFEST, REMEDY)
    files = read_results(path)["files"] if is_results else read_manifest(path)["files"]
    faults: list[str] = []
    for done, (file, entry) in enumerate(files.items(), start=1):
        try:
            check_file(path, file, entry, remedy, content=True)
        except InputError as fault:
            faults.append(str(fault))
        report("verify", done, len(files))
    if faults:
        more = f", and {len(faults) - 1} more of {len(files)} files are wrong" if len(faults) > 1 else ""
        raise InputError(f"{faults[0]}{more}")
    _refuse(path, strays(path, [name, *files]), name)
    return len(files)


def _refuse(path: Path, extra: list[str], name: str) -> None:
    """Raise `InputError` if there are files or folders that `name` does not list."""
    if extra:
        named = ", ".join(extra[:MOST_NAMED]) + (", ..." if len(extra) > MOST_NAMED else "")
        raise InputError(f"{path}: not listed in {name}, and read by nothing: {named}; move it away")
