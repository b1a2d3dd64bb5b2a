"""One page of all submissions in a folder: ranks, lines over light, best and worst scenes, and commands."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.benchmark.submission_scores import SUBMISSION, by_scene
from pcii.evaluation.pages import page
from pcii.evaluation.paired_tests import mean_interval, positive_mean_interval
from pcii.evaluation.plots import accuracy_plots
from pcii.evaluation.pooling import pooled_tables
from pcii.evaluation.rows import Row, all_rows, by_light
from pcii.evaluation.summary import summarise
from pcii.evaluation.tables import Table, budget_name, with_interval
from pcii.io.evaluation_layout import read_evaluation
from pcii.store.safe_files import write_bytes_safely

ORACLE = "oracle (masks from the true depth)"
SCENES_NAMED = 3
"""So many of the best and of the worst scenes of each method are named."""
TYPICAL_PHOTONS = 1000.0
"""Photons per view at which scenes and times are compared: those of the paper."""


@dataclass(frozen=True)
class Kind:
    """What methods of one kind are compared by: the part of a result, and the sign that makes more better."""

    title: str
    part: str
    measure: str
    words: str
    sign: int


KINDS = (
    Kind(
        "Removal of defocused points",
        "object",
        "iou",
        "IoU with the objects of each plane: more is better",
        1,
    ),
    Kind("Depth", "depth", "bad_1px", "share of pixels off by more than 1 px: less is better", -1),
)


def write_page(folder: Path, out: Path) -> int:
    """Write the page of all submissions in a folder, each a folder of its own; returns how many there are.

    Raises `InputError` for a folder without submissions, one that is not scored or was changed, two of one
    method, and submissions of several benchmarks.
    """
    submissions = [_read(file.parent) for file in sorted(folder.glob(f"*/{SUBMISSION}"))]
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
    evaluation = summarise([row for _, rows in submissions for row in by_scene(rows)])
    said_of = {said["folder"]: said for said, _ in submissions}
    kinds = [part for kind in KINDS if (part := _kind(kind, evaluation["groups"])) is not None]
    content = {
        "benchmark": submissions[0][0]["benchmark"],
        "half": submissions[0][0]["half"],
        "scenes": len({group["title"] for group in evaluation["groups"]}),
        "kinds": kinds,
        "ranks": pooled_tables(evaluation),
        "submissions": _submissions(made_by, said_of, evaluation["groups"]),
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


def _kind(kind: Kind, groups: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """What the page says of methods of one kind; None if there are none."""
    cells: dict[tuple[str, Any], dict[str, Any]] = {}
    for group in groups:
        for row in group["results"]:
            scores = row.get(kind.part, {})
            if scores.get(kind.measure) is None:
                continue
            cell = cells.setdefault((row["method"], row["budget"]), {"photons": [], "seconds": [], "of": {}})
            cell["of"][group["title"]] = scores[kind.measure]["mean"]
            cell["photons"] += [] if row["photons_per_view"] is None else [row["photons_per_view"]]
            cell["seconds"] += [] if row["seconds"] is None else [row["seconds"]["mean"]]
            if kind.part == "object" and row["pixel"].get("iou_oracle") is not None:
                oracle = cells.setdefault((ORACLE, row["budget"]), {"photons": [], "seconds": [], "of": {}})
                oracle["of"][group["title"]] = row["pixel"]["iou_oracle"]["mean"]
                oracle["photons"] = cell["photons"]
    if not cells:
        return None
    results = [
        {
            "method": method,
            "budget": budget,
            "photons_per_view": _mean(cell["photons"]),
            "seconds": positive_mean_interval(cell["seconds"]).figures() if cell["seconds"] else None,
            kind.part: {kind.measure: mean_interval([*cell["of"].values()], (0.0, 1.0)).figures()},
        }
        for (method, budget), cell in sorted(cells.items(), key=lambda item: by_light(item[0][1]))
    ]
    methods = sorted({method for method, _ in cells} - {ORACLE})
    drawn = [*methods, ORACLE] if any(method == ORACLE for method, _ in cells) else methods
    return {
        "title": kind.title,
        "words": kind.words,
        "plot": accuracy_plots({"results": results}, drawn, kind.measure),
        "table": _over_light(kind, results, drawn),
        "scenes": _best_and_worst(kind, cells, methods),
    }


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _over_light(kind: Kind, results: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Table:
    """The measure of each method at each light, the mean over scenes with its interval, and its time."""
    found = {(row["method"], row["budget"]): row for row in results}
    budgets = sorted({budget for _, budget in found}, key=by_light)
    rows = []
    for method in methods:
        cells = [found.get((method, budget)) for budget in budgets]
        shown = ["–" if row is None else with_interval(row[kind.part][kind.measure]) for row in cells]
        timed = found.get((method, TYPICAL_PHOTONS), {}).get("seconds")
        rows.append((method, *shown, with_interval(timed, 2)))
    header = ("method", *map(budget_name, budgets), f"seconds at {TYPICAL_PHOTONS:g}")
    return Table("By photons per view", header, tuple(rows))


def _best_and_worst(
    kind: Kind, cells: Mapping[tuple[str, Any], Mapping[str, Any]], methods: Sequence[str]
) -> Table:
    """Scenes that each method does best and worst at `TYPICAL_PHOTONS`, with their scores."""
    rows = []
    for method in methods:
        of = cells.get((method, TYPICAL_PHOTONS), {"of": {}})["of"]
        order = sorted(of, key=lambda scene: -kind.sign * of[scene])
        best, worst = order[:SCENES_NAMED], order[::-1][:SCENES_NAMED]
        words = (", ".join(f"{scene} {of[scene]:.2f}" for scene in scenes) for scenes in (best, worst))
        rows.append((method, *words))
    header = ("method", "best", "worst")
    return Table(f"Scenes at {TYPICAL_PHOTONS:g} photons per view", header, tuple(rows), words=3)


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
        verb, what = ("run", method) if run else ("score", folder)
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
