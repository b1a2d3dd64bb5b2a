"""One figure for each study, readable in print: values with their intervals against time or size."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.results import Measured, Parameter, Row, Study, Value, label
from pcii.figures.charts import COLOURS, MARKERS, quiet_grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 160
Quantity = str | Callable[[Row], Value | Parameter]


def draw(study: Study, measured: Measured, path: Path) -> None:
    """Write the study's figure as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(study.width_in, study.height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    study.draw(figure, measured)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def curve(axes: "Axes", rows: Sequence[Row], x: Quantity, y: Quantity, name: str, number: int) -> None:
    """Draw a line through rows, with intervals as bars; `number` chooses its colour and marker.

    `x` and `y` name a value or a parameter, or give it. Rows that lack one are left out.
    """
    points = [(_value(row, x), _value(row, y)) for row in rows]
    known = [(one, other) for one, other in points if one is not None and other is not None]
    if not known:
        return
    across, up = zip(*known, strict=True)
    axes.errorbar(
        [value.value for value in across],
        [value.value for value in up],
        xerr=_bars(across),
        yerr=_bars(up),
        label=name or None,
        color=COLOURS[number % len(COLOURS)],
        marker=MARKERS[number % len(MARKERS)],
        markerfacecolor="white" if number >= len(COLOURS) else None,
        linestyle=("-", "--", ":")[number // len(COLOURS) % 3],
        markersize=4,
        linewidth=1.2,
        capsize=2,
    )


def bars(
    axes: "Axes", names: Sequence[str], values: Sequence[Value], unit: str, *, log: bool = False
) -> None:
    """Draw horizontal bars with intervals, the first on top; with `log` on a logarithmic axis."""
    places = range(len(names))
    colour = {"color": COLOURS[5], "ecolor": "#1d2330", "capsize": 2}
    axes.barh(places, [value.value for value in values], xerr=_bars(values), **colour)
    axes.set_yticks(places, names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel(unit, fontsize=9)
    if log:
        axes.set_xscale("log")
    _plain(axes)


def frame(axes: "Axes", x: str, y: str, title: str = "", *, log: str = "xy") -> None:
    """Name the axes by quantities, make those of `log` logarithmic, draw a grid and a legend."""
    axes.set_xlabel(label(x), fontsize=9)
    axes.set_ylabel(label(y), fontsize=9)
    axes.set_title(title, fontsize=10)
    if "x" in log:
        axes.set_xscale("log")
    if "y" in log:
        axes.set_yscale("log")
    _plain(axes)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=7.5)


def _plain(axes: "Axes") -> None:
    quiet_grid(axes)
    axes.tick_params(labelsize=8)


def _value(row: Row, quantity: Quantity) -> Value | None:
    value: Any = (
        quantity(row) if callable(quantity) else row.values.get(quantity, row.parameters.get(quantity))
    )
    return value if isinstance(value, Value) or value is None else Value(float(value))


def _bars(values: Sequence[Value]) -> list[list[float]]:
    """How far intervals reach below and above; 0 where there is none."""
    below = [0.0 if value.low is None else max(0.0, value.value - value.low) for value in values]
    above = [0.0 if value.high is None else max(0.0, value.high - value.value) for value in values]
    return [below, above]
