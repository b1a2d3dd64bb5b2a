"""Comparison of all files of a dataset, a collection, results or an evaluation with its manifest."""

from collections.abc import Iterable
from pathlib import Path

from pcii.base.command_line import answer_json, say
from pcii.base.errors import InputError
from pcii.base.progress import Report, Stages, silent
from pcii.store.collection import (
    COLLECTION,
    INDEX,
    check_manifest,
    is_collection,
    read_collection,
    read_index,
)
from pcii.store.dataset_layout import CARD, MANIFEST, read_manifest
from pcii.store.folders import (
    EVALUATION,
    EVALUATION_FOLDER,
    LOCK,
    REMEDY,
    RESULTS,
    ROWS,
    Files,
    check_file,
    entries,
    read_evaluation,
    read_results,
    unlisted_files,
)
from pcii.store.software import differences, own_software


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Returns the number of files. Raises `InputError` for the first file that is missing, truncated or changed,
    and for files that no manifest lists.
    """
    if is_collection(path):
        return _verify_collection(path, report)
    if not (path / MANIFEST).exists():
        if (path / RESULTS).exists():
            return _verify_files(path, RESULTS, read_results(path).files, report)
        if (path / ROWS).exists():
            return _verify_evaluation(path, report)
    return _verify_files(path, MANIFEST, read_manifest(path).files, report)


def verify_scores(path: Path, max_bytes: int) -> None:
    """Compare all files of an evaluation by somebody else with its manifest, before they are used.

    Raises `InputError` as `verify` does and, before anything is read, if the folder holds more than
    `max_bytes`, or links, pipes or folders.
    """
    files = sorted(path.iterdir())
    for each in (path, *files):
        if each.is_symlink() or not (each.is_file() or each == path):
            raise InputError(f"{each}: is a link or no file; a folder of scores holds nothing but files")
    sizes = {each: each.stat().st_size for each in files}
    if sum(sizes.values()) > max_bytes:
        largest = max(sizes, key=sizes.__getitem__)
        raise InputError(
            f"{largest}: has {sizes[largest]} bytes; all files of a folder of scores have {max_bytes} at most"
        )
    _verify_evaluation(path, silent)


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
    rows, files = read_index(path), 2
    for done, row in enumerate(rows, start=1):
        files += 1 + verify(check_manifest(path, row))
        report("verify", done, len(rows))
    listed = {COLLECTION, INDEX, LOCK, CARD, *(row["path"] for row in rows)}
    _refuse_unlisted(path, INDEX, entries(path, "collection") - listed)
    return files


def _verify_evaluation(path: Path, report: Report) -> int:
    return _verify_files(path, EVALUATION, read_evaluation(path).files, report, EVALUATION_FOLDER.remedy)


def _verify_files(path: Path, document: str, files: Files, report: Report, remedy: str = REMEDY) -> int:
    """Compare the files of a folder with those that its document lists; returns their number."""
    for done, (name, entry) in enumerate(files.items(), start=1):
        check_file(path, name, entry, remedy=remedy)
        report("verify", done, len(files))
    _refuse_unlisted(path, document, unlisted_files(path, [document, *files, CARD]))
    return len(files)


def _refuse_unlisted(path: Path, document: str, unlisted: Iterable[str]) -> None:
    """Raise `InputError` if there are files or folders that the document does not list."""
    if names := ", ".join(sorted(unlisted)):
        advice = "repeat the command if they are unfinished, else move them away"
        raise InputError(f"{path}: not listed in {document}: {names}; {advice}")
