"""What each type shows of itself: `draw` is the `.plot()` of all, and `picture_html` their page in notebooks.

This room comes before the types, so a value is known by the name of its class.
"""

import math
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base import InputError, evenly_chosen, visible
from pcii.figures.charts import (
    COLOURS,
    GRID_COLOUR,
    MAX_PANELS,
    colour_scale,
    figure_bytes,
    hide_frame,
    in_style,
    plot_label,
    several_axes,
)
from pcii.figures.pictures import (
    DEPTH_COLOURS,
    NO_ANSWER,
    PANEL_PX,
    block_px,
    exposed,
    map_image,
    photon_picture,
    uri_of,
)

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
"""Largest number of objects whose names stand at a picture: those of the largest objects."""
NAME_LINES = 16
"""Names in a column."""
MAX_SCALE_BAR_SHARE = 0.3
"""Longest scale bar as a share of the picture's width."""


def draw(value: Any, axes: Any = None, *, style: str = "screen", **options: Any) -> np.ndarray:
    """Draw a value into Matplotlib axes, by default new ones, and return them (N,).

    The style "paper", for print, has a white background and a scale bar instead of axes in pixels: in mm at
    the depth of a section, else in px. Raises `InputError` for another style than that and "screen".
    """
    with in_style(style):
        panels = DRAWINGS[type(value).__name__](value, axes, **options)
        if style == "paper":
            sections = getattr(value, "sections", value)
            sizes_mm: Sequence[float | None] = [None] * len(panels)
            if hasattr(sections, "planes"):
                z_mm, grid = sections.z_mm, sections.grid
                planes = evenly_chosen(len(z_mm), len(panels))
                sizes_mm = [float(z_mm[plane]) * grid.pixel_mm / grid.focal_mm for plane in planes]
            for panel, mm_per_px in zip(panels, sizes_mm, strict=True):
                _draw_scale_bar(panel, mm_per_px)
    return panels


def picture_html(value: Any) -> str:
    """The line of a value and its drawing, in HTML; without a picture if its data cannot be read."""
    from matplotlib import pyplot

    line = f"<pre>{escape(visible(repr(value)))}</pre>"
    try:
        figure = draw(value)[0].figure
    except (InputError, OSError):
        return line
    picture = uri_of("png", figure_bytes(figure, PICTURE_DOTS_PER_INCH))
    pyplot.close(figure)
    return f'{line}<img src="{picture}">'


def draw_view(images: Any, axes: Any, view: Any = None) -> np.ndarray:
    """The elemental image of the camera `view`, (k, l), by default in the middle.

    Photons are in grey: few give false colours.
    """
    view = images.grid.middle_camera if view is None else view
    if not isinstance(view, tuple | list) or len(view) != 2:
        raise InputError(f"view: expected a camera (k, l), got {view!r}")
    (k, l), shape_HW = view, images.grid.shape_HW
    step_px, title = block_px(shape_HW, PANEL_PX), f"view ({k}, {l})"
    if hasattr(images, "in_colours"):
        (picture,) = exposed([images.in_colours(k, l)], step_px)
    else:
        photons = images.view(k, l)
        picture, title = photon_picture(photons, step_px), f"{title}, photons: {photons.sum()}"
    panels = several_axes(axes, 1, shape_HW)
    _show_picture(panels[0], picture, shape_HW, title, step_px)
    return panels


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
            _draw_outline(panel, mask, shape_HW, COLOURS[4])
        _show_picture(panel, image, shape_HW, title, step * shape_HW[0] / voxels[0])
    return panels


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
    known_mm = z_mm[np.isfinite(z_mm)]
    if not known_mm.size:
        return None
    near, far = np.quantile(known_mm, [OUTLIER_SHARE, 1 - OUTLIER_SHARE])
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
        _show_picture(axes, np.full((1, 1, 3), NO_ANSWER), z_mm.shape, title, max(z_mm.shape))
        _write_in_middle(axes, "no depth is known")
        return
    _show_picture(axes, map_image(z_mm, DEPTH_COLOURS, limits, confidence), z_mm.shape, title)
    figure: Any = axes.get_figure(root=True)
    bar = figure.colorbar(colour_scale(DEPTH_COLOURS, limits), ax=axes, label="depth z (mm)")
    bar.ax.invert_yaxis()  # near is on top


