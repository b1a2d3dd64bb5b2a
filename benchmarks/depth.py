"""Depth by every method, beside the best of the simple ones, scene by scene and by half and kind (corpus.py).

The measure is the share of the objects' pixels whose depth is off by more than 1 px of total disparity, or
missing. A ratio below 1 is better than the best of the plane sweeps.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from benchmarks.corpus import Entry, by_half_and_kind, evaluated, scene_means, table_by_light
from pcii.evaluation.comparison import Evaluation
from pcii.evaluation.method_names import depth_name, estimator_of, methods_for
from pcii.evaluation.tables import SWEEPS, markdown

if TYPE_CHECKING:
    from pandas import DataFrame

MEASURE = "bad_1px"


def table() -> Iterator[str]:
    """Make and score what is missing, then tell all that is there, as Markdown."""
    methods = [name for name in methods_for(full_light=False) if estimator_of(name) is not None]
    yield from report(*evaluated("depth", methods))


def report(evaluation: Evaluation, entry_of: Mapping[str, Entry]) -> Iterator[str]:
    """The tables of an evaluation, line by line; `entry_of` tells which scene a recipe is."""
    yield f"depth, {evaluation.frame['identity'].nunique()} datasets: share of errors above 1 px, and"
    yield "its ratio to that of the best plane sweep"
    own = scene_means(evaluation, entry_of, MEASURE)
    sweeps = (
        own[own["method"].isin(list(map(depth_name, SWEEPS)))]
        .groupby(["scene", "light"], observed=True)["mean"]
        .min()
    )

    def words(rows: "DataFrame") -> str:
        """Mean of the errors, and its ratio to the mean of the better sweeps where all scenes have them."""
        simple = sweeps.reindex(list(zip(rows["scene"], rows["light"], strict=True)))
        mean = rows["mean"].mean()
        if simple.isna().any() or not simple.sum():
            return f"{mean:.3f}"
        return f"{mean:.3f} ({mean / simple.mean():.2f})"

    by_scene = table_by_light("Errors above 1 px by scene", own, ["half", "kind", "name", "method"], words)
    for shown in (by_scene, by_half_and_kind("Mean errors of scenes of a kind", own, words)):
        yield f"\n{shown.title}\n\n{markdown(shown)}"
