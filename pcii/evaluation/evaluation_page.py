"""The page of an evaluation: charts and tables of means and ranks, and what made them.

Charts are of a measure against photons and time, and of how far confidence is right. Tables are of texts, for
terminals too.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base import sweep_temporaries, write_bytes_safely
from pcii.evaluation import summary
from pcii.figures import (
    NOT_KNOWN,
    PLACES,
    accuracy_chart,
    calibration_chart,
    emphasised,
    figure_uri,
    render_page,
    text_table,
)
from pcii.store import EVALUATION_FOLDER, ROWS, hash_file, list_files

if TYPE_CHECKING:
    from pandas import DataFrame, Series

NOT_BETTER = "†"
"""Mark of a mean that is no better than the best of `SIMPLE` for the same scene and light."""
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
    cells, is_share = accuracies(table, measure), summary.kind_of(measure) != "positive"
    figure = accuracy_chart(cells, methods, summary.AXES[measure], is_share=is_share)
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


def with_interval(mean: float, low: float, high: float, digits: int = 3) -> str:
    """A mean with its interval as text, a dash for NaN.

    >>> with_interval(0.912, 0.905, 0.919), with_interval(0.912, float("nan"), float("nan"))
    ('0.912 (0.905 to 0.919)', '0.912')
    """
    if np.isnan(mean):
        return NOT_KNOWN
    text = f"{mean:.{digits}f}"
    return text if np.isnan(low) else f"{text} ({low:.{digits}f} to {high:.{digits}f})"


def light_name(light: float | str) -> str:
    """A light of the frame as the name of a column or plot.

    >>> light_name(300.0), light_name("full-light"), light_name("by exposure")
    ('300', 'full light', 'by exposure')
    """
    return light.replace("-", " ") if isinstance(light, str) else f"{light:g}"


def _tables_of(frame: "DataFrame", cell_means: "DataFrame") -> Iterator[tuple[str, "DataFrame"]]:
    """Of removal, then of depth: ranks, the decisive measure by scene and light, and all measures.

    Each has its title. `frame` has yardsticks; `cell_means` are its means by scene, light and method.
    """
    import pandas as pd

    for (decisive, title), task in zip(summary.DECISIVE.items(), ("removal", "depth"), strict=True):
        means = cell_means[cell_means["measure"] == decisive]
        if not len(means):
            continue
        unit, ranked = summary.ranked_over(frame, decisive), summary.ranks(frame, decisive)
        if len(ranked):
            yield f"{title}, methods compared on the same {unit}", rank_table(ranked, unit)
        yield f"{title} by photons per view", mean_table(means, ["scene", "method"], "light", light_name)
        if frame["scene"].nunique() <= MAX_DETAILED_SCENES:
            columns = {each.name: each.column for each in summary.MEASURES if each.of in (task, "both")}
            is_of_task = cell_means["method"].isin(means["method"].unique())
            shown = cell_means[cell_means["measure"].isin([*columns]) & is_of_task]
            shown = shown.assign(measure=pd.Categorical(shown["measure"], [*columns]))
            table = mean_table(shown, ["scene", "light", "method"], "measure", columns.__getitem__)
            yield f"{title} beside other measures", table


def decisive_means(cell_means: "DataFrame") -> Iterator[tuple[str, str]]:
    """Of removal, then of depth, as far as there is any: a title, and means by method and light as lines."""
    means = summary.over_scenes(cell_means)
    for measure, title in summary.DECISIVE.items():
        of_measure = means[means["measure"] == measure]
        if len(of_measure):
            table = of_measure.pivot(index="method", columns="light", values="mean").sort_index(axis=1)
            table = table.rename(columns=light_name).rename_axis(index=None, columns=None)
            yield title, table.to_string(float_format="{:.3f}".format, na_rep=NOT_KNOWN)


def mean_table(
    means: "DataFrame",
    rows: Sequence[str],
    column: str,
    name: Callable[[Any], str] = str,
    full_n: int = 0,
    bound: str = "",
) -> "DataFrame":
    """Means with their intervals: `means` has the columns `rows`, and a column is made for each of `column`.

    Of `MORE_IS_BETTER` the best method of a scene (if rows are of scenes) and light stands out, where another
    is worse, and `NOT_BETTER` marks methods that are no better than the best of `SIMPLE`; `bound`
    names what is no method. Means of fewer than `full_n` values have their number.
    """
    import pandas as pd

    contest = [key for key in ("scene", "light", "measure") if key in means]
    methods = means["method"].astype(object)
    is_simple = methods.isin(summary.SIMPLE)
    values = means["mean"].where(means["measure"].isin(summary.MORE_IS_BETTER) & (methods != bound))

    def best_of(some: "Series") -> "Series":
        return some.groupby([means[key] for key in contest], observed=True).transform("max")

    is_best = (values == best_of(values)) & (values > -best_of(-values))
    is_marked = ~is_simple & (values <= best_of(values.where(is_simple)))
    texts: list[str] = []
    for row in summary.lines_of(
        means[["mean", "low", "high", "n"]].assign(is_best=is_best, is_marked=is_marked)
    ):
        number = f" of {row.n}" if row.n < full_n else ""
        text = with_interval(row.mean, row.low, row.high) + number + f" {NOT_BETTER}" * row.is_marked
        texts.append(emphasised(text) if row.is_best else text)
    cells = means.assign(text=pd.Series(texts, means.index, dtype=object))
    table = cells.pivot(index=list(rows), columns=column, values="text").sort_index(axis="columns")
    table = table.fillna(NOT_KNOWN).set_axis([*map(name, table.columns)], axis="columns").reset_index()
    if "light" in table:
        table["light"] = [*map(light_name, table["light"])]
    return table.set_index([*rows])


def rank_table(table: "DataFrame", unit: str) -> "DataFrame":
    """Methods ranked over scenes or datasets; `table` is of `summary.ranks`."""
    rows = [
        (
            row.method,
            light_name(row.light),
            str(row.rank),
            with_interval(row.mean, row.low, row.high),
            with_interval(row.difference, row.difference_low, row.difference_high),
            *(NOT_KNOWN if np.isnan(p) else f"{p:.2g}" for p in (row.p, row.least_p)),
            str(row.n),
        )
        for row in summary.lines_of(table)
    ]
    header = ("method", "photons", "rank", "mean", "minus that of the best", "p", "least p possible", unit)
    return text_table(rows, header)