def _draw_objects(axes: "Axes", truth: Any) -> None:
    """Objects in colours, grey without an object; the names of the largest stand to the right."""
    from matplotlib import colormaps
    from matplotlib.patches import Patch

    ids, sizes = np.unique(truth.object_id[truth.object_id > 0], return_counts=True)
    colours = np.asarray(colormaps[OBJECT_COLOURS](np.arange(ids.size) % OBJECT_COLOUR_COUNT))[:, :3]
    image = np.full((*truth.object_id.shape, 3), NO_ANSWER, np.uint8)
    for number, colour in zip(ids, colours, strict=True):
        image[truth.object_id == number] = np.round(255 * colour)
    _show_picture(axes, image, truth.object_id.shape, "objects")
    hide_frame(axes)
    if not ids.size:
        _write_in_middle(axes, "no object is seen")
        return
    largest = np.sort(np.argsort(-sizes, kind="stable")[:MAX_NAMES])
    patches = [Patch(color=tuple(colours[n]), label=plot_label(truth.names[int(ids[n])])) for n in largest]
    place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "ncols": -(-len(patches) // NAME_LINES)}
    axes.legend(handles=patches, frameon=False, fontsize="small", **place)


def _show_picture(
    axes: "Axes", image: np.ndarray, shape_HW: Sequence[int], title: str, block_px: float = 1.0
) -> None:
    """Draw an image (h, w, 3) of square blocks, `block_px` wide, over the pixels of a view.

    `shape_HW` is that of a view; blocks that reach over it are cut off.
    """
    height, width = shape_HW
    bottom, right = (block_px * size - 0.5 for size in image.shape[:2])
    axes.imshow(image, extent=(-0.5, right, bottom, -0.5))
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.set(title=title, xlabel="column (px)", ylabel="row (px)")
    axes.locator_params(integer=True, nbins=6)


def _draw_outline(axes: "Axes", mask: np.ndarray, shape_HW: Sequence[int], colour: str) -> None:
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


def _draw_scale_bar(axes: "Axes", mm_per_px: float | None) -> None:
    """In place of axes in pixels a bar of a round length, in mm, or px where a pixel's size is unknown."""
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

    hide_frame(axes)
    left, right = axes.get_xlim()
    px, unit = (1.0, "px") if mm_per_px is None else (1 / mm_per_px, "mm")
    longest = MAX_SCALE_BAR_SHARE * (right - left) / px
    decade = 10.0 ** math.floor(math.log10(longest))
    length = decade * max(factor for factor in (1, 2, 5) if factor * decade <= longest)
    place = {"loc": "upper left", "bbox_to_anchor": (0, -0.02), "bbox_transform": axes.transAxes}
    looks = {"color": "black", "frameon": False, "pad": 0.0, "borderpad": 0.0, "sep": 3}
    looks |= {"size_vertical": 0.01 * (right - left), "fill_bar": True}
    axes.add_artist(AnchoredSizeBar(axes.transData, length * px, f"{length:g} {unit}", **place, **looks))


def _write_in_middle(axes: "Axes", text: str) -> None:
    """A sentence where there is nothing to draw."""
    box = {"boxstyle": "round", "facecolor": "white", "edgecolor": GRID_COLOUR}
    place = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.5, text, color="black", bbox=box, **place)


DRAWINGS: dict[str, Callable[..., np.ndarray]] = {
    "PhotonCounts": draw_view,
    "Views": draw_view,
    "Sections": draw_sections,
    "Segmented": lambda focus, axes: draw_sections(focus.sections, axes, focus),
    "DepthMap": draw_depth,
    "Truth": draw_truth,
}
