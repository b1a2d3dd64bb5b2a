"""One page of all submissions in a folder: ranks, lines over light, best and worst scenes, and commands."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.safe_files import write_bytes_safely
from pcii.evaluation.benchmark_scores import TYPICAL_PHOTONS, by_scene, picture_name, read_scores
from pcii.evaluation.pages import accuracy_plot, page
from pcii.evaluation.rows import Row, frame_of, read_rows
from pcii.evaluation.submissions import SUBMISSION
from pcii.evaluation.summary import Kind, lines_of, mean_interval, means, ranks
from pcii.evaluation.tables import TITLES, Table, light_name, rank_table, with_interval
from pcii.figures.pictures import uri_of
from pcii.store.collection import IN_FRAMES

if TYPE_CHECKING:
    from pandas import DataFrame

SCENES_NAMED = 3
"""So many of the best and of the worst scenes of each method are shown."""
MIN_PX = 1e-3
"""Smaller errors of depth count as this one where they are averaged as logarithms."""


@dataclass(frozen=True)
class Comparison:
    """What methods are compared by: a measure, and the measure and name of the bound on it.

    `sign` makes more better; without one there are no best and worst scenes. Means over scenes are of shares
    or, without `is_share`, geometric.
    """

    title: str
    measure: str
    words: str
    sign: int = 0
    bound_measure: str = ""
    bound: str = ""
    is_share: bool = True


COMPARISONS = (
    Comparison(
        "Removal of defocused points",
        "iou",
        "IoU with the objects of each plane: more is better. The oracle knows the true depth of each pixel",
        1,
        "iou_oracle",
        "oracle (masks from the true depth)",
    ),
    Comparison("Depth", "bad_1px", "Share of pixels off by more than 1 px: less is better", -1),
    Comparison(
        "Error of depth",
        "median_px",
        "Median error of the pixels with an answer, geometric mean over scenes: less is better. The "
        "Cramér-Rao bound is the least standard deviation of the depth of an object as a whole, given its "
        "photons and its texture; median over the objects of a scene",
        0,
        "bound_px",
        "bound for whole objects (Cramér-Rao)",
        is_share=False,
    ),
)


def write_page(folder: Path, out: Path) -> int:
    """Write the page of all submissions in a folder, each a folder of its own; returns how many there are.

    Raises `InputError` for a folder without submissions, one that is not scored, two of one method, and
    submissions of several benchmarks.
    """
    submissions = {file.parent: read_scores(file.parent) for file in sorted(folder.glob(f"*/{SUBMISSION}"))}
    if not submissions:
        raise InputError(f"{folder}: has no folder with {SUBMISSION}; `pcii benchmark run` makes one")
    for name in ("benchmark", "half"):
        values = sorted({about[name] for about in submissions.values()})
        if len(values) > 1:
            raise InputError(f"{folder}: submissions are of more than one {name}: {', '.join(values)}")
    rows: list[Row] = []
    folder_of: dict[str, Path] = {}
    for inside in submissions:
        own = by_scene(read_rows(inside))
        rows += own
        for method in {row["method"] for row in own}:
            if folder_of.setdefault(method, inside) != inside:
                names = f"{folder_of[method].name} and {inside.name}"
                raise InputError(f"{folder}: {names} are both of {method!r}")
    frame = frame_of(rows)
    # Binary frames of a scene are the same photons: they would count it twice.
    of_scenes = frame[~frame["scene"].astype(str).str.endswith(IN_FRAMES)]
    about = next(iter(submissions.values()))
    content = {
        "benchmark": about["benchmark"],
        "half": about["half"],
        "scenes": of_scenes["scene"].nunique(),
        "kinds": [
            part for each in COMPARISONS if (part := _compare(each, frame, of_scenes, folder_of)) is not None
        ],
        "typical": f"{TYPICAL_PHOTONS:g}",
        "ranks": [
            rank_table(ranks(of_scenes, measure), measure, f"{title} over all scenes")
            for measure, title in TITLES.items()
        ],
        "submissions": _submission_table(submissions, folder_of, frame),
    }
    write_bytes_safely(out, page("benchmark.html.j2", content, "benchmark.js"))
    return len(submissions)


def _compare(
    comparison: Comparison, frame: "DataFrame", of_scenes: "DataFrame", folder_of: Mapping[str, Path]
) -> dict[str, Any] | None:
    """What the page says of methods by one measure; None if there are none."""
    values = _values(comparison, of_scenes)
    if not len(values):
        return None
    methods = sorted({*values["method"]} - {comparison.bound})
    lines = [*methods, *({comparison.bound} & {*values["method"]})]
    over_scenes = _over_scenes(comparison, values)
    return {
        "title": comparison.title,
        "words": comparison.words,
        "plot": accuracy_plot(over_scenes, lines, comparison.measure),
        "table": _table_by_light(comparison, over_scenes, lines, of_scenes["scene"].nunique()),
        "by_scene": _table_by_scene(_values(comparison, frame), lines),
        "scenes": [
            _best_and_worst(comparison, values, method, folder_of[method])
            for method in methods
            if comparison.sign
        ],
    }


def _values(comparison: Comparison, frame: "DataFrame") -> "DataFrame":
    """Means over seeds: `method` (or bound), `light`, `scene`, `value`, `photons_per_view`, `seconds`."""
    import pandas as pd

    keys = ["scene", "light", "method"]
    table = means(frame).pivot(index=keys, columns="measure", values="mean").reset_index()
    columns = [*keys, "value", "photons_per_view", "seconds"]
    if comparison.measure not in table:
        return pd.DataFrame(columns=columns)
    table = table.reindex(columns=[*dict.fromkeys([*table.columns, *columns, comparison.bound_measure])])
    table["value"] = table[comparison.measure]
    table = table[table["value"].notna()]
    if comparison.bound:
        known = table[table[comparison.bound_measure].notna()].drop_duplicates(
            ["scene", "light"], keep="last"
        )
        bounds = known.assign(method=comparison.bound, value=known[comparison.bound_measure], seconds=np.nan)
        table = pd.concat([table, bounds])
    return table[columns]


def _over_scenes(comparison: Comparison, values: "DataFrame") -> "DataFrame":
    """Means over scenes of the measure, photons and seconds, by method and light."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for (light, method), own in values.groupby(["light", "method"], observed=True):
        kinds: dict[str, Kind] = {"photons_per_view": "positive", "seconds": "positive"}
        kinds["value"] = "share" if comparison.is_share else "geometric"
        for column, kind in kinds.items():
            known = own[column].dropna()
            if len(known):
                measure = comparison.measure if column == "value" else column
                known = known.clip(lower=MIN_PX) if kind == "geometric" else known
                mean = mean_interval(known.to_list(), kind)
                rows.append({"light": light, "method": method, "measure": measure, **mean._asdict()})
    return pd.DataFrame(rows)


