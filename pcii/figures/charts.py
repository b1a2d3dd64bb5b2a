"""Charts of scores: accuracy against photons and seconds, reliability of confidence.

They are drawn of data frames, a row for each mean or bin.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.figures.panels import COLOURS, GRID_COLOUR, MARKERS, new_figure, plot_label

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

PLACES = {"photons_per_view": "photons per view", "seconds": "seconds per dataset"}
"""What accuracy is drawn against."""
SHORT_AXIS = 200.0
"""A logarithmic axis whose ends have a smaller ratio has more than one number a decade."""
MIN_AREA, WHOLE_AREA = 4.0, 120.0
"""Area in square points of the marker of a bin that holds next to nothing, and what all pixels add."""
COLUMNS = 4
"""Panels of a calibration chart side by side."""


def quiet_grid(axes: "Axes") -> None:
    """A thin grid, and no box."""
    axes.grid(True, color=GRID_COLOUR, linewidth=0.6, alpha=0.4)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def accuracy_chart(
    means: "pd.DataFrame", methods: Sequence[str], label: str, *, is_share: bool
) -> "Figure | None":
    """A figure of `draw_accuracy`; None if neither photons nor seconds are known."""
    known = known_places(means)
    if not known:
        return None
    figure = new_figure(0.3 + 5.1 * len(known), 4.2, "constrained")
    panels = figure.subplots(1, len(known), sharey=True, squeeze=False)[0]
    draw_accuracy(panels, means, methods, label, is_share=is_share)
    return figure


def known_places(means: "pd.DataFrame") -> list[str]:
    """Which of `PLACES` is known of any mean."""
    return [place for place in PLACES if means[place].notna().any()]


def draw_accuracy(
    panels: np.ndarray, means: "pd.DataFrame", methods: Sequence[str], label: str, *, is_share: bool
) -> None:
    """Draw a measure of accuracy against photons per view and seconds, as far as they are known.

    `means` has a row for each method and light: `method`, `photons_per_view`, `seconds`, `mean`, the ends of
    its interval, `low` and `high`, and `n`, of how many scenes it is. Each of `methods` has one colour and
    marker in all charts. Means of fewer scenes than others of the method are hollow, and no line joins them
    to those: the difference may be that of the scenes. What is no share from 0 to 1 has a logarithmic axis.
    Full light is at no number of photons. `panels` are axes, one for each of `known_places`, of one figure.
    """
    handles: dict[str, Any] = {}  # by name, since methods of full light alone are in one of the panels
    for axes, place in zip(panels, known_places(means), strict=True):
        rows, has_fewer = means[means[place].notna()], False
        for number, method in enumerate(methods):
            of_method = rows[rows["method"] == method]
            style = _line_style(number) | {"markersize": 5, "linewidth": 1.4, "capsize": 2.5}
            if place == "seconds":  # they hardly follow the light, so that a line would go to and fro
                style["linestyle"] = "none"
            for n, part in of_method.groupby("n"):
                is_whole = n == of_method["n"].max()
                face = {} if is_whole else {"markerfacecolor": "none"}
                bars = np.maximum(0, [part["mean"] - part["low"], part["high"] - part["mean"]])
                handle = axes.errorbar(part[place], part["mean"], yerr=bars, **style, **face)
                if is_whole:
                    handles[plot_label(method)] = handle
                has_fewer |= not is_whole
        axes.set_xlabel(PLACES[place] + (" (hollow: fewer scenes)" if has_fewer else ""))
        if is_share:
            axes.set_ylim(min(-0.02, rows["low"].min()), 1.02)
        else:
            axes.set_yscale("log")
            _write_plain_numbers(axes.yaxis)
        quiet_grid(axes)
        if (rows[place] > 0).all():
            axes.set_xscale("log")
            _write_plain_numbers(axes.xaxis)
    panels[0].set_ylabel(label)
    figure = panels[0].get_figure(root=True)
    _add_legend(figure, {name: handles[name] for name in sorted(handles)}, 2 * len(panels))


def _write_plain_numbers(axis: "Axis") -> None:
    """Plain numbers along a logarithmic axis: at 1, 2 and 5 of each decade where it is short, else at 1."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    low, high = axis.get_view_interval()
    steps = (1.0, 2.0, 5.0) if high < SHORT_AXIS * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(StrMethodFormatter("{x:.10g}"))
    axis.set_minor_formatter(NullFormatter())


def calibration_chart(bins: "pd.DataFrame", methods: Sequence[str]) -> "Figure":
    """Share of correct depths against their stated confidence, a reliability diagram for each light.

    `bins` has a row for each bin of confidence that has pixels: `method`, `light`, `confidence`, `correct`,
    and its `share` of the pixels, by which markers are larger. Confidence that is right lies on the diagonal,
    too much of it below (Naeini, Cooper and Hauskrecht 2015). Methods have the colours of `accuracy_chart`.
    """
    from matplotlib.lines import Line2D

    lights = list(dict.fromkeys(bins["light"]))
    columns = min(COLUMNS, len(lights))
    lines = -(-len(lights) // columns)
    figure = new_figure(0.7 + 2.45 * columns, 0.7 + 2.6 * lines, "constrained")
    panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    for light, axes in zip(lights, panels.flat, strict=False):
        for method, of_method in bins[bins["light"] == light].groupby("method", sort=False):
            style = _line_style(methods.index(str(method)))
            stated, correct = of_method["confidence"], of_method["correct"]
            marks = {"color": style["color"], "marker": style["marker"], "alpha": 0.8, "linewidth": 0}
            areas = MIN_AREA + WHOLE_AREA * of_method["share"]
            axes.scatter(stated, correct, areas, clip_on=False, zorder=3, **marks)
            axes.plot(stated, correct, linewidth=1.0, color=style["color"], linestyle=style["linestyle"])
        axes.plot([0, 1], [0, 1], color=GRID_COLOUR, linewidth=0.8)
        axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        axes.set(xlabel="stated confidence", ylabel="share within 1 px")
        quiet_grid(axes)
        axes.set_title(light, fontsize=9)
        axes.label_outer()
    for axes in panels.flat[len(lights) :]:
        axes.set_axis_off()
    present = set(bins["method"])
    handles = {
        plot_label(method): Line2D([], [], markersize=5, **_line_style(number))
        for number, method in enumerate(methods)
        if method in present
    }
    _add_legend(figure, handles, columns)
    return figure


def _line_style(number: int) -> dict[str, Any]:
    """Colour, marker and line of a method by its number."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[number % len(MARKERS)],
        "linestyle": "-" if number < len(COLOURS) else "--",
    }


def _add_legend(figure: "Figure", handles: Mapping[str, Any], columns: int) -> None:
    """Names below all panels."""
    place = {"loc": "outside lower center", "ncols": columns}
    figure.legend([*handles.values()], [*handles], frameon=False, fontsize=9, **place)
