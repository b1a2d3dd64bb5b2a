"""The folder of an evaluation: rows that grow while methods are measured, and what sums them up.

rows.jsonl        a line of JSON for each dataset, light and method
evaluation.html   tables and plots
evaluation.md     the same tables
means.csv         means over seeds with their intervals
evaluation.json   what measured the rows, and every other file with size and SHA-256; written last
"""

from pcii.store.folder_kind import FolderKind

ROWS = "rows.jsonl"
EVALUATION_FOLDER = FolderKind(
    "evaluation",
    "evaluation.json",
    version=2,
    absent="unfinished; the same `pcii evaluate` command goes on from here",
    remedy="repeat the `pcii evaluate` command, which writes it again",
    marks=frozenset({ROWS}),
)
