"""The page of an evaluation, with what made it, and one page of all submissions to the benchmark.

Charts are of a measure against photons and time, and of how far confidence is right. Tables are of means and
ranks, as texts, for terminals too.
"""

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base import InputError, sweep_temporaries, write_bytes_safely
from pcii.evaluation import summary
from pcii.evaluation.method_names import (
    SUBMISSION,
    ScoredSubmission,
    estimator_of,
    known_methods,
    read_submission,
)
from pcii.evaluation.rows import Row, by_scene, frame_of, read_rows
from pcii.figures import (
    NOT_KNOWN,
    accuracy_chart,
    calibration_chart,
    emphasised,
    figure_uri,
    render_page,
    text_table,
)
from pcii.store import EVALUATION_FOLDER, IN_FRAMES, ROWS, hash_file, list_files, verify

if TYPE_CHECKING:
    from pandas import DataFrame, Series

MAX_DETAILED_SCENES = 12
"""Largest number of scenes with tables of all measures: a page with those of more is too large to load."""
TYPICAL_PHOTONS = 1000.0
"""Photons per view at which scenes and times are compared: those of the paper."""
NOT_BETTER = "†"
"""Mark of a mean that is no better than the best of `summary.SIMPLE` for the same scene and light."""
MIN_PX = 1e-3
"""Smaller errors of depth count as this one where they are averaged as logarithms."""
GEOMETRIC: Mapping[str, summary.Kind] = {"median_px": "geometric"}
BOUNDS = {"median_px": "bound_px"}
"""Measures with a bound, and the measure that is theirs."""
BOUND = "bound for whole objects (Cramér-Rao)"
"""Its name among methods."""


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
        yield f"{summary.AXES[measure]} against photons and time", _accuracy_plot(table, methods, measure)
    # Depths may have confidence where no object is scored, and so no decisive measure.
    methods = sorted({*methods, *table["method"][table["measure"].str.startswith("reliability.")]})
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


def _accuracy_plot(table: "DataFrame", methods: Sequence[str], measure: str) -> str:
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
    return figure_uri(calibration_chart(bins.assign(light=bins["light"].map(light_name)), methods))


def _tables_of(frame: "DataFrame", cell_means: "DataFrame") -> Iterator[tuple[str, "DataFrame"]]:
    """Of removal, then of depth: ranks, the decisive measure by scene and light, and all measures.

    Each has its title. `frame` has yardsticks; `cell_means` are its means by scene, light and method.
    """
    import pandas as pd

    for (decisive, title), task in zip(summary.DECISIVE.items(), ("removal", "depth"), strict=True):
        means = cell_means[cell_means["measure"] == decisive]
        if not len(means):
            continue
        ranked = _rank_table(frame, decisive)
        if len(ranked):
            yield f"{title}, methods compared on the same {ranked.columns[-1]}", ranked
        by_light = _mean_table(means, ["scene", "method"], "light", light_name)
        yield f"{title} by photons per view", by_light
        if frame["scene"].nunique() <= MAX_DETAILED_SCENES:
            columns = {each.name: each.column for each in summary.MEASURES if each.of in (task, "both")}
            is_of_task = cell_means["method"].isin(means["method"].unique())
            shown = cell_means[cell_means["measure"].isin([*columns]) & is_of_task]
            shown = shown.assign(measure=pd.Categorical(shown["measure"], [*columns]))
            table = _mean_table(shown, ["scene", "light", "method"], "measure", columns.__getitem__)
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


