"""Comparison of all files of a dataset, a collection, results or an evaluation with its manifest."""

from collections.abc import Mapping
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
    documents, files, datasets = _contents(path)
    total = len(files) + len(datasets)
    count = 2 if is_collection(path) else len(files)  # of a collection its recipe and its index
    for done, (name, entry) in enumerate(files.items(), start=1):
        read_listed(path, name, entry)
        report("verify", done, total)
    for done, dataset in enumerate(datasets, start=len(files) + 1):
        count += 1 + verify(dataset)
        report("verify", done, total)
    within = tuple(f"{dataset.name}/" for dataset in datasets)
    unlisted = [name for name in unlisted_files(path, [*documents, *files]) if not name.startswith(within)]
    if unlisted:
        advice = "repeat the command if they are unfinished, else move them away"
        raise InputError(f"{path}: not listed in {documents[0]}: {', '.join(unlisted)}; {advice}")
    return count


def _contents(path: Path) -> tuple[list[str], Mapping[str, Mapping[str, Any]], list[Path]]:
    """What a folder has: files that no list names, the one that lists the others first; the listed files; and
    the datasets of a collection, whose manifests are those that the index lists.
    """
    if is_collection(path):
        read_collection(path)
        datasets = [check_manifest(path, row) for row in read_index(path)]
        return [INDEX, COLLECTION, LOCK, CARD, LICENCE, CERTIFICATE, CROISSANT], {}, datasets
    if (path / MANIFEST).exists() or not {RESULTS, ROWS} & entries(path, "dataset"):
        return [MANIFEST, CARD, LICENCE], read_manifest(path).files, []
    if (path / RESULTS).exists():
        return [RESULTS, CARD, LICENCE], read_results(path).files, []
    return [EVALUATION, CARD, LICENCE], read_evaluation(path).files, []


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