def _table_by_light(comparison: Comparison, over_scenes: "DataFrame", lines: list[str], scenes: int) -> Table:
    """The measure of each method at each light, the mean over scenes with its interval, and its time.

    Where it has the measure of fewer than all `scenes` their number is said.
    """
    cells = {(row.method, row.light, row.measure): row for row in lines_of(over_scenes)}
    lights = list(over_scenes["light"].unique())
    rows = []
    for method in lines:
        texts = [method]
        for light in lights:
            row = cells.get((method, light, comparison.measure))
            few = f" of {row.n} scenes" if row is not None and row.n < scenes else ""
            texts.append("–" if row is None else with_interval(row.mean, row.low, row.high) + few)
        row = cells.get((method, TYPICAL_PHOTONS, "seconds"))
        texts.append("–" if row is None else with_interval(row.mean, row.low, row.high, 2))
        rows.append(tuple(texts))
    header = ("method", *map(light_name, lights), f"seconds at {TYPICAL_PHOTONS:g}")
    return Table("By photons per view", header, tuple(rows))


def _table_by_scene(values: "DataFrame", lines: list[str]) -> Table:
    """The measure of each method on each scene at `TYPICAL_PHOTONS`, means over seeds."""
    cells = _typical(values).pivot(index="scene", columns="method", values="value")
    cells = cells[[method for method in lines if method in cells]]
    rows = [
        (str(scene), *("–" if np.isnan(value) else f"{value:.3f}" for value in row))
        for scene, row in zip(cells.index, cells.to_numpy().tolist(), strict=True)
    ]
    return Table(f"By scene, at {TYPICAL_PHOTONS:g} photons per view", ("scene", *cells.columns), tuple(rows))


def _typical(values: "DataFrame") -> "DataFrame":
    return values[values["light"] == TYPICAL_PHOTONS]


def _best_and_worst(comparison: Comparison, values: "DataFrame", method: str, folder: Path) -> dict[str, Any]:
    """Scenes that a method does best and worst at `TYPICAL_PHOTONS`, each with its score and picture."""
    own = _typical(values[values["method"] == method]).assign(
        order=lambda table: -comparison.sign * table["value"]
    )
    pairs = own.sort_values("order", kind="stable")[["scene", "value"]].to_numpy().tolist()
    scenes = []
    for scene, value in (
        pairs if len(pairs) <= 2 * SCENES_NAMED else pairs[:SCENES_NAMED] + pairs[-SCENES_NAMED:]
    ):
        file = folder / picture_name(comparison.measure, scene)
        picture = uri_of("webp", file.read_bytes()) if file.is_file() else None
        scenes.append({"name": scene, "score": f"{value:.2f}", "picture": picture})
    return {"method": method, "scenes": scenes}


def _submission_table(
    submissions: Mapping[Path, Mapping[str, Any]], folder_of: Mapping[str, Path], frame: "DataFrame"
) -> Table:
    """Whose each method is, what it took, and the command that measures it again, in a folder of its own."""
    rows = []
    for method, folder in sorted(folder_of.items()):
        about = submissions[folder]
        is_run = about["made"].startswith("run")
        work = f"run {about.get('command_name', method)}" if is_run else "score MAPS"
        rows.append(
            (
                method,
                str(about.get("authors", "–")),
                str(about.get("url", "–")),
                f"{about['peak_memory_mb']} MB" if is_run else "–",
                str(len(frame[frame["method"] == method].drop_duplicates(["identity", "light"]))),
                f"pcii benchmark {work} --data BENCHMARK --half {about['half']} -o submissions/{folder.name}",
            )
        )
    header = ("method", "authors", "url", "memory at most", "scores", "command")
    return Table("Submissions", header, tuple(rows), words=3)
