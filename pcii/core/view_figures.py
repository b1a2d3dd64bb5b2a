"""Pictures of elemental images: which view, its colours, its exposure."""

from typing import TYPE_CHECKING, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import by_colour
from pcii.core.camera_grid import CameraGrid, check_camera

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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


def _samples_and_colours(light: np.ndarray, cfa: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Light and number of samples, (H, W, C) each, of an image (H, W, C) that may be a mosaic."""
    samples = np.ones(light.shape, dtype=np.int64)
    if cfa is None:
        return light, samples
    return by_colour(light[..., 0], cfa), by_colour(samples[..., 0], cfa)


def draw_light(axes: "Axes | None", light: np.ndarray, cfa: str | None, title: str) -> np.ndarray:
    """Draw light (H, W, C), a mosaic if `cfa` is given, in its colours; returns the axes (1,)."""
    from pcii.figures.exposure import PANEL_PX, block_px, exposed
    from pcii.figures.panels import several_axes, show_picture

    panels = several_axes(axes, 1, light.shape[:2])
    (image,) = exposed([_samples_and_colours(light, cfa)], PANEL_PX)
    show_picture(panels[0], image, light.shape[:2], title, block_px(light.shape, PANEL_PX))
    return panels


def draw_photons(axes: "Axes | None", counts: np.ndarray, title: str) -> np.ndarray:
    """Draw photon counts (H, W) of one view, in grey: of so few, neighbours would only take false colours.

    Returns the axes (1,).
    """
    from pcii.figures.exposure import PANEL_PX, block_px, photon_picture
    from pcii.figures.panels import several_axes, show_picture

    panels = several_axes(axes, 1, counts.shape)
    image = photon_picture(counts, PANEL_PX)
    show_picture(panels[0], image, counts.shape, title, block_px(counts.shape, PANEL_PX))
    return panels


def light_thumbnail(light: np.ndarray, cfa: str | None) -> str:
    """A small picture of light (H, W, C) as a data URI."""
    from pcii.figures.exposure import THUMBNAIL_PX, exposed
    from pcii.figures.pictures import data_uri

    return data_uri(exposed([_samples_and_colours(light, cfa)], THUMBNAIL_PX)[0])


def photon_thumbnail(counts: np.ndarray) -> str:
    """A small picture of photon counts (H, W) as a data URI."""
    from pcii.figures.exposure import THUMBNAIL_PX, photon_picture
    from pcii.figures.pictures import data_uri

    return data_uri(photon_picture(counts, THUMBNAIL_PX))
