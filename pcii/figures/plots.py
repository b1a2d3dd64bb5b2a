"""What each type shows of itself: `draw` is the `.plot()` of all, and `picture_html` their page in notebooks.

This room comes before the types, so a value is known by the name of its class. Every function draws into the
Matplotlib `axes` that it gets, by default of a new figure, and returns them as an array (N,), one for each
panel.
"""

import base64
import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.blocks import evenly_chosen
from pcii.base.errors import InputError
from pcii.base.plain_text import in_html
from pcii.figures.exposure import PANEL_PX, block_px, exposed, photon_picture
from pcii.figures.panels import (
    COLOURS,
    MAX_PANELS,
    colour_scale,
    draw_outline,
    draw_scale_bar,
    hide_frame,
    in_style,
    plot_label,
    several_axes,
    show_picture,
    write_in_middle,
)
from pcii.figures.pictures import DEPTH_COLOURS, NO_ANSWER, depth_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PICTURE_DOTS_PER_INCH = 60
OUTLIER_SHARE = 0.01
"""Share of the depths, at either end, that may lie outside the scale."""
MIN_DEPTH_SPAN_MM = 1.0
"""A scale of depth spans so much at least: what is flat is no picture of rounding errors."""
OBJECT_COLOURS, OBJECT_COLOUR_COUNT = "tab20", 20
"""Colour map of Matplotlib for objects, and its colours, which further objects have again."""
MAX_NAMES = 40
"""Objects that are named beside a picture: the largest."""
NAME_LINES = 16
"""Names in a column."""


def draw(value: Any, axes: Any = None, *, style: str = "screen", **options: Any) -> np.ndarray:
    """Draw a value into Matplotlib axes, by default new ones, and return them (N,).

    The style "paper", for print, has a white background and a scale bar instead of axes in pixels: in mm at
    the depth of a section, else in px. Raises `InputError` for another style than that and "screen".
    """
    with in_style(style):
        panels = DRAWINGS[type(value).__name__](value, axes, **options)
        if style == "paper":
            for panel, mm_per_px in zip(panels, _pixel_sizes_mm(value, len(panels)), strict=True):
                draw_scale_bar(panel, mm_per_px)
    return panels


def _pixel_sizes_mm(value: Any, count: int) -> list[float] | list[None]:
    """How wide a pixel is at the depth of each of the sections that are drawn; None for other pictures."""
    sections = getattr(value, "sections", value)
    if not hasattr(sections, "planes"):
        return [None] * count
    z_mm, grid = sections.z_mm, sections.grid
    return [float(z_mm[plane]) * grid.pixel_mm / grid.focal_mm for plane in evenly_chosen(len(z_mm), count)]


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


def draw_counts(counts: Any, axes: Any, view: Any = None) -> np.ndarray:
    """The photons of the camera `view`, (k, l), by default in the middle; in grey: few give false colours."""
    k, l = _camera(counts.grid, view)
    image = counts.view(k, l)
    step_px = block_px(image.shape, PANEL_PX)
    panels = several_axes(axes, 1, image.shape)
    title = f"view ({k}, {l}), photons: {image.sum()}"
    show_picture(panels[0], photon_picture(image, step_px), image.shape, title, step_px)
    return panels


def draw_views(views: Any, axes: Any, view: Any = None) -> np.ndarray:
    """The elemental image of the camera `view`, by default in the middle, in colours."""
    k, l = _camera(views.grid, view)
    shape_HW = views.grid.shape_HW
    step_px = block_px(shape_HW, PANEL_PX)
    panels = several_axes(axes, 1, shape_HW)
    (image,) = exposed([views.in_colours(k, l)], step_px)
    show_picture(panels[0], image, shape_HW, f"view ({k}, {l})", step_px)
    return panels


def _camera(grid: Any, view: Any) -> tuple[Any, Any]:
    if view is None:
        return grid.middle_camera
    if not isinstance(view, tuple | list) or len(view) != 2:
        raise InputError(f"view: expected a camera (k, l), got {view!r}")
    return view[0], view[1]


