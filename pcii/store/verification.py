"""Comparison of all files of a dataset, a collection, results or an evaluation with its manifest."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pcii.base.command_line import answer_json, say
from pcii.base.errors import InputError
from pcii.base.progress import Report, Stages, silent
from pcii.store.collection import (
    CERTIFICATE,
    COLLECTION,
    CROISSANT,
    INDEX,
    check_manifest,
    is_collection,
    read_collection,
    read_index,
)
from pcii.store.dataset_layout import CARD, LICENCE, MANIFEST, read_manifest
from pcii.store.folders import (
    EVALUATION,
    LOCK,
    RESULTS,
    ROWS,
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
    document, files = _document_and_files(path)
    for done, (name, entry) in enumerate(files.items(), start=1):
        check_file(path, name, entry)
        report("verify", done, len(files))
    _refuse_unlisted(path, document, unlisted_files(path, [document, *files, CARD, LICENCE]))
    return len(files)


def verify_scores(path: Path, max_bytes: int) -> None:
    """Verify scores by others; raises `InputError` as `verify`, and for links and more than `max_bytes`."""
    sizes = {file: file.lstat().st_size for file in sorted(path.iterdir())}
    for file in (path, *sizes):
        if file.is_symlink() or not (file.is_file() or file == path):
            raise InputError(f"{file}: is a link or no file; a folder of scores holds nothing but files")
    if sum(sizes.values()) > max_bytes:
        largest = max(sizes, key=sizes.__getitem__)
        raise InputError(f"{largest}: has {sizes[largest]} bytes; all files may have {max_bytes} together")
    verify(path)


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
    listed = {COLLECTION, INDEX, LOCK, CARD, LICENCE, CERTIFICATE, CROISSANT, *(row["path"] for row in rows)}
    _refuse_unlisted(path, INDEX, entries(path, "collection") - listed)
    return files


def _document_and_files(path: Path) -> tuple[str, Mapping[str, Mapping[str, Any]]]:
    """The document of a folder that is no collection, and the files that it lists."""
    if not (path / MANIFEST).exists():
        if (path / RESULTS).exists():
            return RESULTS, read_results(path).files
        if (path / ROWS).exists():
            return EVALUATION, read_evaluation(path).files
    return MANIFEST, read_manifest(path).files


def _refuse_unlisted(path: Path, document: str, unlisted: Iterable[str]) -> None:
    """Raise `InputError` if there are files or folders that the document does not list."""
    if names := ", ".join(sorted(unlisted)):
        advice = "repeat the command if they are unfinished, else move them away"
        raise InputError(f"{path}: not listed in {document}: {names}; {advice}")
