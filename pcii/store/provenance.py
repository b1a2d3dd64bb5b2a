"""Whether what is on disk is as it was made, and by what software: hashes of files, versions, sources."""

import hashlib
import os
import platform
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from pcii.base import InputError, Report, Stages, answer_json, say, silent
from pcii.store.collection import CERTIFICATE, CROISSANT, INDEX, check_manifest, is_collection, read_index
from pcii.store.dataset_card import CARD, LICENCE
from pcii.store.folders import (
    COLLECTION,
    COLLECTION_FOLDER,
    DATASET_FOLDER,
    EVALUATION_FOLDER,
    LOCK,
    RESULTS,
    RESULTS_FOLDER,
    entries,
    hash_file,
    read_listed,
    read_manifest,
    unlisted_files,
)

PACKAGE = "photon-integral-imaging"
COMPUTING = ("numpy", "scipy", "scikit-image", "numba", "llvmlite", "onnxruntime")
"""Other packages by which this one computes: another version may give another result."""


def versions(*packages: str) -> dict[str, str]:
    """Versions of installed packages."""
    return {name: version(name) for name in packages}


@cache
def own_software() -> dict[str, str]:
    """Versions of this package and of what it computes by, and the hash of its source."""
    source = {f"source of {PACKAGE}": hash_of_source(Path(__file__).parents[1])}
    return versions(PACKAGE) | source | {"python": platform.python_version()} | versions(*COMPUTING)


def software_with(place: str) -> dict[str, str]:
    """This software, and the hash of the source of a module (of its whole package), or of a file "x.py"."""
    if place.endswith(".py"):
        return own_software() | {f"source of {place}": hash_of_source(Path(place))}
    package = place.partition(".")[0]
    spec = find_spec(package)
    assert spec is not None
    source = next(iter(spec.submodule_search_locations or ()), spec.origin)
    return own_software() | {f"source of {package}": hash_of_source(Path(str(source)))}


def machine() -> str:
    """Processor and system, without a name by which the machine could be found."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = f"{models[0]} ({platform.machine()})" if models else platform.machine()
    return f"{processor}, {os.cpu_count()} logical cores, {platform.system()}"


def differences(before: Mapping[str, str] | None, now: Mapping[str, str] | None) -> str:
    """How the software that made something differs from that of now, in words; empty if it does not.

    >>> differences({"numpy": "2.1", "source of mine": "a"}, {"numpy": "2.2", "source of mine": "b"})
    'numpy 2.1 is now 2.2, the source of mine has changed'
    >>> differences(None, {"numpy": "2.2"})
    'what makes them is not known'
    """
    if before is None or now is None:
        return "what makes them is not known"
    changes: list[str] = []
    for name in sorted({*before, *now}):
        old, new = before.get(name, "absent"), now.get(name, "absent")
        if old != new:
            is_source = name.startswith("source of ")
            changes.append(f"the {name} has changed" if is_source else f"{name} {old} is now {new}")
    return ", ".join(changes)


def hash_of_source(place: Path) -> str:
    """Hash of a file, or of all files of a folder but for hidden and compiled ones: also of weights."""
    content = hashlib.sha256()
    for file in [place] if place.is_file() else sorted(place.rglob("*")):
        name = file.relative_to(place.parent)
        if file.is_file() and not any(part.startswith((".", "__pycache__")) for part in name.parts):
            content.update(f"{name.as_posix()}\0{hash_file(file)}\0".encode())
    return content.hexdigest()[:16]


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Returns the number of files. Raises `InputError` for the first file that is missing, truncated or changed,
    and for files that no manifest lists.
    """
    if is_collection(path):
        COLLECTION_FOLDER.read(path)
        datasets = [check_manifest(path, row) for row in read_index(path)]
        count = 2  # the recipe and the index
        for done, dataset in enumerate(datasets, start=1):
            count += 1 + verify(dataset)
            report("verify", done, len(datasets))
        known = {INDEX, COLLECTION, LOCK, CARD, LICENCE, CERTIFICATE, CROISSANT, *(d.name for d in datasets)}
        _refuse_unlisted(path, INDEX, sorted(entries(path, "collection") - known))
        return count
    kinds = DATASET_FOLDER, RESULTS_FOLDER, EVALUATION_FOLDER
    marked = (kind for kind in kinds if any((path / mark).exists() for mark in kind.marks))
    kind = next(marked, DATASET_FOLDER)
    files = (read_manifest if kind is DATASET_FOLDER else kind.read)(path).files
    for done, (name, entry) in enumerate(files.items(), start=1):
        read_listed(path, name, entry)
        report("verify", done, len(files))
    _refuse_unlisted(path, kind.document, unlisted_files(path, [kind.document, *files, CARD, LICENCE]))
    return len(files)


def _refuse_unlisted(path: Path, document: str, unlisted: Sequence[str]) -> None:
    if unlisted:
        advice = "repeat the command if they are unfinished, else move them away"
        raise InputError(f"{path}: not listed in {document}: {', '.join(unlisted)}; {advice}")


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
    made_by = RESULTS_FOLDER.read(path).versions if (path / RESULTS).is_file() else {}
    changes = differences(made_by, own_software()) if made_by else ""
    if as_json:
        answer_json({"folder": str(path), "files": files, "fault": None, "software": changes})
    else:
        say(f"{path}: {files} files match the manifest{changes and f'; other software made them: {changes}'}")
