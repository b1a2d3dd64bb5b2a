"""Planes to compare: an object is in focus at z only if no other depth explains it better.

With the requested depths alone, whatever is not at one of them would still have to belong to one. So
probe planes stand around each of them, a stated blur away; what is sharper there is out of focus.
"""

import numpy as np

from pcii.core.focal_planes import FocalPlanes

PROBE_STEPS_PX = (-28.0, -14.0, 14.0, 28.0)
"""Distance of the probes from their plane, in px of total disparity; half of it is blur."""


def with_probes(planes: FocalPlanes, *, clear_px: float = 7.0) -> FocalPlanes:
    """The requested planes (Z,), then the probes around them.

    A probe less than `clear_px` of total disparity from a requested plane is left out, one less than half a
    probe step from another probe, and one beyond infinity.
    """
    requested, probes = planes.total_disparity_px, []
    if not requested.all():  # a single camera has no disparity, so nothing tells depths apart
        return planes
    apart = min(abs(step) for step in PROBE_STEPS_PX) / 2
    for own in requested:
        for step in PROBE_STEPS_PX:
            probe = own + step
            clear = np.all(np.abs(probe - requested) > clear_px - 1e-9)  # rounding of the sum
            if probe > 0 and clear and all(abs(probe - other) > apart for other in probes):
                probes.append(probe)
    return planes.followed_by(probes)
