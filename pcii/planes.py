"""Planes to compare: an object is in focus at z only if no other depth explains it better.

With the requested depths alone, whatever is not at one of them would still have to belong to one. So
probe planes stand around each of them, a stated blur away; what is sharper there is out of focus.
"""

import numpy as np

from pcii.geometry import disparity_spread_px
from pcii.types import CameraGrid

PROBE_STEPS_PX = (-28.0, -14.0, 14.0, 28.0)
"""Distance of the probes from their plane, in px of total disparity spread; half of it is blur."""


def with_probes(grid: CameraGrid, z_mm: np.ndarray) -> np.ndarray:
    """The requested depths (Z,), then the probes around them, float64.

    A probe nearer than half a probe step to a requested plane or to another probe is left out, and
    so is one beyond infinity.
    """
    unit = float(disparity_spread_px(grid, 1.0))
    if unit == 0:  # a single camera has no disparity, so nothing tells depths apart
        return z_mm
    spreads = list(unit / z_mm)
    apart = min(abs(step) for step in PROBE_STEPS_PX) / 2
    for spread in unit / z_mm:
        for step in PROBE_STEPS_PX:
            probe = spread + step
            if probe > 0 and all(abs(probe - other) > apart for other in spreads):
                spreads.append(probe)
    return unit / np.array(spreads)
