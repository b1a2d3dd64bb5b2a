"""Plots of an evaluation: IoU against photons per view, and against run time."""

import base64
import io
from collections.abc import Mapping, Sequence
from typing import Any

from pcii.base.plain_text import visible

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""The palette of Okabe and Ito, which the colour-blind can distinguish."""
MARKERS = "osD^vPX"
LONGEST_NAME = 40
"""Characters of a method's name in the legend, about a third of the plot's width."""


def accuracy_plots(group: Mapping[str, Any], methods: Sequence[str]) -> str:
    """Object IoU against photons per view, and against seconds, as a PNG in a data URI.

    Each of `methods` has its colour and marker in all groups, also in those without it; bars are intervals.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullLocator

    figure = Figure(figsize=(10.5, 3.9), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    by_photons, by_seconds = figure.subplots(1, 2, sharey=True)
    for number, method in enumerate(methods):
        rows = [row for row in group["results"] if row["method"] == method and row["object"].get("iou")]
        if not rows:
            continue
        style = {
            "color": COLOURS[number % len(COLOURS)],
            "marker": MARKERS[number % len(MARKERS)],
            "linestyle": "-" if number < len(COLOURS) else "--",
            "markersize": 5,
            "linewidth": 1.4,
            "capsize": 2.5,
        }
        iou = [row["object"]["iou"]["mean"] for row in rows]
        bars = _bars([row["object"]["iou"] for row in rows])
        by_photons.errorbar(
            [row["photons_per_view"] for row in rows], iou, yerr=bars, label=_legend(method), **style
        )
        seconds = [row["seconds"]["mean"] for row in rows]
        by_seconds.errorbar(seconds, iou, yerr=bars, **style)
    for axes, name in ((by_photons, "photons per view"), (by_seconds, "seconds per dataset")):
        axes.set_xlabel(name)
        axes.set_ylim(-0.02, 1.02)
        axes.grid(True, color="#d9dde5", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        if name != "photons per view" or all(row["photons_per_view"] > 0 for row in group["results"]):
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.xaxis.set_minor_locator(NullLocator())
    by_photons.set_ylabel("IoU, mean over planes")
    if by_photons.get_legend_handles_labels()[0]:
        by_photons.legend(frameon=False, fontsize=9)
    stored = io.BytesIO()
    figure.savefig(stored, format="png")
    return f"data:image/png;base64,{base64.b64encode(stored.getvalue()).decode()}"


def _legend(method: str) -> str:
    """A method's name, cut to `LONGEST_NAME` and escaped so that Matplotlib shows it literally."""
    name = visible(method)
    name = name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"
    return name.lstrip("_").replace("$", r"\$")


def _bars(means: Sequence[Mapping[str, Any]]) -> list[list[float]]:
    """How far each interval reaches below and above its mean, (2, N); 0 where there is none."""
    ends = [mean["interval"] or (mean["mean"], mean["mean"]) for mean in means]
    below = [max(0.0, mean["mean"] - low) for mean, (low, _) in zip(means, ends, strict=True)]
    above = [max(0.0, high - mean["mean"]) for mean, (_, high) in zip(means, ends, strict=True)]
    return [below, above]
