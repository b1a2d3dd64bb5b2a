"""Charts: camera positions, probability over depth, bars of shares, reliability of confidence."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.figures.palette import COLOURS, plot_label
from pcii.figures.panels import GRID_COLOUR, write_in_middle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

LEAST_AREA, WHOLE_AREA = 4.0, 120.0
"""Area in square points of the marker of a bin that holds next to nothing, and what all pixels add."""
BAR = 0.8
"""Share of the place of a group of bars that they take."""
SHORT_DECADES = 2.5
"""Powers of ten of a logarithmic axis up to which there is room for ticks at 2 and 5 between them."""


def quiet_grid(axes: "Axes") -> None:
    """A thin grid, and no box."""
    axes.grid(True, color=GRID_COLOUR, linewidth=0.6, alpha=0.4)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def few_ticks(axis: "Axis") -> None:
    """Name whole powers of ten of a logarithmic axis, and if it is short 2 and 5 between them."""
    from matplotlib.ticker import LogLocator, NullLocator

    low, high = axis.get_view_interval()
    is_short = math.log10(high / low) < SHORT_DECADES
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if is_short else (1.0,)))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_locator(NullLocator())


def draw_cameras(axes: "Axes", x_mm: np.ndarray, y_mm: np.ndarray, title: str) -> None:
    """Cameras at all of `x_mm` (L,), right, and `y_mm` (K,), down, in mm, with both baselines."""
    x, y = np.meshgrid(x_mm, y_mm)
    axes.scatter(x, y, s=max(4.0, 40.0 - 2 * max(x.shape)), color=COLOURS[0], label="cameras")
    axes.scatter([0], [0], marker="+", s=90, color=COLOURS[1], label="virtual centre", zorder=3)
    top, left = float(y_mm.min()), float(x_mm.min())
    span = float(max(np.ptp(x_mm), np.ptp(y_mm))) or 1.0
    gap = 0.08 * span
    arrow = {"arrowstyle": "<->", "color": GRID_COLOUR}
    if x_mm.size > 1:
        axes.annotate("", (left, top - gap), (float(x_mm.max()), top - gap), arrowprops=arrow)
        axes.text(0, top - 1.2 * gap, f"baseline {np.ptp(x_mm):.4g} mm", ha="center", va="bottom")
    if y_mm.size > 1:
        axes.annotate("", (left - gap, top), (left - gap, float(y_mm.max())), arrowprops=arrow)
        baseline = f"baseline {np.ptp(y_mm):.4g} mm"
        axes.text(left - 1.2 * gap, 0, baseline, rotation=90, ha="right", va="center")
    axes.set_aspect("equal")
    axes.set_xlim(-0.8 * span, 0.65 * span)
    axes.set_ylim(0.65 * span, -0.8 * span)
    axes.set_xlabel("X, right (mm)")
    axes.set_ylabel("Y, down (mm)")
    axes.set_title(title)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, frameon=False, fontsize="small")
    quiet_grid(axes)


def draw_depth_probability(axes: "Axes", z_mm: np.ndarray, probability: np.ndarray, title: str) -> None:
    """Probability (Z,) of a surface at each depth in mm."""
    axes.fill_between(z_mm, probability, color=COLOURS[0], alpha=0.3, linewidth=0)
    marker = "o" if z_mm.size <= 40 else None
    axes.plot(z_mm, probability, color=COLOURS[0], linewidth=1.4, marker=marker, markersize=3)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("depth z (mm)")
    axes.set_ylabel("probability of a surface")
    axes.set_title(title)
    quiet_grid(axes)


def draw_bars(
    axes: "Axes",
    groups: Sequence[str],
    bars: Mapping[str, Sequence[float | None]],
    limits: Sequence[float | None],
    label: str,
) -> None:
    """Shares as horizontal bars: for each of `bars` one value in each group, None for none.

    `limits` has what could be reached in each group at most, drawn as a line across it; None for none.
    """
    named: dict[str, Any] = {}
    thickness = BAR / max(1, len(bars))
    for number, (name, shares) in enumerate(bars.items()):
        for group, share in enumerate(shares):
            if share is not None:
                place = group + (number + 0.5) * thickness - BAR / 2
                colour = COLOURS[number % len(COLOURS[:-1])]
                named[plot_label(name)] = axes.barh(place, share, 0.92 * thickness, color=colour)
                axes.text(share + 0.01, place, f"{share:.2f}", va="center", fontsize="small")
    for group, most in enumerate(limits):
        if most is not None:
            ends = [group - BAR / 2, group + BAR / 2]
            (line,) = axes.plot([most, most], ends, color=GRID_COLOUR, linewidth=2)
            named["best by true depth"] = line
    axes.set_yticks(range(len(groups)), [plot_label(name) for name in groups])
    axes.set_ylim(max(1, len(groups)) - 0.5, -0.5)
    axes.set_xlim(0, 1.12)
    axes.set_xticks(np.linspace(0, 1, 6))
    axes.set_xlabel(label)
    if len(named) > 1:
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2), "ncols": 1}
        axes.legend(list(named.values()), list(named), frameon=False, fontsize="small", **place)
    quiet_grid(axes)
    if not groups:
        write_in_middle(axes, "nothing is scored")


def draw_reliability_diagram(
    axes: "Axes",
    stated: Sequence[float],
    correct: Sequence[float],
    shares: Sequence[float],
    style: Mapping[str, Any],
) -> None:
    """Share of correct answers against stated confidence, bins with larger markers the more they hold.

    Confidence that is right lies on the diagonal (Naeini, Cooper and Hauskrecht 2015).
    """
    areas = [LEAST_AREA + WHOLE_AREA * share for share in shares]
    marks = {"color": style["color"], "marker": style["marker"], "alpha": 0.8, "linewidth": 0}
    axes.scatter(stated, correct, areas, clip_on=False, zorder=3, **marks)
    axes.plot(stated, correct, linewidth=1.0, color=style["color"], linestyle=style["linestyle"])


def draw_diagonal(axes: "Axes") -> None:
    """The line of confidence that is right, and a frame from 0 to 1."""
    axes.plot([0, 1], [0, 1], color=GRID_COLOUR, linewidth=0.8)
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-0.02, 1.02)
