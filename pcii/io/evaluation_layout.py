"""The folder of an evaluation: rows that grow while several processes measure, and what sums them up.

rows.jsonl        a line of JSON for each dataset, budget and method, which ends in its own checksum
evaluation.html   tables and plots
evaluation.md     the same tables
evaluation.json   the same figures for programs, every other file with size and SHA-256, and its own
                  checksum; written last, by whoever has seen that all rows are there
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.io.sealed_json import list_files, read_sealed, write_sealed

ROWS = "rows.jsonl"
EVALUATION = "evaluation.json"
FORMAT = "photon-integral-imaging evaluation"
FORMAT_VERSION = 1
REMEDY = "repeat the `pcii evaluate` command, which writes it again or names rows that are damaged"
LARGEST_EVALUATION_BYTES = 1 << 27
"""Some kB for each scene, budget and method: enough for ten thousand drawn scenes."""


def is_evaluation(path: Path) -> bool:
    """Whether a folder holds an evaluation, finished or not."""
    return (path / ROWS).exists() or (path / EVALUATION).exists()


def seal_evaluation(out: Path, summary: Mapping[str, Any], pages: Sequence[str]) -> None:
    """Write evaluation.json: this summary of the rows, and the hashes of the rows and the named pages.

    No row may be added meanwhile.
    """
    files = list_files(out, [ROWS, *pages])
    document = {"format": FORMAT, "format_version": FORMAT_VERSION, **summary, "files": files}
    write_sealed(out / EVALUATION, document)


def read_evaluation(out: Path) -> dict[str, Any]:
    """Content of evaluation.json; raises `InputError` if it is missing, not yet there or was changed."""
    from pcii.io.manifest_schema import FileList, validate

    path = out / EVALUATION
    if not path.is_file():
        raise InputError(f"{out}: unfinished; the same `pcii evaluate` command goes on from here")
    content = read_sealed(path, REMEDY, largest_bytes=LARGEST_EVALUATION_BYTES)
    if content.get("format") != FORMAT or content.get("format_version") != FORMAT_VERSION:
        raise InputError(f"{path}: not of a {FORMAT} of version {FORMAT_VERSION}; {REMEDY}")
    validate(FileList, content, path, REMEDY)
    return content