def write_page(folder: Path, out: Path) -> int:
    """Write the page of all submissions in a folder, each a folder in it; returns how many there are.

    Raises `InputError` for a folder without submissions, one that is not scored, was changed since or holds
    links, two of one name, scores of a method that a submission does not name, and submissions of several
    benchmarks.
    """
    submissions: dict[Path, ScoredSubmission] = {}
    for file in sorted(folder.glob(f"*/{SUBMISSION}")):
        if links := sorted(each for each in file.parent.iterdir() if each.is_symlink()):
            raise InputError(f"{links[0]}: is a link; a folder of scores holds its files themselves")
        verify(file.parent)
        submissions[file.parent] = read_submission(file.parent, ScoredSubmission)
    if not submissions:
        raise InputError(f"{folder}: has no folder with {SUBMISSION}; `pcii benchmark run` makes one")
    for name in ("benchmark", "half"):
        values = sorted({getattr(about, name) for about in submissions.values()})
        if len(values) > 1:
            raise InputError(f"{folder}: submissions are of more than one {name}: {', '.join(values)}")
    rows: list[Row] = []
    folder_of: dict[str, Path] = {}
    for inside, about in submissions.items():
        for method in about.methods:
            other = folder_of.setdefault(method.casefold(), inside)
            if other != inside:
                names = f"{other.name} and {inside.name}"
                raise InputError(f"{folder}: {names} are both of {about.method!r}, in upper or lower case")
        rows_of_submission = by_scene(read_rows(inside))
        if others := {row["method"] for row in rows_of_submission}.difference(about.methods):
            raise InputError(
                f"{inside / ROWS}: has rows of {min(others)!r}, which {SUBMISSION} does not name"
            )
        rows += rows_of_submission
    frame = summary.with_yardsticks(frame_of(rows))
    # Binary frames of a scene are the same photons: they would count it twice.
    of_scenes = frame[~frame["scene"].astype(str).str.endswith(IN_FRAMES)]
    first = next(iter(submissions.values()))
    pairs = sorted({(row["machine"], row["method"]) for row in rows if row.get("machine")})
    cell_means = summary.means(frame)
    content = {
        "benchmark": first.benchmark,
        "half": first.half,
        "scenes": of_scenes["scene"].nunique(),
        "comparisons": {
            measure: _compare(measure, cell_means)
            for measure in summary.AXES
            if measure in {*cell_means["measure"]}
        },
        "ranks": {
            f"{title} over all {summary.ranked_over(of_scenes, measure)}": _rank_table(of_scenes, measure)
            for measure, title in summary.DECISIVE.items()
        },
        "machines": {
            machine: [method for _, method in group] for machine, group in groupby(pairs, itemgetter(0))
        },
        "submissions": _submission_table(submissions, frame),
    }
    write_bytes_safely(out, render_page("benchmark.html.j2", content, script="benchmark.js"))
    return len(submissions)


def _compare(measure: str, cell_means: "DataFrame") -> dict[str, Any]:
    """A chart and tables of methods by one measure, from the means of `summary.means`."""
    import pandas as pd

    values = _values(measure, cell_means)
    of_scenes = values[~values["scene"].astype(str).str.endswith(IN_FRAMES)]
    is_geometric = of_scenes["measure"].isin(list(GEOMETRIC))
    of_scenes = of_scenes.assign(mean=of_scenes["mean"].mask(is_geometric, of_scenes["mean"].clip(MIN_PX)))
    over_scenes = summary.means_over_scenes(of_scenes, GEOMETRIC)
    accuracy = over_scenes[over_scenes["measure"] == measure]
    is_time = (over_scenes["measure"] == "seconds") & (over_scenes["light"] == TYPICAL_PHOTONS)
    times = over_scenes[is_time].assign(column=f"seconds at {TYPICAL_PHOTONS:g}")
    by_light = pd.concat([accuracy.assign(column=accuracy["light"].map(light_name).astype(object)), times])
    columns = [*map(light_name, accuracy["light"].unique()), *times["column"].unique()]
    by_light["column"] = pd.Categorical(by_light["column"], columns)
    at_typical = values[(values["measure"] == measure) & (values["light"] == TYPICAL_PHOTONS)]
    tables: dict[str, DataFrame] = {}
    if len(by_light):
        full_n = of_scenes["scene"].nunique()
        tables["By photons per view"] = _mean_table(by_light, ["method"], "column", full_n=full_n)
    if len(at_typical):
        title = f"By scene, at {TYPICAL_PHOTONS:g} photons per view"
        tables[title] = _mean_table(at_typical, ["scene"], "method")
    chart = _accuracy_plot(over_scenes, list(values["method"].cat.categories), measure)
    return {"chart": chart, "tables": tables}


def _values(measure: str, cell_means: "DataFrame") -> "DataFrame":
    """Means of the measure, photons and seconds of the methods that have it, the bound as the last method."""
    import pandas as pd

    def means_of(*measures: str) -> "DataFrame":
        return cell_means[cell_means["measure"].isin(measures)]

    cells = means_of(measure)[["scene", "light", "method"]]
    values = means_of(measure, "photons_per_view", "seconds").merge(cells)
    methods = sorted(cells["method"].unique(), key=lambda name: (name in summary.LOOK_AT_NO_PHOTON, name))
    bounds = means_of(BOUNDS.get(measure, "")).merge(cells).drop_duplicates(["scene", "light"], keep="last")
    if len(bounds):
        photons = means_of("photons_per_view").merge(bounds[["scene", "light", "method"]])
        bounds = pd.concat([bounds.assign(measure=measure), photons])
        values = pd.concat([values, bounds.assign(method=BOUND)])
        methods.append(BOUND)
    return values.assign(method=pd.Categorical(values["method"], methods))


