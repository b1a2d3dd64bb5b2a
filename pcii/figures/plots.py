"""What `.plot()` of each type but the score draws, of plain arrays: cameras, a view, sections, depth, truth.

Every function draws into the Matplotlib `axes` that it gets, by default of a new figure, and returns them
as an array (N,), one for each panel.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from pcii.figures.charts import quiet_grid
from pcii.figures.exposure import PANEL_PX, block_px, exposed, photon_picture
from pcii.figures.panels import (
    COLOURS,
    MAX_PANELS,
    Style,
    draw_outline,
    hide_frame,
    plot_label,
    several_axes,
    show_map,
    show_picture,
    style_context,
    write_in_middle,
)
from pcii.figures.pictures import DEPTH_COLOURS, NO_ANSWER, SHARE_COLOURS
from pcii.imaging.blocks import evenly_chosen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pcii.figures.panels import MaybeAxes

Light = tuple[np.ndarray, np.ndarray]
"""Sums and numbers of samples of an image in its colours, (H, W, C) each."""
OUTLIER_SHARE = 0.01
"""Share of the depths, at either end, that may lie outside the scale."""
MIN_DEPTH_SPAN_MM = 1.0
"""A scale of depth spans so much at least: what is flat is no picture of rounding errors."""
MAX_NAMES = 40
"""Objects that are named beside a picture: the largest."""
NAME_LINES = 16
"""So many names stand in a column."""
SHADES = (1.0, 0.7, 0.5)
"""Brightness of the objects' colours, where all are used up."""


def plot_cameras(axes: "MaybeAxes", rows: int, cols: int, pitch_mm: tuple[float, float]) -> np.ndarray:
    """Places of cameras in mm, with both baselines and the virtual centre."""
    panels = several_axes(axes, 1, (4.0, 4.0))
    x_mm, y_mm = (
        (np.arange(count) - (count - 1) / 2) * pitch
        for count, pitch in zip((cols, rows), pitch_mm, strict=True)
    )
    x, y = np.meshgrid(x_mm, y_mm)
    panel = panels[0]
    panel.scatter(x, y, s=max(4.0, 40.0 - 2 * max(x.shape)), color=COLOURS[0], label="cameras")
    panel.scatter([0], [0], marker="+", s=90, color=COLOURS[1], label="virtual centre", zorder=3)
    half = 0.6 * max(np.ptp(x_mm), np.ptp(y_mm), 1.0)
    panel.set_aspect("equal")
    panel.set_xlim(-half, half)
    panel.set_ylim(half, -half)
    panel.set_xlabel(f"X, right (mm); baseline {np.ptp(x_mm):.4g} mm")
    panel.set_ylabel(f"Y, down (mm); baseline {np.ptp(y_mm):.4g} mm")
    panel.set_title(f"{rows} x {cols} cameras, pitch {pitch_mm[0]:g}, {pitch_mm[1]:g} mm (x, y)")
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, frameon=False, fontsize="small")
    quiet_grid(panel)
    return panels


def plot_view(axes: "MaybeAxes", light: np.ndarray | Light, title: str) -> np.ndarray:
    """One view: photon counts (H, W) in grey, since so few would give false colours; light in its colours."""
    shape_HW = light.shape if isinstance(light, np.ndarray) else light[0].shape[:2]
    step_px = block_px(shape_HW, PANEL_PX)
    image = photon_picture(light, step_px) if isinstance(light, np.ndarray) else exposed([light], step_px)[0]
    panels = several_axes(axes, 1, shape_HW)
    show_picture(panels[0], image, shape_HW, title, step_px)
    return panels


def plot_sections(
    axes: "MaybeAxes",
    z_mm: np.ndarray,
    light_of: Callable[[int], Light],
    shape_HW: tuple[int, int],
    px_at_1mm: float,
    style: Style,
    masks: np.ndarray | None = None,
    method: str = "",
) -> np.ndarray:
    """Sections, a panel each, all at one exposure; of more than 12 the evenly chosen 12.

    `light_of` gives the light of a plane, `px_at_1mm` is the size of a pixel in mm at a depth of 1 mm. With
    `masks` (Z, H, W) only voxels inside are drawn, and outlines.
    """

    def visible_light(plane: int) -> Light:
        sums, samples = light_of(plane)
        return (sums if masks is None else sums * masks[plane][..., None]), samples

    planes, voxels = evenly_chosen(len(z_mm), MAX_PANELS), light_of(0)[0].shape
    step = block_px(voxels, PANEL_PX)
    images = exposed(map(visible_light, planes), step)
    with style_context(style):
        panels = several_axes(axes, len(planes), shape_HW)
        for panel, plane, image in zip(panels, planes, images, strict=True):
            title = f"section at {z_mm[plane]:.5g} mm"
            if masks is not None:
                title = f"{z_mm[plane]:.5g} mm: {masks[plane].mean():.1%} in focus\n{plot_label(method)}"
                draw_outline(panel, masks[plane], shape_HW, COLOURS[4])
            side = step * shape_HW[0] / voxels[0]
            show_picture(panel, image, shape_HW, title, side, style, z_mm[plane] * px_at_1mm)
    return panels


