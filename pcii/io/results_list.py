"""The file results.json: the dataset of the results in a folder, and their files with size and SHA-256."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.io.sealed_json import read_sealed, write_sealed

RESULTS = "results.json"
FORMAT = "photon-integral-imaging results"
FORMAT_VERSION = 2
FINISH = "`pcii run` with the same options makes them, and keeps what is done"


def write_results(out: Path, content: Mapping[str, Any]) -> None:
    """Write the list of a folder of results: `dataset`, `identity`, `budget`, `files`, `made` and `due`."""
    write_sealed(out / RESULTS, {"format": FORMAT, "format_version": FORMAT_VERSION, **content})


def read_results(out: Path) -> dict[str, Any]:
    """The list of a folder of results, checked; raises `InputError` if it is missing or was changed."""
    from pcii.io.manifest_schema import ResultsManifest, validate

    path, remedy = out / RESULTS, "delete the folder and make the results again"
    if not path.is_file():
        raise InputError(f"{out}: not a folder of results (no {RESULTS}); name one that `pcii run` made")
    content = read_sealed(path, remedy)
    if content.get("format") != FORMAT or content.get("format_version") != FORMAT_VERSION:
        raise InputError(f"{path}: not the list of {FORMAT} of version {FORMAT_VERSION}; {remedy}")
    validate(ResultsManifest, content, path, remedy)
    return content
