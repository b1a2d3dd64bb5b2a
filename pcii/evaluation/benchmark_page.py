"""One page of all submissions in a folder: lines over light, tables, ranks, and commands."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcii.base import InputError, write_bytes_safely
from pcii.evaluation.benchmark_scores import TYPICAL_PHOTONS, by_scene
from pcii.evaluation.evaluation_page import ABOUT_YARDSTICKS, accuracy_plot
from pcii.evaluation.method_names import estimator_of, known_methods
from pcii.evaluation.rows import Row, frame_of, read_rows
from pcii.evaluation.submissions import SUBMISSION, ScoredSubmission, read_as
from pcii.evaluation.summary import (
    LOOK_AT_NO_PHOTON,
    Kind,
    means,
    means_over_scenes,
    ranked_over,
    ranks,
    with_yardsticks,
)
from pcii.evaluation.tables import TITLES, light_name, mean_table, rank_table
from pcii.figures import NOT_KNOWN, render_page, text_table
from pcii.store import IN_FRAMES, ROWS, verify

if TYPE_CHECKING:
    from pandas import DataFrame

MAX_BYTES = 20_000_000
"""Size of all files of a submission at most."""
MIN_PX = 1e-3
"""Smaller errors of depth count as this one where they are averaged as logarithms."""


@dataclass(frozen=True)
class Comparison:
    """A measure that methods are compared by, and the measure and the name of the bound on it, if any."""

    title: str
    measure: str
    words: str
    bound_measure: str = ""
    bound: str = ""


COMPARISONS = (
    Comparison(
        "Removal of defocused points",
        "iou",
        "IoU (pixels both claimed and true / pixels claimed or true) with the objects of each plane, mean "
        "over planes that hold objects: more is better. What leans through the depths belongs to no plane",
    ),
    Comparison(
        "Removal by pixel",
        "pixel_iou",
        "IoU with the points within 1 px of blur at each plane, whatever they belong to: more is better",
    ),
    Comparison(
        "Claimed falsely",
        "false_share",
        "Pixels claimed at a plane that show none of its objects / all pixels of the film: less is better, "
        "and 0 is who claims nothing",
    ),
    Comparison(
        "Depth within 1 px",
        "within_1px",
        "Share of the objects' pixels whose depth is within 1 px of total disparity, that between the "
        "outermost cameras, no answer being a wrong one: more is better",
    ),
    Comparison("Depth within 3 px", "within_3px", "The same within 3 px: more is better"),
    Comparison(
        "Confidence",
        "quadratic_score",
        "Quadratic score: share within 1 px minus the Brier score, the mean square of confidence minus 1 "
        "where right and minus 0 where wrong: more is better. 0 is who never answers, 1 who is always right "
        "and sure, below 0 who is sure and wrong",
    ),
    Comparison(
        "Error of depth",
        "median_px",
        "Median error of the objects' pixels in px of total disparity, geometric mean over scenes of which "
        "most pixels have an answer: less is better. The Cramér-Rao bound is the least standard deviation of "
        "the depth of an object as a whole, given its photons and its texture; median over the objects of a "
        "scene",
        "bound_px",
        "bound for whole objects (Cramér-Rao)",
    ),
)
GEOMETRIC: Mapping[str, Kind] = {"median_px": "geometric"}


def write_page(folder: Path, out: Path) -> int:
    """Write the page of all submissions in a folder, each a folder in it; returns how many there are.

    Raises `InputError` for a folder without submissions, one that is not scored or was changed since, two of
    one name, a name that could be taken for another one, and submissions of several benchmarks.
    """
    submissions: dict[Path, ScoredSubmission] = {}
    for file in sorted(folder.glob(f"*/{SUBMISSION}")):
        _verify_scores(file.parent)
        submissions[file.parent] = read_as(ScoredSubmission, file.parent)
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
        new_rows = by_scene(read_rows(inside))
        if unnamed := {row["method"] for row in new_rows}.difference(about.methods):
            raise InputError(
                f"{inside / ROWS}: has rows of {min(unnamed)!r}, which {SUBMISSION} does not name"
            )
        rows += new_rows
    frame = with_yardsticks(frame_of(rows))
    # Binary frames of a scene are the same photons: they would count it twice.
    of_scenes = frame[~frame["scene"].astype(str).str.endswith(IN_FRAMES)]
    first = next(iter(submissions.values()))
    cell_means = means(frame)
    content = {
        "benchmark": first.benchmark,
        "half": first.half,
        "yardsticks": ABOUT_YARDSTICKS,
        "scenes": of_scenes["scene"].nunique(),
        "comparisons": [
            _compare(comparison, cell_means)
            for comparison in COMPARISONS
            if comparison.measure in set(cell_means["measure"])
        ],
        "ranks": dict(_ranks(of_scenes, measure) for measure in TITLES),
        "machines": _machines(rows),
        "submissions": _submission_table(submissions, frame),
    }
    write_bytes_safely(out, render_page("benchmark.html.j2", content, script="benchmark.js"))
    return len(submissions)


def _verify_scores(folder: Path) -> None:
    """Verify scores by others; raises `InputError` as `verify`, for links, and for more than `MAX_BYTES`."""
    sizes = {file: file.lstat().st_size for file in sorted(folder.iterdir())}
    for file in (folder, *sizes):
        if file.is_symlink() or not (file.is_file() or file == folder):
            raise InputError(f"{file}: is a link or no file; a folder of scores holds nothing but files")
    if sum(sizes.values()) > MAX_BYTES:
        largest = max(sizes, key=sizes.__getitem__)
        raise InputError(f"{largest}: has {sizes[largest]} bytes; all files may have {MAX_BYTES} together")
    verify(folder)


def _compare(comparison: Comparison, cell_means: "DataFrame") -> dict[str, Any]:
    """What the page says of methods by one measure, from the means of `summary.means`."""
    import pandas as pd

    measure = comparison.measure
    values = _values(comparison, cell_means)
    of_scenes = values[~values["scene"].astype(str).str.endswith(IN_FRAMES)]
    is_geometric = of_scenes["measure"].isin(list(GEOMETRIC))
    of_scenes = of_scenes.assign(mean=of_scenes["mean"].mask(is_geometric, of_scenes["mean"].clip(MIN_PX)))
    over_scenes = means_over_scenes(of_scenes, GEOMETRIC)
    accuracy = over_scenes[over_scenes["measure"] == measure]
    is_time = (over_scenes["measure"] == "seconds") & (over_scenes["light"] == TYPICAL_PHOTONS)
    times = over_scenes[is_time].assign(column=f"seconds at {TYPICAL_PHOTONS:g}")
    by_light = pd.concat([accuracy.assign(column=accuracy["light"].map(light_name).astype(object)), times])
    columns = [*map(light_name, accuracy["light"].unique()), *times["column"].unique()]
    by_light["column"] = pd.Categorical(by_light["column"], columns)
    at_typical = values[(values["measure"] == measure) & (values["light"] == TYPICAL_PHOTONS)]
    tables: dict[str, DataFrame] = {}
    scenes, bound = of_scenes["scene"].nunique(), comparison.bound
    if len(by_light):
        title = "By photons per view"
        tables[title] = mean_table(by_light, ["method"], "column", full_n=scenes, bound=bound)
    if len(at_typical):
        title = f"By scene, at {TYPICAL_PHOTONS:g} photons per view"
        tables[title] = mean_table(at_typical, ["scene"], "method", bound=bound)
    chart = accuracy_plot(over_scenes, list(values["method"].cat.categories), measure)
    return {"title": comparison.title, "words": comparison.words, "chart": chart, "tables": tables}


def _values(comparison: Comparison, cell_means: "DataFrame") -> "DataFrame":
    """Means of the measure, photons and seconds of the methods that have it, the bound as the last method."""
    import pandas as pd

    def means_of(*measures: str) -> "DataFrame":
        return cell_means[cell_means["measure"].isin(measures)]

    cells = means_of(comparison.measure)[["scene", "light", "method"]]
    values = means_of(comparison.measure, "photons_per_view", "seconds").merge(cells)
    methods = sorted(cells["method"].unique(), key=lambda name: (name in LOOK_AT_NO_PHOTON, name))
    bounds = means_of(comparison.bound_measure).merge(cells).drop_duplicates(["scene", "light"], keep="last")
    if len(bounds):
        photons = means_of("photons_per_view").merge(bounds[["scene", "light", "method"]])
        bounds = pd.concat([bounds.assign(measure=comparison.measure), photons])
        values = pd.concat([values, bounds.assign(method=comparison.bound)])
        methods.append(comparison.bound)
    return values.assign(method=pd.Categorical(values["method"], methods))


def _ranks(frame: "DataFrame", measure: str) -> tuple[str, "DataFrame"]:
    unit = ranked_over(frame, measure)
    return f"{TITLES[measure]} over all {unit}", rank_table(ranks(frame, measure), unit)


def _machines(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Methods by the machines that their seconds are of."""
    pairs = sorted({(row["machine"], row["method"]) for row in rows if row.get("machine")})
    return {machine: [method for _, method in group] for machine, group in groupby(pairs, itemgetter(0))}


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
