"""The file results.json: the dataset of the results in a folder, and their files with size and SHA-256."""

from pathlib import Path
from typing import Any

from pcii.store.folder_kind import FolderKind

RESULTS = "results.json"
LOCK = ".results.lock"
FINISH = "`pcii run` with the same options makes them, and keeps what is done"
RESULTS_FOLDER = FolderKind(
    "results",
    RESULTS,
    version=2,
    absent=f"not a folder of results (no {RESULTS}); name one that `pcii run` made",
    remedy="delete the folder and make the results again",
    marks=frozenset({RESULTS}),
    passing=frozenset({LOCK}),
)


def read_results(out: Path) -> dict[str, Any]:
    """The list of a folder of results: `dataset`, `identity`, `budget`, `files`, `made` and `due`.

    Raises `InputError` if it is missing or was changed.
    """
    from pcii.store.manifest_schema import ResultsManifest, validate

    content = RESULTS_FOLDER.read(out)
    validate(ResultsManifest, content, out / RESULTS, RESULTS_FOLDER.remedy)
    return {"made": {}, "due": [], **content}
