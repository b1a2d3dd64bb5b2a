"""What `.plot()` of each type draws, of plain arrays: cameras, a view, sections and masks, depth, truth.

Every function draws into the Matplotlib `axes` that it is given, by default of a new figure, and returns them
as an array (N,), one for each panel.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pcii.figures.charts import draw_cameras, draw_depth_probability
from pcii.figures.exposure import PANEL_PX, block_px, exposed, photon_picture
from pcii.figures.maps import draw_depth, draw_entropy
from pcii.figures.object_maps import draw_objects, named_width
from pcii.figures.palette import COLOURS, plot_label
from pcii.figures.panels import MOST_PANELS, draw_outline, several_axes, show_picture
from pcii.imaging.blocks import evenly_chosen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    MaybeAxes: TypeAlias = Axes | Sequence[Axes] | np.ndarray | None

Light = tuple[np.ndarray, np.ndarray]
"""Sums and numbers of samples of an image in its colours, (H, W, C) each."""


def plot_cameras(axes: "MaybeAxes", rows: int, cols: int, pitch_mm: tuple[float, float]) -> np.ndarray:
    """Places of cameras in mm, with both baselines and the virtual centre."""
    panels = several_axes(axes, 1, (4.0, 4.0))
    x_mm, y_mm = (
        (np.arange(count) - (count - 1) / 2) * pitch
        for count, pitch in zip((cols, rows), pitch_mm, strict=True)
    )
    title = f"{rows} x {cols} cameras, pitch {pitch_mm[0]:g}, {pitch_mm[1]:g} mm (x, y)"
    draw_cameras(panels[0], x_mm, y_mm, title)
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
    masks: np.ndarray | None = None,
    method: str = "",
) -> np.ndarray:
    """Sections, a panel each, all at one exposure; of more than 12 the evenly chosen 12.

    `light_of` gives the light of a plane. With `masks` (Z, H, W) only voxels inside are drawn, and outlines.
    """

    def visible_light(plane: int) -> Light:
        sums, samples = light_of(plane)
        return (sums if masks is None else sums * masks[plane][..., None]), samples

    planes, voxels = evenly_chosen(len(z_mm), MOST_PANELS), light_of(0)[0].shape
    step = block_px(voxels, PANEL_PX)
    panels = several_axes(axes, len(planes), shape_HW)
    images = exposed(map(visible_light, planes), step)
    for panel, plane, image in zip(panels, planes, images, strict=True):
        depth = f"{z_mm[plane]:.5g} mm"
        show_picture(panel, image, shape_HW, f"section at {depth}", step * shape_HW[0] / voxels[0])
        if masks is not None:
            draw_outline(panel, masks[plane], shape_HW, COLOURS[4])
            panel.set_title(f"{depth}: {masks[plane].mean():.1%} in focus\n{plot_label(method)}")
    return panels


def plot_depth(
    axes: "MaybeAxes", z_mm: np.ndarray, confidence: np.ndarray, z_range_mm: tuple[float, float] | None
) -> np.ndarray:
    """Depth (H, W) in mm, greyer where less sure, with a colour bar."""
    panels = several_axes(axes, 1, z_mm.shape)
    draw_depth(panels[0], z_mm, confidence, z_range_mm, "depth, greyer where less sure")
    return panels


def plot_probability(
    axes: "MaybeAxes", z_mm: np.ndarray, probability: np.ndarray, no_surface: float, pixel: tuple[int, int]
) -> np.ndarray:
    """Probability (Z,) of a surface at each depth, at one pixel."""
    panels = several_axes(axes, 1)
    draw_depth_probability(panels[0], z_mm, probability, f"pixel {pixel}, no surface: {no_surface:.1%}")
    return panels


def plot_entropy(
    axes: "MaybeAxes", bits: np.ndarray, plane_count: int, shape_HW: tuple[int, int], side_px: int
) -> np.ndarray:
    """Entropy (h, w) in bits of blocks of a view, whose outcomes are the planes and no surface."""
    panels = several_axes(axes, 1, shape_HW)
    draw_entropy(panels[0], bits, float(np.log2(plane_count + 1)), shape_HW, side_px)
    return panels


def plot_truth(
    axes: "MaybeAxes",
    z_mm: np.ndarray,
    object_id: np.ndarray,
    names: Mapping[int, str],
    z_range_mm: tuple[float, float] | None,
) -> np.ndarray:
    """Depth of the objects (of all, if there are none) and the objects with their names."""
    height, width = z_mm.shape
    panels = several_axes(axes, 2, z_mm.shape, widths=(1.0, named_width(width / height)))
    title = "true depth of the objects" if (object_id > 0).any() else "true depth"
    draw_depth(panels[0], z_mm, None, z_range_mm, title)
    draw_objects(panels[1], object_id, names)
    return panels
