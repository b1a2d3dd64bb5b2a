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

from pcii.store.file_list import list_files
from pcii.store.folder_kind import FolderKind

ROWS = "rows.jsonl"
EVALUATION = "evaluation.json"
REMEDY = "repeat the `pcii evaluate` command, which writes it again or names rows that are damaged"
EVALUATION_FOLDER = FolderKind(
    "evaluation",
    EVALUATION,
    version=1,
    absent="unfinished; the same `pcii evaluate` command goes on from here",
    remedy=REMEDY,
    marks=frozenset({ROWS}),
    # Some kB for each scene, budget and method: enough for ten thousand drawn scenes.
    largest_bytes=1 << 27,
)


def is_evaluation(path: Path) -> bool:
    """Whether a folder holds an evaluation, finished or not."""
    return (path / ROWS).exists() or (path / EVALUATION).exists()


def seal_evaluation(out: Path, summary: Mapping[str, Any], pages: Sequence[str]) -> None:
    """Write evaluation.json: this summary of the rows, and the hashes of the rows and the named pages.

    No row may be added meanwhile.
    """
    EVALUATION_FOLDER.write(out, {**summary, "files": list_files(out, [ROWS, *pages])})


def read_evaluation(out: Path) -> dict[str, Any]:
    """Content of evaluation.json; raises `InputError` if it is missing, not yet there or was changed."""
    from pcii.store.manifest_schema import FileList, validate

    content = EVALUATION_FOLDER.read(out)
    validate(FileList, content, out / EVALUATION, REMEDY)
    return content
