"""Comparison of all files of a dataset, a collection, results or an evaluation with its manifest."""

from collections.abc import Collection
from pathlib import Path

from pcii.base import InputError, Report, Stages, answer_json, say, silent
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
    Files,
    entries,
    read_evaluation,
    read_listed,
    read_results,
    unlisted_files,
)
from pcii.store.software import differences, own_software


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Returns the number of files. Raises `InputError` for the first file that is missing, truncated or changed,
    and for files that no manifest lists.
    """
    document, files, datasets, unlisted = _contents(path)
    total = len(files) + len(datasets)
    count = 2 if is_collection(path) else len(files)  # of a collection its recipe and its index
    for done, (name, entry) in enumerate(files.items(), start=1):
        read_listed(path, name, entry)
        report("verify", done, total)
    for done, dataset in enumerate(datasets, start=len(files) + 1):
        count += 1 + verify(dataset)
        report("verify", done, total)
    if unlisted:
        advice = "repeat the command if they are unfinished, else move them away"
        raise InputError(f"{path}: not listed in {document}: {', '.join(sorted(unlisted))}; {advice}")
    return count


def _contents(path: Path) -> tuple[str, Files, list[Path], Collection[str]]:
    """What lists the contents of a folder, the files and the datasets that it lists, and what it does not."""
    if is_collection(path):
        read_collection(path)
        datasets = [check_manifest(path, row) for row in read_index(path)]
        known = {INDEX, COLLECTION, LOCK, CARD, LICENCE, CERTIFICATE, CROISSANT}
        known |= {dataset.name for dataset in datasets}
        return INDEX, {}, datasets, entries(path, "collection") - known
    document, files = MANIFEST, None
    if not (path / MANIFEST).exists():
        if (path / RESULTS).exists():
            document, files = RESULTS, read_results(path).files
        elif (path / ROWS).exists():
            document, files = EVALUATION, read_evaluation(path).files
    files = read_manifest(path).files if files is None else files
    return document, files, [], unlisted_files(path, [document, *files, CARD, LICENCE])


def print_verification(path: Path, *, as_json: bool) -> None:
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