def depth_limits_mm(z_mm: np.ndarray) -> tuple[float, float] | None:
    """Near and far end of a scale that holds all but outlying depths; None without depths."""
    known = z_mm[np.isfinite(z_mm)]
    if not known.size:
        return None
    near, far = np.quantile(known, [OUTLIER_SHARE, 1 - OUTLIER_SHARE])
    middle, half = (near + far) / 2, max((far - near) / 2, MIN_DEPTH_SPAN_MM / 2)
    return float(middle - half), float(middle + half)


def plot_depth(
    axes: "MaybeAxes",
    z_mm: np.ndarray,
    confidence: np.ndarray | None,
    z_range_mm: tuple[float, float] | None,
    title: str = "depth, paler where less sure",
    style: Style = "screen",
) -> np.ndarray:
    """Depth (H, W) in mm with a colour bar, near is bright: paler where less sure, grey without an answer."""
    limits = z_range_mm or depth_limits_mm(z_mm)
    with style_context(style):
        panels = several_axes(axes, 1, z_mm.shape)
        if limits is not None:
            scale = DEPTH_COLOURS, limits, "depth z (mm)"
            show_map(panels[0], z_mm, z_mm.shape, title, *scale, confidence, style=style)
        else:
            show_picture(panels[0], np.full((1, 1, 3), NO_ANSWER), z_mm.shape, title, max(z_mm.shape), style)
            write_in_middle(panels[0], "no depth is known")
    return panels


def plot_probability(
    axes: "MaybeAxes", z_mm: np.ndarray, probability: np.ndarray, no_surface: float, pixel: tuple[int, int]
) -> np.ndarray:
    """Probability (Z,) of a surface at each depth, at one pixel."""
    panels = several_axes(axes, 1)
    panel = panels[0]
    panel.fill_between(z_mm, probability, color=COLOURS[0], alpha=0.3, linewidth=0)
    marker = "o" if z_mm.size <= 40 else None
    panel.plot(z_mm, probability, color=COLOURS[0], linewidth=1.4, marker=marker, markersize=3)
    panel.set_ylim(bottom=0)
    panel.set_xlabel("depth z (mm)")
    panel.set_ylabel("probability of a surface")
    panel.set_title(f"pixel {pixel}, no surface: {no_surface:.1%}")
    quiet_grid(panel)
    return panels


def plot_entropy(
    axes: "MaybeAxes", bits: np.ndarray, plane_count: int, shape_HW: tuple[int, int], side_px: int
) -> np.ndarray:
    """Entropy (h, w) in bits of blocks, `side_px` wide, whose outcomes are the planes and no surface."""
    panels = several_axes(axes, 1, shape_HW)
    limits, title = (0.0, float(np.log2(plane_count + 1))), "uncertainty of depth"
    show_map(panels[0], bits, shape_HW, title, SHARE_COLOURS, limits, "entropy (bits)", block_px=side_px)
    return panels


def plot_truth(
    axes: "MaybeAxes",
    z_mm: np.ndarray,
    object_id: np.ndarray,
    names: Mapping[int, str],
    z_range_mm: tuple[float, float] | None,
) -> np.ndarray:
    """Depth of the objects (of all, if there are none) and the objects with their names."""
    panels = several_axes(axes, 2, z_mm.shape)
    title = "true depth of the objects" if (object_id > 0).any() else "true depth"
    plot_depth(panels[0], z_mm, None, z_range_mm, title)
    _draw_objects(panels[1], object_id, names)
    return panels


def _draw_objects(axes: "Axes", object_id: np.ndarray, names: Mapping[int, str]) -> None:
    """Objects (H, W) in colours, grey where none is; the names of the largest stand beside the picture."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    image = np.full((*object_id.shape, 3), NO_ANSWER, np.uint8)
    ids, sizes = np.unique(object_id[object_id > 0], return_counts=True)
    patches = []
    for place, number in enumerate(ids.tolist()):
        turn, place_in_turn = divmod(place, len(COLOURS))
        red, green, blue = (SHADES[turn % len(SHADES)] * part for part in to_rgb(COLOURS[place_in_turn]))
        image[object_id == number] = np.round(255 * np.array([red, green, blue]))
        patches.append(Patch(color=(red, green, blue), label=plot_label(names[number])))
    show_picture(axes, image, object_id.shape, "objects")
    hide_frame(axes)
    if not patches:
        write_in_middle(axes, "no object is seen")
        return
    largest = sorted(np.argsort(-sizes, kind="stable")[:MAX_NAMES])
    columns = -(-len(largest) // NAME_LINES)
    place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "ncols": columns}
    axes.legend(handles=[patches[n] for n in largest], frameon=False, fontsize="small", **place)
