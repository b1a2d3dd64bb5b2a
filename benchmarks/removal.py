"""Removal of defocused points by every method, scene by scene and by half and kind of scene (corpus.py)."""

from collections.abc import Iterator, Mapping

from benchmarks.corpus import Entry, by_half_and_kind, evaluated, scene_means
from pcii.evaluation.comparison import Evaluation
from pcii.evaluation.method_names import DEPTH
from pcii.evaluation.tables import Table, markdown, tables_of
from pcii.removal.methods import removal_methods


def table() -> Iterator[str]:
    """Make and score what is missing, then tell all that is there, as Markdown."""
    yield from report(*evaluated("scores", (*removal_methods(), DEPTH)))


def report(evaluation: Evaluation, entry_of: Mapping[str, Entry]) -> Iterator[str]:
    """The tables of an evaluation, one by one; `entry_of` tells which scene a recipe is."""
    datasets = evaluation.frame["identity"].nunique()
    yield f"removal of defocused points, {datasets} datasets. In brackets: 95 % intervals of means over seeds"
    for shown in (*tables_of(evaluation.frame, evaluation.means()), mean_iou(evaluation, entry_of)):
        yield f"\n{shown.title}\n\n{markdown(shown)}"


def mean_iou(evaluation: Evaluation, entry_of: Mapping[str, Entry]) -> Table:
    """Mean over scenes of the mean object IoU, by half, kind and method; a column for each light."""
    own = scene_means(evaluation, entry_of, "iou")
    return by_half_and_kind("Mean IoU of scenes of a kind", own, lambda rows: f"{rows['mean'].mean():.3f}")
