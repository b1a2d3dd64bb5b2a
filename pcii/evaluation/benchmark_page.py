"""One page of all submissions in a folder: ranks, lines over light, best and worst scenes, and commands."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from pcii.base.errors import InputError
from pcii.base.safe_files import write_bytes_safely
from pcii.evaluation.evaluation_pages import accuracy_plots
from pcii.evaluation.pages import page
from pcii.evaluation.paired_tests import mean_interval, positive_mean_interval
from pcii.evaluation.pooling import pooled_tables
from pcii.evaluation.rows import Row, all_rows, by_light
from pcii.evaluation.submission_checks import SUBMISSION
from pcii.evaluation.submission_pictures import TYPICAL_PHOTONS, picture_name
from pcii.evaluation.submission_scores import by_scene
from pcii.evaluation.summary import summarise
from pcii.evaluation.tables import Table, budget_name, with_interval
from pcii.figures.pictures import uri_of
from pcii.store.collection import IN_FRAMES
from pcii.store.folders import read_evaluation

SCENES_NAMED = 3
"""So many of the best and of the worst scenes of each method are shown."""
LEAST_PX = 1e-3
"""Smaller errors of depth count as this one where they are averaged as logarithms."""


@dataclass(frozen=True)
class Kind:
    """What methods are compared by: the part of a result and a measure in it, and the bound on that.

    `sign` makes more better. Only those that are `pictured` show their best and worst scenes.
    """

    title: str
    part: str
    measure: str
    words: str
    sign: int
    bound: str = ""
    is_share: bool = True
    pictured: bool = True

    def over_scenes(self, values: Sequence[float]) -> dict[str, Any]:
        """The mean over scenes and its interval: of shares, or the geometric one of errors in px."""
        if self.is_share:
            return mean_interval(values, (0.0, 1.0)).figures()
        logs = mean_interval([math.log(max(value, LEAST_PX)) for value in values])
        ends = None if logs.low is None or logs.high is None else [math.exp(logs.low), math.exp(logs.high)]
        return {"n": logs.n, "mean": math.exp(logs.mean), "interval": ends}

    def bound_of(self, result: Mapping[str, Any]) -> float | None:
        """The bound at the light of a result, if there is one and the result has it."""
        if self.part == "object":
            oracle = result["object"].get("iou_oracle")
            return None if oracle is None else oracle["mean"]
        if not self.bound:
            return None
        objects = result.get("bounds", {}).get("objects", ())
        known = [entry["depth_sigma_px"]["mean"] for entry in objects if entry["depth_sigma_px"]]
        return median(known) if known else None


KINDS = (
    Kind(
        "Removal of defocused points",
        "object",
        "iou",
        "IoU with the objects of each plane: more is better. The oracle knows the true depth of each pixel",
        1,
        "oracle (masks from the true depth)",
    ),
    Kind("Depth", "depth", "bad_1px", "Share of pixels off by more than 1 px: less is better", -1),
    Kind(
        "Error of depth",
        "depth",
        "median_px",
        "Median error of the pixels with an answer, geometric mean over scenes: less is better. The "
        "Cramér-Rao bound is the least standard deviation of the depth of an object as a whole, given its "
        "photons and its texture; median over the objects of a scene",
        -1,
        "bound for whole objects (Cramér-Rao)",
        is_share=False,
        pictured=False,
    ),
)


def write_page(folder: Path, out: Path) -> int:
    """Write the page of all submissions in a folder, each a folder of its own; returns how many there are.

    Raises `InputError` for a folder without submissions, one that is not scored or was changed, two of one
    method, and submissions of several benchmarks.
    """
    submissions = [_read(file.parent) for file in sorted(folder.glob(f"*/{SUBMISSION}"))]
    if (folder / SUBMISSION).is_file():
        raise InputError(f"{folder}: is a submission; name the folder that it is in")
    if not submissions:
        raise InputError(f"{folder}: has no folder with {SUBMISSION}; `pcii benchmark run` makes one")
    for what in ("benchmark", "half"):
        values = sorted({str(said[what]) for said, _ in submissions})
        if len(values) > 1:
            raise InputError(f"{folder}: submissions are of more than one {what}: {', '.join(values)}")
    made_by: dict[str, str] = {}
    for said, rows in submissions:
        for method in {row["method"] for row in rows}:
            if method in made_by:
                raise InputError(f"{folder}: {made_by[method]} and {said['folder']} are both of {method!r}")
            made_by[method] = said["folder"]
    rows = [row for _, rows in submissions for row in by_scene(rows)]
    # Binary frames of a scene are the same photons: they would count it twice.
    in_frames = [row for row in rows if row["title"].endswith(IN_FRAMES)]
    evaluation = summarise([row for row in rows if not row["title"].endswith(IN_FRAMES)])
    groups, of_frames = evaluation["groups"], summarise(in_frames)["groups"]
    said_of = {said["folder"]: said for said, _ in submissions}
    folder_of = {method: folder / name for method, name in made_by.items()}
    kinds = [part for kind in KINDS if (part := _kind(kind, groups, of_frames, folder_of)) is not None]
    content = {
        "benchmark": submissions[0][0]["benchmark"],
        "half": submissions[0][0]["half"],
        "scenes": len(groups),
        "kinds": kinds,
        "typical": f"{TYPICAL_PHOTONS:g}",
        "ranks": pooled_tables(evaluation),
        "submissions": _submissions(made_by, said_of, [*groups, *of_frames]),
    }
    write_bytes_safely(out, page("benchmark.html.j2", content, "benchmark.js"))
    return len(submissions)


def _read(folder: Path) -> tuple[dict[str, Any], list[Row]]:
    """What a submission says, its folder's name among it, and its rows."""
    read_evaluation(folder)  # raises `InputError` if it is unfinished, or was changed
    try:
        said = json.loads((folder / SUBMISSION).read_text(encoding="utf-8"))
        said = {**said, "folder": folder.name}
        _ = said["benchmark"], said["half"], said["method"], said["made"]
    except (ValueError, TypeError, KeyError, OSError):
        raise InputError(f"{folder / SUBMISSION}: damaged; score the submission again") from None
    with all_rows(folder) as rows:
        return said, rows


