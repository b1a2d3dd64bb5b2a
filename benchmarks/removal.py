"""Removal of defocused points by every method, scene by scene and by half and kind of scene (corpus.py)."""

from collections.abc import Iterator, Mapping

from benchmarks.corpus import Entry, by_half_and_kind, evaluated
from pcii.evaluation.comparison import Evaluation
from pcii.evaluation.method_names import DEPTH
from pcii.evaluation.tables import TITLES, Table, light_table, markdown, tables_of_scene
from pcii.removal.methods import removal_methods


def table() -> Iterator[str]:
    """Make and score what is missing, then tell all that is there, as Markdown."""
    yield from report(*evaluated("scores", (*removal_methods(), DEPTH)))


def report(evaluation: Evaluation, entry_of: Mapping[str, Entry]) -> Iterator[str]:
    """The tables of an evaluation, line by line; `entry_of` tells which scene a recipe is."""
    frame, means = evaluation.frame, evaluation.means()
    datasets = frame["identity"].nunique()
    yield f"removal of defocused points, {datasets} datasets. In brackets: 95 % intervals of means over seeds"
    for shown in (light_table(means, "iou", TITLES["iou"]), mean_iou(evaluation, entry_of)):
        yield f"\n{shown.title}\n\n{markdown(shown)}"
    for scene, own in frame.groupby("scene", observed=True):
        yield f"\n{scene}"
        for shown in tables_of_scene(own, means[means["scene"] == scene]):
            yield f"\n{shown.title}\n\n{markdown(shown)}"


def mean_iou(evaluation: Evaluation, entry_of: Mapping[str, Entry]) -> Table:
    """Mean over scenes of the mean object IoU, by half, kind and method; a column for each light."""
    title = "Mean IoU of scenes of a kind"
    return by_half_and_kind(title, evaluation, entry_of, "iou", lambda own: f"{own['mean'].mean():.3f}")
