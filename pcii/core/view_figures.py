"""Pictures of elemental images: which view, its colours, its exposure."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import by_colour
from pcii.core.camera_grid import CameraGrid, check_camera

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Picture = Callable[[int], np.ndarray]
"""Makes an 8-bit picture (h, w, 3) in blocks of so many pixels to a side."""


def middle_camera(grid: CameraGrid) -> tuple[int, int]:
    """The camera (k, l) in the middle, of an even number the one after it."""
    return grid.rows // 2, grid.cols // 2


def chosen_camera(grid: CameraGrid, view: tuple[int, int] | Literal["mean"] | None) -> tuple[int, int] | None:
    """The camera (k, l) of a `view`, in the middle if it is None, and None for "mean".

    Raises `InputError` for a camera outside the grid, and for anything else.
    """
    if view is None:
        return middle_camera(grid)
    if isinstance(view, str) and view == "mean":
        return None
    is_pair = isinstance(view, tuple | list) and len(view) == 2
    if not is_pair or not all(isinstance(n, int | np.integer) for n in view):
        raise InputError(f'view: expected a camera (k, l) or "mean", got {view!r}')
    k, l = int(view[0]), int(view[1])
    check_camera(grid, k, l)
    return k, l


def colours_and_samples(light: np.ndarray, cfa: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Light and number of samples, (H, W, C) each, of an image (H, W, C) that may be a mosaic."""
    samples = np.ones(light.shape, dtype=np.int64)
    if cfa is None:
        return light, samples
    return by_colour(light[..., 0], cfa), by_colour(samples[..., 0], cfa)


def light_picture(light: np.ndarray, cfa: str | None) -> Picture:
    """Light (H, W, C), a mosaic if `cfa` is given, in its colours."""
    from pcii.figures.exposure import exposed

    return lambda step_px: exposed([colours_and_samples(light, cfa)], step_px)[0]


def photon_picture(counts: np.ndarray) -> Picture:
    """Photon counts (H, W) of one view, in grey: of so few, neighbours would only take false colours."""
    from pcii.figures import exposure

    return lambda step_px: exposure.photon_picture(counts, step_px)


def draw_view(axes: "Axes | None", picture: Picture, grid: CameraGrid, title: str) -> np.ndarray:
    """Draw a picture over the pixels of a view; returns the axes (1,)."""
    from pcii.figures.exposure import PANEL_PX, block_px
    from pcii.figures.panels import several_axes, show_picture

    shape_HW = grid.shape_HW
    step_px = block_px(shape_HW, PANEL_PX)
    panels = several_axes(axes, 1, shape_HW)
    show_picture(panels[0], picture(step_px), shape_HW, title, step_px)
    return panels


def view_thumbnail(picture: Picture, grid: CameraGrid) -> str:
    """A small picture of a view as a data URI."""
    from pcii.figures.exposure import THUMBNAIL_PX, block_px
    from pcii.figures.pictures import data_uri

    return data_uri(picture(block_px((grid.height, grid.width), THUMBNAIL_PX)))
