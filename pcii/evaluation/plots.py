"""Plots of an evaluation: accuracy against photons per view and run time, and reliability of confidence."""

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pcii.evaluation.tables import light_name
from pcii.figures.charts import draw_diagonal, draw_reliability_diagram
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
    Full light is at no number of photons. Empty if none of them has the measure.
    """
    from matplotlib.ticker import LogLocator, NullLocator

    part, label = MEASURES[measure]
    has_measure = {row["method"] for row in group["results"] if row.get(part, {}).get(measure)}
    if has_measure.isdisjoint(methods):
        return ""
    figure = new_figure(10.5, 3.9, "constrained")
    by_photons, by_seconds = figure.subplots(1, 2, sharey=True)
    for number, method in enumerate(methods):
        rows = [row for row in group["results"] if row["method"] == method and row[part].get(measure)]
        style = _style(number) | {"markersize": 5, "linewidth": 1.4, "capsize": 2.5}
        lit = [row for row in rows if row["photons_per_view"] is not None]
        timed = [row for row in rows if row["seconds"] is not None]
        for axes, own, places in (
            (by_photons, lit, [row["photons_per_view"] for row in lit]),
            (by_seconds, timed, [row["seconds"]["mean"] for row in timed]),
        ):
            if own:
                means = [row[part][measure] for row in own]
                heights = [mean["mean"] for mean in means]
                axes.errorbar(places, heights, yerr=_bars(means), label=plot_label(method), **style)
    photons = [row["photons_per_view"] for row in group["results"] if row["photons_per_view"] is not None]
    for axes, name in ((by_photons, "photons per view"), (by_seconds, "seconds per dataset")):
        axes.set_xlabel(name)
        _frame(axes, is_share=measure not in NO_SHARES)
        if axes is by_seconds or (photons and min(photons) > 0):
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.xaxis.set_minor_locator(NullLocator())
    by_photons.set_ylabel(label)
    # By name, since methods of full light alone are in one of the two.
    handles = {
        name: line
        for axes in (by_seconds, by_photons)
        for line, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    by_photons.legend([handles[name] for name in sorted(handles)], sorted(handles), frameon=False, fontsize=9)
    return _data_uri(figure)


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
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(True, color="#d9dde5", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


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
