"""Depth by every method, beside the best of the simple ones, scene by scene and by half and kind (corpus.py).

The measure is bad_1px: the share of the objects' pixels whose depth is off by more than 1 px of total
disparity, or missing. A ratio below 1 is better than the better one of both plane sweeps.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from benchmarks.corpus import Entry, Group, by_half_and_kind, evaluated
from pcii.evaluation.method_names import depth_name, estimator_of, methods_for
from pcii.evaluation.tables import Table, markdown

SIMPLE = (depth_name("likelihood-sweep"), depth_name("variance-sweep"))


def table() -> Iterator[str]:
    """Make and score what is missing, then tell all that is there, as Markdown."""
    methods = [name for name in methods_for(full_light=False) if estimator_of(name) is not None]
    yield from report(*evaluated("depth", methods))


def report(evaluation: Mapping[str, Any], entry_of: Mapping[str, Entry]) -> Iterator[str]:
    """The tables of an evaluation, line by line; `entry_of` tells which scene a group's recipe is."""
    groups = evaluation["groups"]
    yield f"depth, {sum(group['datasets'] for group in groups)} datasets: share of errors above 1 px, and"
    yield "its ratio to that of the better plane sweep"
    for shown in (by_scene(groups, entry_of), mean_errors(groups, entry_of)):
        yield f"\n{shown.title}\n\n{markdown(shown)}"


def by_scene(groups: Sequence[Group], entry_of: Mapping[str, Entry]) -> Table:
    """Errors of every scene and method, and their ratio; a column for each budget."""
    cells: dict[tuple[str, str, str, str], dict[float, str]] = {}
    for group in groups:
        entry = entry_of.get(group["recipe"])
        for row in group["results"] if entry is not None else ():
            errors = _errors(group, row)
            if entry is not None and errors is not None:
                names = (entry.half, entry.kind, entry.name, row["method"])
                cells.setdefault(names, {})[row["budget"]] = _told([errors])
    budgets = sorted({budget for own in cells.values() for budget in own})
    rows = [(*names, *(own.get(budget, "–") for budget in budgets)) for names, own in sorted(cells.items())]
    header = ("half", "kind", "scene", "method", *(f"{budget:g}" for budget in budgets))
    return Table("Errors above 1 px by scene", header, tuple(rows), words=4)


def mean_errors(groups: Sequence[Group], entry_of: Mapping[str, Entry]) -> Table:
    """Mean errors over scenes, and the ratio to the mean of each scene's better sweep."""
    return by_half_and_kind("Mean errors of scenes of a kind", groups, entry_of, _errors, _told)


def _errors(group: Group, row: Group) -> tuple[float, float | None] | None:
    """`bad_1px` of a row, and that of the better sweep of the same scene and budget."""
    own = _bad_1px(row)
    if own is None:
        return None
    sweeps = [other for other in group["results"] if other["method"] in SIMPLE]
    found = [_bad_1px(other) for other in sweeps if other["budget"] == row["budget"]]
    return own, min((bad for bad in found if bad is not None), default=None)


def _bad_1px(row: Group) -> float | None:
    mean = row.get("depth", {}).get("bad_1px")
    return None if mean is None else mean["mean"]


def _told(errors: Sequence[tuple[float, float | None]]) -> str:
    """Mean of the errors, and its ratio to the mean of the better sweeps where all scenes have them."""
    mean = sum(own for own, _ in errors) / len(errors)
    simple = [best for _, best in errors if best is not None]
    if len(simple) < len(errors) or not sum(simple):
        return f"{mean:.3f}"
    return f"{mean:.3f} ({mean * len(simple) / sum(simple):.2f})"