def draw_sections(sections: Any, axes: Any, focus: Any = None) -> np.ndarray:
    """Sections, a panel each, all at one exposure; of more than 12 the evenly chosen 12.

    With the masks of a `focus` only voxels inside are drawn, and outlines.
    """

    def light(plane: int) -> tuple[np.ndarray, np.ndarray]:
        sums, samples = sections.in_colours(plane)
        return (sums if focus is None else sums * focus.in_focus[plane][..., None]), samples

    z_mm, shape_HW, voxels = sections.z_mm, sections.grid.shape_HW, sections.counts.shape[1:3]
    planes, step = evenly_chosen(len(z_mm), MAX_PANELS), block_px(voxels, PANEL_PX)
    panels = several_axes(axes, len(planes), shape_HW)
    for panel, plane, image in zip(panels, planes, exposed(map(light, planes), step), strict=True):
        title = f"section at {z_mm[plane]:.5g} mm"
        if focus is not None:
            mask = focus.in_focus[plane]
            title = f"{z_mm[plane]:.5g} mm: {mask.mean():.1%} in focus\n{plot_label(focus.method)}"
            draw_outline(panel, mask, shape_HW, COLOURS[4])
        show_picture(panel, image, shape_HW, title, step * shape_HW[0] / voxels[0])
    return panels


def draw_masks(focus: Any, axes: Any) -> np.ndarray:
    """Each section after removal with the outline of its mask."""
    return draw_sections(focus.sections, axes, focus)


def draw_depth(depth: Any, axes: Any, z_range_mm: tuple[float, float] | None = None) -> np.ndarray:
    """Depth in mm with a scale from `z_range_mm`, (near, far), by default of all but outlying depths."""
    panels = several_axes(axes, 1, depth.z_mm.shape)
    _draw_depths(panels[0], depth.z_mm, depth.confidence, z_range_mm, "depth, paler where less sure")
    return panels


def draw_truth(truth: Any, axes: Any, z_range_mm: tuple[float, float] | None = None) -> np.ndarray:
    """Depth of the objects (of all, if there are none) and the objects with their names."""
    panels = several_axes(axes, 2, truth.z_mm.shape)
    title = "true depth of the objects" if truth.has_objects else "true depth"
    _draw_depths(panels[0], truth.object_z_mm, None, z_range_mm, title)
    _draw_objects(panels[1], truth)
    return panels


def depth_limits_mm(z_mm: np.ndarray) -> tuple[float, float] | None:
    """Near and far end of a scale that holds all but outlying depths; None without depths."""
    known = z_mm[np.isfinite(z_mm)]
    if not known.size:
        return None
    near, far = np.quantile(known, [OUTLIER_SHARE, 1 - OUTLIER_SHARE])
    middle, half = (near + far) / 2, max((far - near) / 2, MIN_DEPTH_SPAN_MM / 2)
    return float(middle - half), float(middle + half)


def _draw_depths(
    axes: "Axes",
    z_mm: np.ndarray,
    confidence: np.ndarray | None,
    z_range_mm: tuple[float, float] | None,
    title: str,
) -> None:
    """Depth (H, W) in mm with a colour bar, near is bright: paler where less sure, grey without an answer."""
    limits = z_range_mm or depth_limits_mm(z_mm)
    if limits is None:
        show_picture(axes, np.full((1, 1, 3), NO_ANSWER), z_mm.shape, title, max(z_mm.shape))
        write_in_middle(axes, "no depth is known")
        return
    show_picture(axes, depth_image(z_mm, *limits, confidence), z_mm.shape, title)
    figure = axes.get_figure(root=True)
    assert figure is not None
    bar = figure.colorbar(colour_scale(DEPTH_COLOURS, limits), ax=axes, label="depth z (mm)")
    bar.ax.invert_yaxis()  # near is on top


def _draw_objects(axes: "Axes", truth: Any) -> None:
    """Objects in colours, grey where none is; the names of the largest stand beside the picture."""
    from matplotlib import colormaps
    from matplotlib.patches import Patch

    ids, sizes = np.unique(truth.object_id[truth.object_id > 0], return_counts=True)
    colours = np.asarray(colormaps[OBJECT_COLOURS](np.arange(ids.size) % OBJECT_COLOUR_COUNT))[:, :3]
    image = np.full((*truth.object_id.shape, 3), NO_ANSWER, np.uint8)
    for number, colour in zip(ids, colours, strict=True):
        image[truth.object_id == number] = np.round(255 * colour)
    show_picture(axes, image, truth.object_id.shape, "objects")
    hide_frame(axes)
    if not ids.size:
        write_in_middle(axes, "no object is seen")
        return
    largest = np.sort(np.argsort(-sizes, kind="stable")[:MAX_NAMES])
    patches = [Patch(color=tuple(colours[n]), label=plot_label(truth.names[int(ids[n])])) for n in largest]
    place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "ncols": -(-len(patches) // NAME_LINES)}
    axes.legend(handles=patches, frameon=False, fontsize="small", **place)


DRAWINGS: dict[str, Callable[..., np.ndarray]] = {
    "PhotonCounts": draw_counts,
    "Views": draw_views,
    "Sections": draw_sections,
    "Segmented": draw_masks,
    "DepthMap": draw_depth,
    "Truth": draw_truth,
}
