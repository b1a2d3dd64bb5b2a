"""The page of an evaluation: charts and tables of means, how to read them, and what made them.

Charts are of a measure against photons and time, and of how far confidence is right.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcii.base import sweep_temporaries, write_bytes_safely
from pcii.evaluation.summary import means, over_scenes, with_yardsticks
from pcii.evaluation.tables import NOT_BETTER, TITLES, light_name, tables_of
from pcii.figures import PLACES, accuracy_chart, calibration_chart, figure_uri, render_page, text_table
from pcii.store import EVALUATION_FOLDER, ROWS, hash_file, list_files

if TYPE_CHECKING:
    from pandas import DataFrame

AXES = {
    "iou": "IoU, mean over planes with objects",
    "pixel_iou": "IoU with the points in focus, mean over planes",
    "false_share": "share of the film claimed falsely",
    "within_1px": "share of depths within 1 px",
    "within_3px": "share of depths within 3 px",
    "quadratic_score": "quadratic score of confidence",
    "median_px": "median error of depth, px of total disparity",
}
"""Measures of accuracy that are drawn, with the labels of their axes."""
ERRORS = ("median_px",)
"""Of these, what is no share."""
ABOUT_YARDSTICKS = (
    "Three look at no photon: (nothing) claims nothing and answers nowhere, (everything) claims the whole "
    "film at every plane, and (one depth) answers the depth that is right for most pixels, which only the "
    "truth tells. Sweeps are the simplest methods of depth. "
    f"{NOT_BETTER}: no better than the best of all these for the same scene and light."
)
NOTES = (
    "IoU compares masks with the objects that belong to each plane, and is a mean over planes that hold any. "
    "What leans through the depths belongs to no plane: it counts in the IoU of pixels, and in depth. In "
    "brackets: 95 % interval of the mean over seeds by Student's t, clipped to [0, 1] for shares, and of the "
    "logarithm of the mean for seconds and other values that are never negative.",
    "In bold: the best mean of the same scene and photons. Others may be as good: see the interval of the "
    "difference.",
    "p: two-sided sign-flip permutation test on the same datasets, without correction for multiple "
    "comparisons. Of n pairs it cannot be less than 2 / 2^n, so fewer than six never give 0.05.",
    "Over several scenes every scene counts once, as the mean over its seeds. Ranks are of the scenes and "
    "seeds that all methods have; their intervals and p are of the spread between scenes.",
    ABOUT_YARDSTICKS,
    "Depth: shares are of the objects' pixels, within 1 or 3 px of total disparity, and a missing answer is "
    "a wrong one, in the median too. Quadratic score: share within 1 px minus the Brier score of confidence; "
    "0 is who never answers, 1 who is always right and sure. Bound: the least standard deviation of the "
    "depth of an object as a whole (Cramér-Rao), median of the objects. ECE: how far confidence and the "
    "share of depths within 1 px are apart on average, over all answered pixels.",
)


def write_evaluation(
    out: Path, frame: "DataFrame", origin: Mapping[str, Any], others: Sequence[str] = ()
) -> None:
    """Write evaluation.html, means.csv and, last, evaluation.json with their hashes.

    `others` are further files to list. The caller keeps others from adding rows meanwhile.
    """
    sweep_temporaries(out)
    frame = with_yardsticks(frame)
    cell_means = means(frame)
    differing = ", ".join(origin["differing"])
    warning = f"Not all rows are of the same software ({differing}): name all datasets and methods again."
    content = {
        "warnings": [warning] if differing else [],
        "notes": NOTES,
        "charts": {words: chart for words, chart in _charts(over_scenes(cell_means)) if chart},
        "tables": dict(tables_of(frame, cell_means)),
        "origin": _origin_table(origin, hash_file(out / ROWS)),
    }
    files = {
        "evaluation.html": render_page("evaluation.html.j2", content),
        "means.csv": cell_means.to_csv(index=False).encode(),
    }
    for name, text in files.items():
        write_bytes_safely(out / name, text)
    EVALUATION_FOLDER.write(out, {**origin, "files": list_files(out, [ROWS, *files, *others])})


def _charts(table: "DataFrame") -> Iterator[tuple[str, str]]:
    """What a chart of means by method and light shows, and the chart; empty if nothing is known of it."""
    methods: list[str] = []
    for measure in TITLES:
        methods = sorted(table["method"][table["measure"] == measure].unique())
        yield f"{AXES[measure]} against photons and time", accuracy_plot(table, methods, measure)
    yield "share of correct depths against confidence, by light", _calibration_plot(table, methods)


def _origin_table(origin: Mapping[str, Any], rows_sha256: str) -> "DataFrame":
    """What an evaluation was made by; `rows_sha256` is that of its rows.jsonl."""
    rows = {
        "measured": " to ".join(dict.fromkeys(origin["days"])),
        "machine": _with_row_counts(origin["machines"]),
        **{name: _with_row_counts(numbers) for name, numbers in origin["software"].items()},
        "SHA-256 of rows.jsonl": rows_sha256,
    }
    return text_table([row for row in rows.items() if row[1]], ("what", "value"), words=2)


def _with_row_counts(rows_by_text: Mapping[str, int]) -> str:
    """Texts, with the number of rows of each where they are several."""
    if len(rows_by_text) == 1:
        return next(iter(rows_by_text))
    return "; ".join(f"{text} ({rows} rows)" for text, rows in rows_by_text.items())


def accuracy_plot(table: "DataFrame", methods: Sequence[str], measure: str) -> str:
    """One of `AXES` against photons per view, and against seconds, as a PNG in a data URI.

    `table` has means by method, light and measure. Empty if no method has the measure.
    """
    cells = accuracies(table, measure)
    figure = accuracy_chart(cells, methods, AXES[measure], is_share=measure not in ERRORS)
    return "" if figure is None else figure_uri(figure)


def accuracies(table: "DataFrame", measure: str) -> "DataFrame":
    """The means of a measure by method and light, with those of photons per view and of seconds."""
    cells = table[table["measure"] == measure].set_index(["method", "light"])[["n", "mean", "low", "high"]]
    cells = cells.assign(**{end: cells[end].fillna(cells["mean"]) for end in ("low", "high")})
    for name in PLACES:
        places = table[table["measure"] == name].set_index(["method", "light"])["mean"]
        cells[name] = places.reindex(cells.index)
    return cells.reset_index()


def _calibration_plot(table: "DataFrame", methods: Sequence[str]) -> str:
    """Share of correct depths against their stated confidence, by light; empty if nothing is answered."""
    parts = table["measure"].str.extract(r"^(reliability\..*)\.(\w+)$")
    bins = table.assign(bin=parts[0], part=parts[1]).dropna(subset="bin")
    if bins.empty:
        return ""
    bins = bins.pivot(index=["method", "light", "bin"], columns="part", values="mean").reset_index()
    bins = bins.dropna(subset="confidence").sort_values(["light", "method"], kind="stable")
    return figure_uri(calibration_chart(bins.assign(light=bins["light"].map(light_name)), methods))