def _cells(kind: Kind, groups: Sequence[Mapping[str, Any]]) -> dict[tuple[str, Any], dict[str, Any]]:
    """By method (or bound) and budget: its measure of each scene, and photons and seconds of all."""
    cells: dict[tuple[str, Any], dict[str, Any]] = {}
    for group in groups:
        for row in group["results"]:
            scores = row.get(kind.part, {})
            if scores.get(kind.measure) is None:
                continue
            found = {row["method"]: scores[kind.measure]["mean"]}
            if (bound := kind.bound_of(row)) is not None:
                found[kind.bound] = bound
            for name, value in found.items():
                cell = cells.setdefault((name, row["budget"]), {"photons": [], "seconds": [], "of": {}})
                cell["of"][group["title"]] = value
                cell["photons"] += [] if row["photons_per_view"] is None else [row["photons_per_view"]]
                if name != kind.bound and row["seconds"] is not None:
                    cell["seconds"].append(row["seconds"]["mean"])
    return cells


def _kind(
    kind: Kind,
    groups: Sequence[Mapping[str, Any]],
    of_frames: Sequence[Mapping[str, Any]],
    folder_of: Mapping[str, Path],
) -> dict[str, Any] | None:
    """What the page says of methods by one measure; None if there are none.

    Results of binary frames (`of_frames`) are shown scene by scene only.
    """
    cells = _cells(kind, groups)
    if not cells:
        return None
    results = [
        {
            "method": method,
            "budget": budget,
            "photons_per_view": _mean(cell["photons"]),
            "seconds": positive_mean_interval(cell["seconds"]).figures() if cell["seconds"] else None,
            kind.part: {kind.measure: kind.over_scenes([*cell["of"].values()])},
        }
        for (method, budget), cell in sorted(cells.items(), key=lambda item: by_light(item[0][1]))
    ]
    methods = sorted({method for method, _ in cells} - {kind.bound})
    drawn = [*methods, kind.bound] if any(method == kind.bound for method, _ in cells) else methods
    return {
        "title": kind.title,
        "words": kind.words,
        "plot": accuracy_plots({"results": results}, drawn, kind.measure),
        "table": _over_light(kind, results, drawn, len(groups)),
        "by_scene": _by_scene(_cells(kind, [*groups, *of_frames]), drawn),
        "scenes": [
            _best_and_worst(kind, cells, method, folder_of[method])
            for method in methods
            if kind.pictured and (method, TYPICAL_PHOTONS) in cells
        ],
    }


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _over_light(
    kind: Kind, results: Sequence[Mapping[str, Any]], methods: Sequence[str], scenes: int
) -> Table:
    """The measure of each method at each light, the mean over scenes with its interval, and its time.

    Where it has the measure of fewer than all `scenes` their number is said.
    """
    found = {(row["method"], row["budget"]): row for row in results}
    budgets = sorted({budget for _, budget in found}, key=by_light)
    rows = []
    for method in methods:
        cells = [found.get((method, budget)) for budget in budgets]
        means = [None if row is None else row[kind.part][kind.measure] for row in cells]
        shown = [
            with_interval(mean) + (f" of {mean['n']} scenes" if mean and mean["n"] < scenes else "")
            for mean in means
        ]
        timed = found.get((method, TYPICAL_PHOTONS), {}).get("seconds")
        rows.append((method, *shown, with_interval(timed, 2)))
    header = ("method", *map(budget_name, budgets), f"seconds at {TYPICAL_PHOTONS:g}")
    return Table("By photons per view", header, tuple(rows))


