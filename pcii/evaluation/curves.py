"""Curves of an evaluation: a measure against photons and time, and how far confidence is right."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.errors import InputError
from pcii.evaluation.summary import over_scenes
from pcii.evaluation.tables import light_name
from pcii.figures.charts import PLACES, accuracy_chart, calibration_chart, draw_accuracy, known_places
from pcii.figures.panels import figure_uri, in_style, several_axes

if TYPE_CHECKING:
    from pandas import DataFrame

AXES = {
    "iou": "IoU, mean over planes with objects",
    "pixel_iou": "IoU with the points in focus, mean over planes",
    "false_share": "share of the film claimed falsely",
    "within_1px": "share of depths within 1 px",
    "within_3px": "share of depths within 3 px",
    "quadratic_score": "quadratic score of confidence",
    "median_px": "median error of depth, px of total disparity",
}
"""Measures of accuracy that are drawn, with the labels of their axes."""
ERRORS = ("median_px",)
"""Of these, what is no share."""


def accuracy_plot(table: "DataFrame", methods: Sequence[str], measure: str) -> str:
    """One of `AXES` against photons per view, and against seconds, as a PNG in a data URI.

    `table` has means by method, light and measure. Empty if no method has the measure.
    """
    cells = _accuracies(table, measure)
    figure = accuracy_chart(cells, methods, AXES[measure], is_share=measure not in ERRORS)
    return "" if figure is None else figure_uri(figure)


def draw_evaluation(
    of_cells: "DataFrame", measure: str, axes: Any = None, *, style: str = "screen"
) -> np.ndarray:
    """Draw one of `AXES` against photons per view, and against seconds, into Matplotlib axes (N,).

    `of_cells` are means by scene, light and method. Without `axes` they are new ones. The style "paper", for
    print, has a white background whatever style is in use. Raises `InputError` for a measure or style that is
    not there, and for a measure of which nothing is known.
    """
    if measure not in AXES:
        raise InputError(f"measure: expected one of {', '.join(AXES)}, got {measure!r}")
    cells = _accuracies(over_scenes(of_cells), measure)
    if not (places := known_places(cells)):
        raise InputError(f"measure: no method has {measure!r}")
    methods = sorted(cells["method"].unique())
    with in_style(style):
        panels = several_axes(axes, len(places))
        draw_accuracy(panels, cells, methods, AXES[measure], is_share=measure not in ERRORS)
    return panels


def _accuracies(table: "DataFrame", measure: str) -> "DataFrame":
    """The means of a measure by method and light, beside those of photons per view and seconds."""
    cells = table[table["measure"] == measure].set_index(["method", "light"])[["n", "mean", "low", "high"]]
    cells = cells.assign(**{end: cells[end].fillna(cells["mean"]) for end in ("low", "high")})
    for name in PLACES:
        places = table[table["measure"] == name].set_index(["method", "light"])["mean"]
        cells[name] = places.reindex(cells.index)
    return cells.reset_index()


def calibration_plot(table: "DataFrame", methods: Sequence[str]) -> str:
    """Share of correct depths against their stated confidence, by light; empty if nothing is answered."""
    parts = table["measure"].str.extract(r"^(reliability\..*)\.(\w+)$")
    bins = table.assign(bin=parts[0], part=parts[1]).dropna(subset="bin")
    if bins.empty:
        return ""
    bins = bins.pivot(index=["method", "light", "bin"], columns="part", values="mean").reset_index()
    bins = bins.dropna(subset="confidence").sort_values(["light", "method"], kind="stable")
    return figure_uri(calibration_chart(bins.assign(light=bins["light"].map(light_name)), methods))
