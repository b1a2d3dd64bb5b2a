"""Panels of a score: IoU of masks by plane and method, shares of depths, reliability of confidence."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.figures.charts import draw_bars, draw_diagonal, draw_reliability_diagram, quiet_grid
from pcii.figures.palette import COLOURS, MARKERS
from pcii.figures.panels import several_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEPTH_BARS = {
    "coverage": "answered",
    "bad_1px": "off by > 1 px",
    "bad_3px": "off by > 3 px",
    "ece": "calibration error",
}
"""Shares of a depth map that are drawn, and what they are called."""

Row = Mapping[str, Any]


def draw_score(
    axes: "Axes | Sequence[Axes] | np.ndarray | None", planes: Sequence[Row], bounds: Row, depth: Row
) -> np.ndarray:
    """Draw the panels of which a score has numbers, as `score.json` spells them; the axes (N,) of the panels.

    A score without any has one panel that says so.
    """
    masks = [
        (row, bound.get("iou_oracle"))
        for row, bound in zip(planes, bounds.get("planes") or [{}] * len(planes), strict=True)
        if row["truth"] == "object" and row.get("iou") is not None
    ]
    shares = {name: depth[key] for key, name in DEPTH_BARS.items() if depth.get(key) is not None}
    bins = [one for one in (depth.get("reliability") or {}).values() if one["confidence"] is not None]
    count = max(1, sum(map(bool, (masks, shares, bins))))
    panels = several_axes(axes, count)
    left = iter(panels)
    if masks or not (shares or bins):
        _draw_masks(next(left), masks)
    if shares:
        panel = next(left)
        draw_bars(panel, list(shares), {"depth": list(shares.values())}, [], "share of pixels")
        median = depth.get("median_mm")
        panel.set_title(
            "depth" if median is None else f"depth: median error {median:.3g} mm", fontsize="medium"
        )
    if bins:
        panel = next(left)
        draw_diagonal(panel)
        stated, correct, held = ([one[name] for one in bins] for name in ("confidence", "correct", "share"))
        style = {"color": COLOURS[0], "marker": MARKERS[0], "linestyle": "-"}
        draw_reliability_diagram(panel, stated, correct, held, style)
        panel.set_xlabel("stated confidence")
        panel.set_ylabel("share within 1 px")
        panel.set_title("confidence: right on the diagonal")
        quiet_grid(panel)
    return panels


def _draw_masks(axes: "Axes", masks: Sequence[tuple[Row, float | None]]) -> None:
    """IoU of the objects in each plane, a bar for each method."""
    groups: dict[float, str] = {}
    limits: dict[float, float | None] = {}
    bars: dict[str, dict[float, float]] = {}
    for row, bound in masks:
        z_mm = row["z_mm"]
        groups[z_mm] = f"{z_mm:g} mm: {row['object']}" if row["object"] else f"{z_mm:g} mm"
        limits[z_mm] = bound
        bars.setdefault(row["method"], {})[z_mm] = row["iou"]
    by_method = {name: [values.get(z) for z in groups] for name, values in bars.items()}
    draw_bars(
        axes, list(groups.values()), by_method, list(limits.values()), "IoU with the objects of the plane"
    )
    axes.set_title("in-focus masks")
