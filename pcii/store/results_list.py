"""The file results.json: dataset, light and software of the results in a folder, and their files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pcii.base.safe_files import write_json_safely
from pcii.store.sealed_json import LARGEST_DOCUMENT_BYTES, parse_json, read_small

RESULTS = "results.json"
REMEDY = "make the results again in a new folder"
_HEAD = {"format": "photon-integral-imaging results", "format_version": 3}


def read_results(folder: Path) -> dict[str, Any]:
    """The list of a folder of results: `dataset`, `identity`, `light`, `versions` and `files`.

    `versions` are those of the software that made the results, `files` the size and SHA-256 of each file.
    Raises `InputError` if the list is missing, damaged or of another release.
    """
    from pcii.store.manifest_schema import ResultsManifest, validate

    path = folder / RESULTS
    content = parse_json(read_small(path, LARGEST_DOCUMENT_BYTES, REMEDY), path, REMEDY)
    validate(ResultsManifest, content, path, REMEDY)
    return content


def write_results(folder: Path, content: Mapping[str, Any]) -> None:
    """Write the list, atomically."""
    write_json_safely(folder / RESULTS, {**_HEAD, **content})
