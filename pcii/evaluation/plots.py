"""Plots of an evaluation: accuracy against photons per view and run time, and reliability of confidence."""

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pcii.evaluation.tables import light_name
from pcii.figures.charts import draw_diagonal, draw_reliability_diagram, few_ticks, quiet_grid
from pcii.figures.palette import COLOURS, MARKERS, plot_label
from pcii.figures.panels import new_figure
from pcii.figures.pictures import uri_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURES = {
    "iou": ("object", "IoU, mean over planes"),
    "bad_1px": ("depth", "share of errors of depth above 1 px"),
    "median_px": ("depth", "median error of depth, px of total disparity"),
}
"""What accuracy is drawn by: the part of the results that has it, and the label of its axis."""
NO_SHARES = {"median_px"}
"""Those that are no shares from 0 to 1; their axes are logarithmic."""
PANELS = 4
"""Panels of the calibration plots, side by side."""


def accuracy_plots(group: Mapping[str, Any], methods: Sequence[str], measure: str = "iou") -> str:
    """One of `MEASURES` against photons per view, and against seconds, as a PNG in a data URI.

    Each of `methods` has its colour and marker in all groups, also in those without it; bars are intervals.
    Full light is at no number of photons. Empty if none of them has the measure, or neither is known.
    """
    part, label = MEASURES[measure]
    has_measure = {row["method"] for row in group["results"] if row.get(part, {}).get(measure)}
    if has_measure.isdisjoint(methods):
        return ""
    rows = [row for row in group["results"] if row.get(part, {}).get(measure) and row["method"] in methods]
    wanted = (("photons per view", _photons), ("seconds per dataset", _seconds))
    shown = [(name, place) for name, place in wanted if any(place(row) is not None for row in rows)]
    if not shown:
        return ""
    figure = new_figure(0.3 + 5.1 * len(shown), 4.2, "constrained")
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    handles: dict[str, Any] = {}  # by name, since methods of full light alone are in one of the two
    for axes, (name, place) in zip(panels, shown, strict=True):
        for number, method in enumerate(methods):
            own = [row for row in rows if row["method"] == method and place(row) is not None]
            if not own:
                continue
            means = [row[part][measure] for row in own]
            style = _style(number) | {"markersize": 5, "linewidth": 1.4, "capsize": 2.5}
            places, heights = [place(row) for row in own], [mean["mean"] for mean in means]
            line = axes.errorbar(places, heights, yerr=_bars(means), **style)
            handles.setdefault(plot_label(method), line)
        axes.set_xlabel(name)
        _frame(axes, is_share=measure not in NO_SHARES)
        if all(found > 0 for row in rows if (found := place(row)) is not None):
            axes.set_xscale("log")
            few_ticks(axes.xaxis)
    panels[0].set_ylabel(label)
    names = sorted(handles)
    lines = [handles[name] for name in names]
    figure.legend(lines, names, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return _data_uri(figure)


def _photons(row: Mapping[str, Any]) -> float | None:
    return row["photons_per_view"]


def _seconds(row: Mapping[str, Any]) -> float | None:
    return None if row["seconds"] is None else row["seconds"]["mean"]


def calibration_plots(group: Mapping[str, Any], methods: Sequence[str]) -> str:
    """Share of correct depths against their stated confidence, as a PNG in a data URI.

    `group` holds the results of the datasets of one recipe; each photon budget has a panel, a reliability
    diagram (Naeini, Cooper and Hauskrecht 2015). Confidence that is right lies on the diagonal, too much
    confidence below it. The area of a marker grows with its bin's share of the pixels. Empty if no method
    of `methods` answers anything.
    """
    from matplotlib.lines import Line2D

    found = [row for row in group["results"] if row["method"] in methods and row["depth"].get("reliability")]
    budgets = list(dict.fromkeys(row["budget"] for row in found))
    if not budgets:
        return ""
    columns = min(PANELS, len(budgets))
    lines = -(-len(budgets) // columns)
    figure = new_figure(0.7 + 2.45 * columns, 0.7 + 2.6 * lines, "constrained")
    panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    for budget, axes in zip(budgets, panels.flat, strict=False):
        draw_diagonal(axes)
        for row in found:
            if row["budget"] == budget:
                _draw_bins(axes, row["depth"]["reliability"], _style(methods.index(row["method"])))
        axes.set_title(light_name(budget), fontsize=9)
        _frame(axes)
    for axes in panels.flat[len(budgets) :]:
        axes.set_axis_off()
    for axes in panels[-1]:
        axes.set_xlabel("confidence")
    for axes in panels[:, 0]:
        axes.set_ylabel("share within 1 px")
    shown = [method for method in methods if any(row["method"] == method for row in found)]
    handles = [Line2D([], [], markersize=5, **_style(methods.index(method))) for method in shown]
    names = [plot_label(method) for method in shown]
    figure.legend(handles, names, loc="outside lower center", ncols=columns, frameon=False, fontsize=9)
    return _data_uri(figure)


def _draw_bins(axes: "Axes", reliability: Mapping[str, Any], style: Mapping[str, Any]) -> None:
    """Draw the bins that have pixels."""
    bins = [one for one in reliability.values() if one["confidence"] is not None]
    stated, correct, shares = (
        [one[name]["mean"] for one in bins] for name in ("confidence", "correct", "share")
    )
    draw_reliability_diagram(axes, stated, correct, shares, style)


def _style(number: int) -> dict[str, Any]:
    """Colour, marker and line of a method by its number."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[number % len(MARKERS)],
        "linestyle": "-" if number < len(COLOURS) else "--",
    }


def _frame(axes: "Axes", *, is_share: bool = True) -> None:
    """A vertical axis of shares or of logarithms, and a grid without a box."""
    if is_share:
        axes.set_ylim(-0.02, 1.02)
    else:
        axes.set_yscale("log")
        few_ticks(axes.yaxis)
    quiet_grid(axes)


def _data_uri(figure: "Figure") -> str:
    stored = io.BytesIO()
    figure.savefig(stored, format="png")
    return uri_of("png", stored.getvalue())


def _bars(means: Sequence[Mapping[str, Any]]) -> list[list[float]]:
    """How far each interval reaches below and above its mean, (2, N); 0 where there is none."""
    ends = [mean["interval"] or (mean["mean"], mean["mean"]) for mean in means]
    below = [max(0.0, mean["mean"] - low) for mean, (low, _) in zip(means, ends, strict=True)]
    above = [max(0.0, high - mean["mean"]) for mean, (_, high) in zip(means, ends, strict=True)]
    return [below, above]
