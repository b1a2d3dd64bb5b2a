"""Axes to draw in, given or new, and pictures over the pixels of a view."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from pcii.base.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

MOST_PANELS = 12
"""Of more panels as many are drawn, evenly chosen: more cannot be read."""
COLUMNS = 4
PANEL_IN = 3.4
"""Longer side of a panel of a new figure in inches."""
DOTS_PER_INCH = 110
LABELS_IN = 0.9
"""Room for the labels of a panel in inches."""
GRID_COLOUR = "#8a94a6"
"""Of lines behind what is drawn: seen on light and on dark pages."""


def several_axes(
    axes: "Axes | Sequence[Axes] | np.ndarray | None",
    count: int,
    shape: Sequence[float] = (3.0, 4.0),
    widths: Sequence[float] | None = None,
) -> np.ndarray:
    """The `count` axes (N,) of panels of the proportions `shape`, (height, width): those given, or new ones.

    Of few panels, in one row, some may be so many times as wide: `widths` (N,). For one panel the axes may be
    given without a list. Raises `InputError` if the number of axes is not `count`, or if something given is
    no Matplotlib axes.
    """
    from matplotlib import pyplot
    from matplotlib.axes import Axes

    if axes is not None:
        given = [axes] if isinstance(axes, Axes) else list(np.asarray(axes, dtype=object).ravel())
        wrong = [one for one in given if not isinstance(one, Axes)]
        if wrong:
            raise InputError(f"axes: expected Matplotlib axes, got {type(wrong[0]).__name__}")
        if len(given) != count:
            raise InputError(f"axes: {count} panels are drawn, and {len(given)} axes were given")
        return _array_of(given)
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    ratios = [1.0] * columns if widths is None else list(widths)
    height, width = (PANEL_IN * side / max(shape) for side in shape)
    across = sum(ratios) * max(width, PANEL_IN / 2) + columns * LABELS_IN
    size = across, rows * (max(height, PANEL_IN / 3) + LABELS_IN)
    figure, grid = pyplot.subplots(
        rows, columns, squeeze=False, figsize=size, layout="compressed", width_ratios=ratios
    )
    for unused in grid.flat[count:]:
        figure.delaxes(unused)
    return _array_of(list(grid.flat[:count]))


def _array_of(axes: "Sequence[Axes]") -> np.ndarray:
    kept = np.empty(len(axes), dtype=object)
    kept[:] = axes
    return kept


def new_figure(
    width_in: float, height_in: float, layout: Literal["compressed", "constrained"] | None
) -> "Figure":
    """An empty figure that needs no display and no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def figure_of(axes: "Axes") -> "Figure | SubFigure":
    """The figure that axes are in."""
    figure = axes.get_figure()
    assert figure is not None
    return figure


def show_picture(
    axes: "Axes", image: np.ndarray, shape_HW: Sequence[int], title: str, block_px: float = 1.0
) -> None:
    """Draw an image (h, w, 3) of square blocks, `block_px` wide, over the pixels of a view.

    `shape_HW` is that of a view; blocks that reach over it are cut off.
    """
    height, width = shape_HW
    bottom, right = (block_px * size - 0.5 for size in image.shape[:2])
    axes.imshow(image, extent=(-0.5, right, bottom, -0.5))
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_xlabel("column (px)")
    axes.set_ylabel("row (px)")
    axes.set_title(title)
    axes.locator_params(integer=True, nbins=6)


def hide_frame(axes: "Axes") -> None:
    """No ticks, no labels and no lines around a picture."""
    axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
    axes.spines[:].set_visible(False)


def draw_outline(axes: "Axes", mask: np.ndarray, shape_HW: Sequence[int], colour: str) -> None:
    """Draw the outline of a mask (H, W) along the sides of its voxels, which may be finer than pixels."""
    from matplotlib.collections import LineCollection

    side = shape_HW[0] / mask.shape[0]
    padded = np.pad(mask, 1)
    rows, cols = np.nonzero(padded[1:, 1:-1] != padded[:-1, 1:-1])  # a line above voxel (row, col)
    lines = [np.stack([cols, rows, cols + 1, rows], axis=-1)]
    rows, cols = np.nonzero(padded[1:-1, 1:] != padded[1:-1, :-1])  # a line to the left of it
    lines.append(np.stack([cols, rows, cols, rows + 1], axis=-1))
    segments = np.concatenate(lines).reshape(-1, 2, 2) * side - 0.5
    axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=1.0), autolim=False)


def write_in_middle(axes: "Axes", text: str) -> None:
    """A sentence where there is nothing to draw."""
    box = {"boxstyle": "round", "facecolor": "white", "edgecolor": GRID_COLOUR}
    place = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.5, text, color="black", bbox=box, **place)
