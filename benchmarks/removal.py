"""Removal of defocused points by every method, scene by scene and by half and kind of scene (corpus.py)."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from benchmarks.corpus import Entry, Group, by_half_and_kind, evaluated
from pcii.evaluation.method_names import DEPTH
from pcii.evaluation.tables import Table, markdown, overview, tables_of
from pcii.removal.methods import removal_methods


def table() -> Iterator[str]:
    """Make and score what is missing, then tell all that is there, as Markdown."""
    yield from report(*evaluated("scores", (*removal_methods(), DEPTH)))


def report(evaluation: Mapping[str, Any], entry_of: Mapping[str, Entry]) -> Iterator[str]:
    """The tables of an evaluation, line by line; `entry_of` tells which scene a group's recipe is."""
    groups = evaluation["groups"]
    yield f"removal of defocused points, {sum(group['datasets'] for group in groups)} datasets. In brackets:"
    yield evaluation["interval"]
    for shown in (overview(groups), mean_iou(groups, entry_of)):
        yield f"\n{shown.title}\n\n{markdown(shown)}"
    for group in groups:
        yield f"\n{group['label']}"
        for shown in tables_of(group):
            yield f"\n{shown.title}\n\n{markdown(shown)}"


def mean_iou(groups: Sequence[Group], entry_of: Mapping[str, Entry]) -> Table:
    """Mean over scenes of the mean object IoU, by half, kind and method; a column for each budget."""

    def iou(_: Group, row: Group) -> float | None:
        found = row.get("object", {}).get("iou")
        return None if found is None else found["mean"]

    def mean(values: Sequence[float]) -> str:
        return f"{sum(values) / len(values):.3f}"

    return by_half_and_kind("Mean IoU of scenes of a kind", groups, entry_of, iou, mean)
