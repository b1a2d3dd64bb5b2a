"""Planes to compare: an object is in focus at z only if no other depth explains it better.

With the requested depths alone, every object would have to be assigned to one of them. So each is compared
with probe planes at a stated blur on either side; points that are sharper there are out of focus.
"""

import numpy as np

from pcii.core.focal_planes import FocalPlanes

PROBE_STEPS_PX = (-28.0, -14.0, 14.0, 28.0)
"""Distance of the probes from their plane, in px of total disparity; half of it is blur."""


def with_probes(planes: FocalPlanes, *, clear_px: float = 7.0) -> FocalPlanes:
    """The requested planes (Z,), followed by their probe planes.

    A probe less than `clear_px` of total disparity from a requested plane is left out, one less than half a
    probe step from another probe, and one whose total disparity would not be above 0 (beyond infinity).
    """
    requested, probes = planes.total_disparity_px, []
    if not requested.all():  # a single camera has no disparity at any depth
        return planes
    spacing = min(abs(step) for step in PROBE_STEPS_PX) / 2
    for total in requested:
        for step in PROBE_STEPS_PX:
            probe = total + step
            is_clear = np.all(np.abs(probe - requested) > clear_px - 1e-9)  # rounding of the sum
            if probe > 0 and is_clear and all(abs(probe - added) > spacing for added in probes):
                probes.append(probe)
    return planes.followed_by(probes)