def _by_scene(cells: Mapping[tuple[str, Any], Mapping[str, Any]], methods: Sequence[str]) -> Table:
    """The measure of each method on each scene at `TYPICAL_PHOTONS`, means over seeds."""
    known = [method for method in methods if (method, TYPICAL_PHOTONS) in cells]
    of = {method: cells[method, TYPICAL_PHOTONS]["of"] for method in known}
    scenes = dict.fromkeys(scene for own in of.values() for scene in own)
    rows = [
        (scene, *(f"{own[scene]:.3f}" if scene in own else "–" for own in of.values())) for scene in scenes
    ]
    return Table(f"By scene, at {TYPICAL_PHOTONS:g} photons per view", ("scene", *known), tuple(rows))


def _best_and_worst(
    kind: Kind, cells: Mapping[tuple[str, Any], Mapping[str, Any]], method: str, folder: Path
) -> dict[str, Any]:
    """Scenes that a method does best and worst at `TYPICAL_PHOTONS`, each with its score and picture."""
    of = cells[method, TYPICAL_PHOTONS]["of"]
    order = sorted(of, key=lambda scene: -kind.sign * of[scene])
    shown = order if len(order) <= 2 * SCENES_NAMED else [*order[:SCENES_NAMED], *order[-SCENES_NAMED:]]
    scenes = []
    for scene in shown:
        file = folder / picture_name(kind.part, scene)
        picture = uri_of("webp", file.read_bytes()) if file.is_file() else None
        scenes.append({"name": scene, "score": f"{of[scene]:.2f}", "picture": picture})
    return {"method": method, "scenes": scenes}


def _submissions(
    made_by: Mapping[str, str],
    said_of: Mapping[str, Mapping[str, Any]],
    groups: Sequence[Mapping[str, Any]],
) -> Table:
    """Whose each method is, what it took, and the command that measures it again."""
    scores = Counter[str]()
    for group in groups:
        for row in group["results"]:
            scores[row["method"]] += row["seeds"]
    rows = []
    for method, folder in sorted(made_by.items()):
        said = said_of[folder]
        run = said["made"].startswith("run")
        verb, what = ("run", method) if run else ("score", "MAPS")
        rows.append(
            (
                method,
                str(said.get("authors", "–")),
                str(said.get("url", "–")),
                f"{said['peak_memory_mb']} MB" if run else "–",
                str(scores[method]),
                f"pcii benchmark {verb} {what} --data BENCHMARK --half {said['half']} -o OUT",
            )
        )
    header = ("method", "authors", "url", "memory at most", "scores", "command")
    return Table("Submissions", header, tuple(rows), words=3)
