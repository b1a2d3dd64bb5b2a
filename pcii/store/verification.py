"""Comparison of all files of a dataset, a collection, results or an evaluation with its manifest."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pcii.base.command_line import answer_json, say
from pcii.base.errors import InputError
from pcii.base.progress import Report, Stages, silent
from pcii.store.collection import (
    COLLECTION,
    INDEX,
    LOCK,
    check_manifest,
    is_collection,
    read_collection,
    read_index,
)
from pcii.store.dataset_layout import CARD, DATASET_FOLDER, MANIFEST, MARKER, read_manifest
from pcii.store.folders import (
    EVALUATION_FOLDER,
    RESULTS,
    RESULTS_FOLDER,
    ROWS,
    Files,
    FolderKind,
    check_file,
    read_evaluation,
    read_results,
    unlisted_files,
)
from pcii.store.software import differences, own_software

Item = TypeVar("Item")
MAX_NAMES = 5
"""Most unlisted files, or unfinished datasets, that an error names."""


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Returns the number of files. Raises `InputError` that names the faults: files that are missing, truncated
    or changed, or that no manifest lists.
    """
    return _verify_collection(path, report) if is_collection(path) else _verify_folder(path, report)


def verify_and_tell(path: Path, *, as_json: bool) -> None:
    """Verify for a command: print the number of files or, as JSON, that and the fault, also raised.

    Of results it also says how the software that made them differs from that of now.
    """
    with Stages() as report:
        try:
            files = verify(path, report)
        except InputError as fault:
            if as_json:
                answer_json({"folder": str(path), "files": None, "fault": str(fault)})
            raise
    made_by = read_results(path).versions if (path / RESULTS).is_file() else {}
    changes = differences(made_by, own_software()) if made_by else ""
    if as_json:
        answer_json({"folder": str(path), "files": files, "fault": None, "software": changes})
    else:
        say(f"{path}: {files} files match the manifest{changes and f'; other software made them: {changes}'}")


def _verify_collection(path: Path, report: Report) -> int:
    """Compare the datasets of a collection with its index, and each with its manifest."""
    read_collection(path)
    rows = read_index(path)

    def check(row: Mapping[str, Any]) -> int:
        return 1 + _verify_folder(check_manifest(path, row), silent)

    files = _sum_over(rows, check, "datasets", report)
    listed = {COLLECTION, INDEX, LOCK, CARD, *(row["path"] for row in rows)}
    unlisted = sorted(entry.name for entry in path.iterdir() if entry.name not in listed)
    unfinished = [name for name in unlisted if (path / name / MARKER).is_file()]
    _refuse_unlisted(path, [name for name in unlisted if name not in unfinished], INDEX)
    if unfinished:
        raise InputError(
            f"{path}: not finished: {_first(unfinished)}; the same `simgen generate` command goes on with "
            "them; the others match the index"
        )
    return 2 + files


def _verify_folder(path: Path, report: Report) -> int:
    kind, files = _kind_and_files(path)

    def check(item: tuple[str, Mapping[str, Any]]) -> int:
        check_file(path, *item, kind.remedy, content=True)
        return 1

    number = _sum_over(list(files.items()), check, "files", report)
    _refuse_unlisted(path, unlisted_files(path, [kind.document, *files, CARD]), kind.document)
    return number


def _kind_and_files(path: Path) -> tuple[FolderKind, Files]:
    """What a folder that is no collection is taken for, and the files that its document lists."""
    if not (path / MANIFEST).exists():
        if (path / RESULTS).exists():
            return RESULTS_FOLDER, read_results(path).files
        if (path / ROWS).exists():
            return EVALUATION_FOLDER, read_evaluation(path).files
    return DATASET_FOLDER, read_manifest(path).files


def _sum_over(items: Sequence[Item], check: Callable[[Item], int], what: str, report: Report) -> int:
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


def _refuse_unlisted(path: Path, unlisted: list[str], document: str) -> None:
    """Raise `InputError` if there are files or folders that the document does not list."""
    if unlisted:
        raise InputError(
            f"{path}: not listed in {document}, and read by nothing: {_first(unlisted)}; move it away"
        )


def _first(names: list[str]) -> str:
    """The first few names of files or folders."""
    return ", ".join(names[:MAX_NAMES]) + (", ..." if len(names) > MAX_NAMES else "")
