"""Which way a point of the film looks: one formula, for NumPy's arrays and for the renderer's alike."""

from typing import Any

from pcii.core.camera_grid import CameraGrid
from simgen.spec.camera_grid import Lens


def film_slopes(grid: CameraGrid, row_px: Any, col_px: Any, axis_px: tuple[Any, Any]) -> tuple[Any, Any]:
    """Slopes (x, y) of chief rays through points of the film, in mm to the right and down per mm ahead.

    The camera's axis meets the film at `axis_px`, (column, row). All are numbers or arrays of one kind.
    """
    per_px = grid.pixel_mm / grid.focal_mm
    return (col_px - axis_px[0]) * per_px, (row_px - axis_px[1]) * per_px


def slopes_behind_lens(
    slopes: tuple[Any, Any], lens: Lens, lens_point_mm: tuple[Any, Any]
) -> tuple[Any, Any]:
    """Slopes (x, y) of rays of the same film points that leave from a point (x, y) of a thin lens.

    All rays of a film point meet where the chief ray, through the lens's centre, is in focus.
    """
    return slopes[0] - lens_point_mm[0] / lens.focus_mm, slopes[1] - lens_point_mm[1] / lens.focus_mm
