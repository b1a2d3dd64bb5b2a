"""What each type shows of itself: `draw` is the `.plot()` of all, and `picture_html` their page in notebooks.

This room comes before the types, so a value is known by the name of its class. Each function hands what it
takes from a value to the drawing of plain arrays.
"""

import base64
import io
from collections.abc import Callable
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import in_html
from pcii.figures import plots
from pcii.figures.panels import Style

PICTURE_DOTS_PER_INCH = 60


def draw(value: Any, axes: Any = None, **options: Any) -> np.ndarray:
    """Draw a value into Matplotlib axes, by default new ones, and return them (N,)."""
    return DRAWINGS[type(value).__name__](value, axes, **options)


def picture_html(value: Any) -> str:
    """The line of a value and its drawing, in HTML; without a picture if its data cannot be read."""
    from matplotlib import pyplot

    line, png = f"<pre>{in_html(repr(value))}</pre>", io.BytesIO()
    try:
        figure = draw(value)[0].figure
    except (InputError, OSError):
        return line
    figure.savefig(png, format="png", dpi=PICTURE_DOTS_PER_INCH)
    pyplot.close(figure)
    return f'{line}<img src="data:image/png;base64,{base64.b64encode(png.getvalue()).decode()}">'


def draw_grid(grid: Any, axes: Any) -> np.ndarray:
    """Where the cameras stand, in mm, with both baselines."""
    return plots.plot_cameras(axes, grid.rows, grid.cols, grid.pitch_mm)


def draw_counts(counts: Any, axes: Any, view: Any = None) -> np.ndarray:
    """The photons of the camera `view`, (k, l), by default in the middle, or the "mean" of all."""
    if view == "mean":  # at its own exposure the sum looks like the mean
        return plots.plot_view(axes, counts.sum_of_views(), f"mean of all views, photons: {counts.total}")
    k, l = _camera(counts.grid, view)
    image = counts.view(k, l)
    return plots.plot_view(axes, image, f"view ({k}, {l}), photons: {image.sum()}")


def draw_views(views: Any, axes: Any, view: Any = None) -> np.ndarray:
    """The elemental image of the camera `view`, by default in the middle, in colours."""
    k, l = _camera(views.grid, view)
    return plots.plot_view(axes, views.in_colours(k, l), f"view ({k}, {l})")


def draw_sections(sections: Any, axes: Any, style: Style = "screen", **masks: Any) -> np.ndarray:
    """A panel for each section, 12 at most."""
    grid = sections.grid
    scale = grid.shape_HW, grid.pixel_mm / grid.focal_mm
    return plots.plot_sections(axes, sections.z_mm, sections.in_colours, *scale, style, **masks)


def draw_masks(focus: Any, axes: Any, style: Style = "screen") -> np.ndarray:
    """Each section after removal with the outline of its mask."""
    return draw_sections(focus.sections, axes, style, masks=focus.in_focus, method=focus.method)


def draw_depth(
    depth: Any, axes: Any, z_range_mm: tuple[float, float] | None = None, style: Style = "screen"
) -> np.ndarray:
    """Depth in mm with a scale from `z_range_mm`, (near, far), by default of all but outlying depths."""
    return plots.plot_depth(axes, depth.z_mm, depth.confidence, z_range_mm, style=style)


def draw_posterior(posterior: Any, axes: Any, pixel: Any = None) -> np.ndarray:
    """Entropy in bits everywhere, or the probability of each depth at a `pixel`, (row, column)."""
    planes, side_px = posterior.planes, posterior.block_px
    height, width = planes.grid.shape_HW
    if pixel is None:
        return plots.plot_entropy(axes, posterior.entropy_bits(), len(planes), (height, width), side_px)
    is_pair = isinstance(pixel, tuple | list) and list(map(type, pixel)) == [int, int]
    if not is_pair or pixel[0] not in range(height) or pixel[1] not in range(width):
        raise InputError(f"pixel: expected (row, column) in a view of {height} x {width}, got {pixel!r}")
    place = pixel[0] // side_px, pixel[1] // side_px
    probability, no_surface = posterior.probability[:, *place], posterior.no_surface[place]
    return plots.plot_probability(axes, planes.z_mm, probability, no_surface, tuple(pixel))


def draw_truth(truth: Any, axes: Any, z_range_mm: tuple[float, float] | None = None) -> np.ndarray:
    """Depth of the objects, and the objects with their names."""
    return plots.plot_truth(axes, truth.object_z_mm, truth.object_id, truth.names, z_range_mm)


def _camera(grid: Any, view: Any) -> tuple[Any, Any]:
    if view is None:
        return grid.middle_camera
    if not isinstance(view, tuple | list) or len(view) != 2:
        raise InputError(f"view: expected a camera (k, l), got {view!r}")
    return view[0], view[1]


DRAWINGS: dict[str, Callable[..., np.ndarray]] = {
    "CameraGrid": draw_grid,
    "PhotonCounts": draw_counts,
    "Views": draw_views,
    "Sections": draw_sections,
    "Segmented": draw_masks,
    "DepthMap": draw_depth,
    "DepthPosterior": draw_posterior,
    "Truth": draw_truth,
}
