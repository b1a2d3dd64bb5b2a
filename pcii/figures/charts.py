"""Figures and axes to draw in, figures as files, and charts of scores, drawn of data frames."""

import io
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from pcii.base import InputError, visible
from pcii.figures.pictures import uri_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    MaybeAxes: TypeAlias = Axes | Sequence[Axes] | np.ndarray | None

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""The palette of Okabe and Ito, which the colour-blind can distinguish."""
MARKERS = "osD^vPXh"
"""One more than colours, so that no two methods of many share both."""
GRID_COLOUR = "#8a94a6"
"""Of lines behind what is drawn: seen on light and on dark pages."""
MAX_PANELS = 12
"""Of more panels as many are drawn, evenly chosen: more cannot be read."""
COLUMNS = 4
"""Panels side by side."""
PANEL_IN = 3.4
"""Longer side of a panel of a new figure in inches."""
LABELS_IN = 0.9
"""Room for the labels of a panel in inches."""
DOTS_PER_INCH = 110
MAX_NAME_LENGTH = 40
"""Characters of a name, about a third of a plot's width."""
PLACES = {"photons_per_view": "photons per view", "seconds": "seconds per dataset"}
"""What accuracy is drawn against."""
SHORT_AXIS = 200.0
"""A logarithmic axis whose ends have a smaller ratio has more than one number a decade."""
MIN_AREA, WHOLE_AREA = 4.0, 120.0
"""Area in square points of the marker of a bin that holds next to nothing, and what all pixels add."""


def plot_label(name: str) -> str:
    """A name as text for Matplotlib: at most `MAX_NAME_LENGTH` characters, none read as mathematics.

    >>> print(plot_label("_a$b"))
    a\\$b
    """
    name = visible(name)
    name = name if len(name) <= MAX_NAME_LENGTH else f"{name[: MAX_NAME_LENGTH - 1]}…"
    return name.lstrip("_").replace("$", r"\$")


def in_style(style: str) -> AbstractContextManager[None]:
    """What is drawn meanwhile is for the screen, in Matplotlib's style in use, or for "paper": on white.

    Raises `InputError` for another style.
    """
    from matplotlib.style import context

    if style not in ("screen", "paper"):
        raise InputError(f"style: expected 'screen' or 'paper', got {style!r}")
    return context("default" if style == "paper" else {})


def several_axes(axes: "MaybeAxes", count: int, shape: Sequence[float] = (3.0, 4.0)) -> np.ndarray:
    """The `count` axes (N,) of panels of the proportions `shape`, (height, width): those of `axes`, or new.

    One panel's axes need no list. Raises `InputError` if the number of axes is not `count`, and for anything
    that is no Matplotlib axes.
    """
    from matplotlib import pyplot
    from matplotlib.axes import Axes

    if axes is not None:
        panels = np.asarray(axes, dtype=object).ravel()
        if len(panels) != count or not all(isinstance(panel, Axes) for panel in panels):
            raise InputError(f"axes: expected Matplotlib axes of {count} panels, got {axes!r:.80}")
        return panels
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    height, width = (PANEL_IN * side / max(shape) for side in shape)
    size = columns * (max(width, PANEL_IN / 2) + LABELS_IN), rows * (max(height, PANEL_IN / 3) + LABELS_IN)
    figure, grid = pyplot.subplots(rows, columns, squeeze=False, figsize=size, layout="compressed")
    for spare in grid.flat[count:]:
        figure.delaxes(spare)
    return grid.ravel()[:count]


def new_figure(width_in: float, height_in: float, layout: Literal["compressed", "constrained"]) -> "Figure":
    """An empty figure that needs no display and no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def figure_bytes(figure: "Figure", dots_per_inch: float | Literal["figure"] = "figure") -> bytes:
    """A figure as PNG, by default with the dots per inch that it was made for."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch)
    return buffer.getvalue()


def figure_uri(figure: "Figure") -> str:
    """A figure as a data URI of a PNG for HTML."""
    return uri_of("png", figure_bytes(figure))


def colour_bar_uri(colours: str, limits: tuple[float, float], label: str) -> str:
    """A colour bar with ticks, alone and lying, as a data URI for HTML."""
    figure = new_figure(3.8, 0.62, "constrained")
    scale, bar = colour_scale(colours, limits), figure.subplots()
    figure.colorbar(scale, cax=bar, orientation="horizontal", label=label)
    return figure_uri(figure)


def colour_scale(colours: str, limits: tuple[float, float]) -> "ScalarMappable":
    """What a colour bar of a map between two limits shows."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(*limits), colours)


def hide_frame(axes: "Axes") -> None:
    """No ticks, no labels and no lines around a picture."""
    axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
    axes.spines[:].set_visible(False)


def quiet_grid(axes: "Axes") -> None:
    """A thin grid, and no box."""
    axes.grid(True, color=GRID_COLOUR, linewidth=0.6, alpha=0.4)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def accuracy_chart(
    means: "pd.DataFrame", methods: Sequence[str], label: str, *, is_share: bool
) -> "Figure | None":
    """A figure of `draw_accuracy`; None if neither photons nor seconds are known."""
    count = len(_known_places(means))
    if not count:
        return None
    figure = new_figure(0.3 + 5.1 * count, 4.2, "constrained")
    panels = figure.subplots(1, count, sharey=True, squeeze=False)
    draw_accuracy(panels, means, methods, label, is_share=is_share)
    return figure


def _known_places(means: "pd.DataFrame") -> list[str]:
    """Which of `PLACES` is known of any mean."""
    return [place for place in PLACES if means[place].notna().any()]


def draw_accuracy(
    axes: "MaybeAxes", means: "pd.DataFrame", methods: Sequence[str], label: str, *, is_share: bool
) -> np.ndarray:
    """Draw a measure of accuracy against photons per view and seconds, as far as they are known.

    `means` has a row for each method and light: `method`, `photons_per_view`, `seconds`, `mean`, the ends of
    its interval, `low` and `high`, and `n`, of how many scenes it is. Each of `methods` has one colour and
    marker in all charts. Means of fewer scenes than others of the method are hollow, and no line joins them
    to those: the difference may be that of the scenes. What is no share from 0 to 1 has a logarithmic axis.
    Full light is at no number of photons. Returns the axes (N,), those of one figure or new ones; none if
    neither photons nor seconds are known.
    """
    if not (places := _known_places(means)):
        return np.array([], dtype=object)
    panels = several_axes(axes, len(places))
    handles: dict[str, Any] = {}  # by name, since methods of full light alone are in one of the panels
    for panel, place in zip(panels, places, strict=True):
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
                handle = panel.errorbar(part[place], part["mean"], yerr=bars, **style, **face)
                if is_whole:
                    handles[plot_label(method)] = handle
                has_fewer |= not is_whole
        panel.set_xlabel(PLACES[place] + (" (hollow: fewer scenes)" if has_fewer else ""))
        if is_share:
            panel.set_ylim(min(-0.02, rows["low"].min()), 1.02)
        else:
            panel.set_yscale("log")
            _write_plain_numbers(panel.yaxis)
        quiet_grid(panel)
        if (rows[place] > 0).all():
            panel.set_xscale("log")
            _write_plain_numbers(panel.xaxis)
    panels[0].set_ylabel(label)
    figure = panels[0].get_figure(root=True)
    _add_legend(figure, {name: handles[name] for name in sorted(handles)}, 2 * len(panels))
    return panels


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
