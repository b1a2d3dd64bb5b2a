"""Checks of the depths that are searched: those of a range, and of requested planes."""

from collections.abc import Sequence

import numpy as np

from pcii.base.errors import InputError
from pcii.types.arrays import check_z_mm
from pcii.types.camera_grid import CameraGrid
from pcii.types.geometry import disparity_px, total_disparity_px

MOST_SPAN_PX = 2000.0
"""Largest change of total disparity between the ends of a range that is searched."""
SMALL_FILM_PX = 256
"""Parallax in px from camera to camera up to which depths are searched on films of any size."""


def check_range_mm(grid: CameraGrid, z_range_mm: object) -> tuple[float, float]:
    """Near and far end of a range of depths; raises `InputError` if it cannot be searched."""
    if not isinstance(z_range_mm, Sequence) or len(z_range_mm) != 2:
        raise InputError(f"z_range_mm: expected (near, far), got {z_range_mm!r}")
    near, far = check_z_mm(z_range_mm).tolist()
    if near >= far:
        raise InputError(f"z_range_mm: near must be less than far, got {near:g} and {far:g}")
    check_search(grid, "z_range_mm", np.array([near, far]))
    return near, far


def check_search(grid: CameraGrid, name: str, z_mm: np.ndarray) -> None:
    """Raise `InputError`, which begins with `name`, unless all depths between the depths `z_mm` (Z,) can be
    searched: they are not too many, and two cameras see the same at the farthest."""
    near, far = z_mm.min(), z_mm.max()
    span = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    if span > MOST_SPAN_PX:
        raise InputError(
            f"{name}: from {near:g} to {far:g} mm total disparity changes by {span:.3g} px, and at "
            f"most {MOST_SPAN_PX:g} px can be searched; choose a farther near end"
        )
    # From camera to camera a point moves by its disparity: by a film or more, it is on one film alone. Small
    # films are searched all the same, which takes no time.
    sizes = np.maximum([grid.width, grid.height], SMALL_FILM_PX).tolist()
    axes = zip(disparity_px(grid, far), sizes, (grid.cols, grid.rows), strict=True)
    if grid.view_count > 1 and not any(n > 1 and disparity < size for disparity, size, n in axes):
        raise InputError(f"{name}: up to {far:g} mm no two cameras see the same; choose a farther end")
