"""Comparison of all files of a dataset, or of a folder of results, with its manifest."""

from pathlib import Path

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.io.dataset_layout import MANIFEST, REMEDY, read_manifest
from pcii.io.results_list import RESULTS, read_results
from pcii.io.sealed_json import check_file, strays

MOST_NAMED = 5
"""Most unlisted files that an error names."""


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset or of results with its manifest, and return the number of files.

    Raises `InputError` that names the faults: files that are missing, truncated or changed, or that the
    manifest does not list.
    """
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
    extra = strays(path, [name, *files])
    if extra:
        named = ", ".join(extra[:MOST_NAMED]) + (", ..." if len(extra) > MOST_NAMED else "")
        raise InputError(f"{path}: not listed in {name}, and read by nothing: {named}; move it away")
    return len(files)