def _submission_table(submissions: Mapping[Path, ScoredSubmission], frame: "DataFrame") -> "DataFrame":
    """The authors of each method, and the command that measures it again, each into another folder."""
    scores = frame.drop_duplicates(["method", "identity", "light"])["method"].value_counts()
    rows = []
    for folder, about in submissions.items():
        for method in filter(scores.__contains__, about.methods):
            name = about.command_name or method
            work = ["run", name] if about.is_run else ["score", "MAPS"]
            options = ["--data", "BENCHMARK", "--half", about.half, "-o", f"submissions/{folder.name}"]
            command = shlex.join(["pcii", "benchmark", *work, *options])
            is_known = name in known_methods() or ":" in (estimator_of(name) or name)
            if about.is_run and not is_known:
                command = "no method of this name is installed"
            texts = (text or NOT_KNOWN for text in (about.authors, about.url, about.trained_on))
            rows.append((method, *texts, str(scores[method]), command))
    header = ("method", "authors", "url", "trained on", "scores", "command")
    return text_table(sorted(rows), header, words=4)


def _with_interval(mean: float, low: float, high: float) -> str:
    """A mean with its interval, if it has one, as text; a dash for NaN."""
    if np.isnan(mean):
        return NOT_KNOWN
    return f"{mean:.3f}" if np.isnan(low) else f"{mean:.3f} ({low:.3f} to {high:.3f})"


def light_name(light: float | str) -> str:
    """A light of the frame as the name of a column or plot: "300", "full light"."""
    return light.replace("-", " ") if isinstance(light, str) else f"{light:g}"


def lines_of(table: "DataFrame") -> list[Any]:
    """The rows of a table, each with its columns as attributes."""
    return list(table.itertuples())


def _mean_table(
    means: "DataFrame", rows: Sequence[str], column: str, name: Callable[[Any], str] = str, full_n: int = 0
) -> "DataFrame":
    """Means with their intervals: `means` has the columns `rows`, and a column is made for each of `column`.

    Of `summary.MORE_IS_BETTER` the best method of a scene (if rows are of scenes) and light stands out, where
    another is worse, and `NOT_BETTER` marks those that are no better than the best of `summary.SIMPLE`;
    `BOUND` is no method. Means of fewer than `full_n` values have their number.
    """
    import pandas as pd

    contest = [key for key in ("scene", "light", "measure") if key in means]
    methods = means["method"].astype(object)
    is_simple = methods.isin(summary.SIMPLE)
    values = means["mean"].where(means["measure"].isin(summary.MORE_IS_BETTER) & (methods != BOUND))

    def best_of(some: "Series") -> "Series":
        return some.groupby([means[key] for key in contest], observed=True).transform("max")

    is_best = (values == best_of(values)) & (values > -best_of(-values))
    is_marked = ~is_simple & (values <= best_of(values.where(is_simple)))
    texts: list[str] = []
    for row in lines_of(means[["mean", "low", "high", "n"]].assign(is_best=is_best, is_marked=is_marked)):
        number = f" of {row.n}" if row.n < full_n else ""
        text = _with_interval(row.mean, row.low, row.high) + number + f" {NOT_BETTER}" * row.is_marked
        texts.append(emphasised(text) if row.is_best else text)
    cells = means.assign(text=pd.Series(texts, means.index, dtype=object))
    table = cells.pivot(index=list(rows), columns=column, values="text").sort_index(axis="columns")
    table = table.fillna(NOT_KNOWN).set_axis([*map(name, table.columns)], axis="columns").reset_index()
    if "light" in table:
        table["light"] = [*map(light_name, table["light"])]
    return table.set_index([*rows])


def _rank_table(frame: "DataFrame", measure: str) -> "DataFrame":
    """Methods as `ranks` has them by default, as texts."""
    rows = [
        (
            row.method,
            light_name(row.light),
            str(row.rank),
            _with_interval(row.mean, row.low, row.high),
            _with_interval(row.difference, row.difference_low, row.difference_high),
            *(NOT_KNOWN if np.isnan(p) else f"{p:.2g}" for p in (row.p, row.least_p)),
            str(row.n),
        )
        for row in lines_of(summary.ranks(frame, measure))
    ]
    header = ("method", "photons", "rank", "mean", "minus that of the best", "p", "least p possible")
    return text_table(rows, (*header, summary.ranked_over(frame, measure)))
