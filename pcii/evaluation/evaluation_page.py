"""The page of an evaluation: charts and tables of means and ranks, and what made them.

Charts are of a measure against photons and time, and of how far confidence is right. Tables are of texts, for
terminals too.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcii.base import sweep_temporaries, write_bytes_safely
from pcii.evaluation import summary
from pcii.figures import NOT_KNOWN, accuracy_chart, calibration_chart, figure_uri, render_page, text_table
from pcii.store import EVALUATION_FOLDER, ROWS, hash_file, list_files

if TYPE_CHECKING:
    from pandas import DataFrame

MAX_DETAILED_SCENES = 12
"""Largest number of scenes with tables of all measures: a page with those of more is too large to load."""


def write_evaluation(
    out: Path, frame: "DataFrame", origin: Mapping[str, Any], others: Sequence[str] = ()
) -> None:
    """Write evaluation.html, means.csv and, last, evaluation.json with their hashes.

    `others` are further files to list. The caller keeps others from adding rows meanwhile.
    """
    sweep_temporaries(out)
    frame = summary.with_yardsticks(frame)
    cell_means = summary.means(frame)
    differing = ", ".join(origin["differing"])
    warning = f"Not all rows are of the same software ({differing}): name all datasets and methods again."
    content = {
        "warnings": [warning] if differing else [],
        "charts": {words: chart for words, chart in _charts(summary.over_scenes(cell_means)) if chart},
        "tables": dict(_tables_of(frame, cell_means)),
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
    for measure in summary.DECISIVE:
        methods = sorted(table["method"][table["measure"] == measure].unique())
        yield f"{summary.AXES[measure]} against photons and time", accuracy_plot(table, methods, measure)
    yield "share of correct depths against confidence, by light", _calibration_plot(table, methods)


def _origin_table(origin: Mapping[str, Any], rows_sha256: str) -> "DataFrame":
    """What an evaluation was made by; `rows_sha256` is that of its rows.jsonl."""

    def listed(rows_by_text: Mapping[str, int]) -> str:
        is_one = len(rows_by_text) == 1
        return "; ".join(text if is_one else f"{text} ({n} rows)" for text, n in rows_by_text.items())

    rows = {
        "measured": " to ".join(dict.fromkeys(origin["days"])),
        "machine": listed(origin["machines"]),
        **{name: listed(numbers) for name, numbers in origin["software"].items()},
        "SHA-256 of rows.jsonl": rows_sha256,
    }
    return text_table([row for row in rows.items() if row[1]], ("what", "value"), words=2)


def accuracy_plot(table: "DataFrame", methods: Sequence[str], measure: str) -> str:
    """A measure against photons per view, and against seconds, as a PNG in a data URI.

    `table` has means by method, light and measure. Empty if no method has the measure.
    """
    cells, is_share = summary.accuracies(table, measure), summary.kind_of(measure) != "positive"
    figure = accuracy_chart(cells, methods, summary.AXES[measure], is_share=is_share)
    return "" if figure is None else figure_uri(figure)


def _calibration_plot(table: "DataFrame", methods: Sequence[str]) -> str:
    """Share of correct depths against their stated confidence, by light; empty if nothing is answered."""
    parts = table["measure"].str.extract(r"^(reliability\..*)\.(\w+)$")
    bins = table.assign(bin=parts[0], part=parts[1]).dropna(subset="bin")
    if bins.empty:
        return ""
    bins = bins.pivot(index=["method", "light", "bin"], columns="part", values="mean").reset_index()
    bins = bins.dropna(subset="confidence").sort_values(["light", "method"], kind="stable")
    return figure_uri(calibration_chart(bins.assign(light=bins["light"].map(summary.light_name)), methods))


def _tables_of(frame: "DataFrame", cell_means: "DataFrame") -> Iterator[tuple[str, "DataFrame"]]:
    """Of removal, then of depth: ranks, the decisive measure by scene and light, and all measures.

    Each has its title. `frame` has yardsticks; `cell_means` are its means by scene, light and method.
    """
    import pandas as pd

    for (decisive, title), task in zip(summary.DECISIVE.items(), ("removal", "depth"), strict=True):
        means = cell_means[cell_means["measure"] == decisive]
        if not len(means):
            continue
        ranked = summary.rank_table(frame, decisive)
        if len(ranked):
            yield f"{title}, methods compared on the same {ranked.columns[-1]}", ranked
        by_light = summary.mean_table(means, ["scene", "method"], "light", summary.light_name)
        yield f"{title} by photons per view", by_light
        if frame["scene"].nunique() <= MAX_DETAILED_SCENES:
            columns = {each.name: each.column for each in summary.MEASURES if each.of in (task, "both")}
            is_of_task = cell_means["method"].isin(means["method"].unique())
            shown = cell_means[cell_means["measure"].isin([*columns]) & is_of_task]
            shown = shown.assign(measure=pd.Categorical(shown["measure"], [*columns]))
            table = summary.mean_table(shown, ["scene", "light", "method"], "measure", columns.__getitem__)
            yield f"{title} beside other measures", table


def decisive_means(cell_means: "DataFrame") -> Iterator[tuple[str, str]]:
    """Of removal, then of depth, as far as there is any: a title, and means by method and light as lines."""
    means = summary.over_scenes(cell_means)
    for measure, title in summary.DECISIVE.items():
        of_measure = means[means["measure"] == measure]
        if len(of_measure):
            table = of_measure.pivot(index="method", columns="light", values="mean").sort_index(axis=1)
            table = table.rename(columns=summary.light_name).rename_axis(index=None, columns=None)
            yield title, table.to_string(float_format="{:.3f}".format, na_rep=NOT_KNOWN)
