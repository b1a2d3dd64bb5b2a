"""Figures and axes to draw in, colour bars, and figures as files."""

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from pcii.base import InputError, visible
from pcii.figures.pictures import uri_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
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
PANEL_IN = 3.4
"""Longer side of a panel of a new figure in inches."""
LABELS_IN = 0.9
"""Room for the labels of a panel in inches."""
DOTS_PER_INCH = 110
MAX_NAME_LENGTH = 40
"""Characters of a name, about a third of a plot's width."""


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
    figure.colorbar(
        colour_scale(colours, limits), cax=figure.subplots(), orientation="horizontal", label=label
    )
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
