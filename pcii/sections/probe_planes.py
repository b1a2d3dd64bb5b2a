"""Planes to compare: an object is in focus at z only if no other depth explains it better.

With the requested depths alone, whatever is not at one of them would still have to belong to one. So
probe planes stand around each of them, a stated blur away; what is sharper there is out of focus.
"""

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.geometry import depth_of_total_disparity_mm, total_disparity_px

PROBE_STEPS_PX = (-28.0, -14.0, 14.0, 28.0)
"""Distance of the probes from their plane, in px of total disparity spread; half of it is blur."""


def with_probes(grid: CameraGrid, z_mm: np.ndarray, *, clear_px: float = 7.0) -> np.ndarray:
    """The requested depths (Z,), then the probes around them, float64.

    A probe less than `clear_px` of spread from a requested plane is left out, one less than half a probe
    step from another probe, and one beyond infinity.
    """
    unit = float(total_disparity_px(grid, 1.0))
    if unit == 0:  # a single camera has no disparity, so nothing tells depths apart
        return z_mm
    requested, probes = unit / z_mm, []
    apart = min(abs(step) for step in PROBE_STEPS_PX) / 2
    for spread in requested:
        for step in PROBE_STEPS_PX:
            probe = spread + step
            clear = np.all(np.abs(probe - requested) > clear_px - 1e-9)  # rounding of the sum
            if probe > 0 and clear and all(abs(probe - other) > apart for other in probes):
                probes.append(probe)
    return depth_of_total_disparity_mm(grid, np.array([*requested, *probes]))
