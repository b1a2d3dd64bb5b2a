"""Which planes are requested of an example, and which object belongs to which of them.

An object belongs to the requested plane that its median is nearest to, if within `NEAR_PX` of total
disparity, and to none of them beyond `FAR_PX`. In between, and where it leans over more than `LEANING_PX`
near a requested plane, it does not count.
"""

from typing import NamedTuple

import numpy as np

NEAR_PX, FAR_PX, LEANING_PX = 5.0, 12.0, 16.0
WALL_SHARE = 0.2
"""Objects that fill a larger share of the film, away from all planes that the scene names, are walls: they
are requested as often as not."""
NO_REQUEST, LEFT_OUT, EMPTY_PLANE = 0.15, 0.3, 0.2
"""Shares of examples without a request, of planes that are left out of one, and of requests for an empty
plane more."""
NOT_COUNTED = -1


class Request(NamedTuple):
    """Requested planes (R,), as fractions of the planes of an example, and the targets (N + 1,) of its
    objects.

    A target is the number of a plane, R for none of them, or `NOT_COUNTED`; the first is that of no object.
    """

    planes: np.ndarray
    targets: np.ndarray


def draw_request(
    objects: np.ndarray, named_planes: np.ndarray, plane_count: int, rng: np.random.Generator
) -> Request:
    """A random request for an example with these `objects` (N, 3) (see `training.examples`)."""
    middles = objects[:, 0]
    away = np.abs(middles[:, None] - named_planes).min(axis=1, initial=np.inf)
    walls = middles[(objects[:, 2] > WALL_SHARE) & (away > FAR_PX)]
    planes = np.concatenate(
        [named_planes[rng.random(named_planes.size) >= LEFT_OUT], walls[rng.random(walls.size) < 0.5]]
    )
    if rng.random() < EMPTY_PLANE:
        candidates = rng.uniform(0, plane_count - 1, 20)
        distance = np.abs(candidates[:, None] - np.concatenate([middles, planes])).min(axis=1, initial=np.inf)
        planes = np.concatenate([planes, candidates[distance > FAR_PX][:1]])
    planes = planes[(planes >= 0) & (planes <= plane_count - 1)]
    if rng.random() < NO_REQUEST:
        planes = planes[:0]
    planes = np.unique(planes)
    return Request(planes, targets_of(objects, planes))


def targets_of(objects: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """The target (N + 1,) of no object and of each of the `objects` (N, 3), int64."""
    targets = np.full(len(objects) + 1, NOT_COUNTED)
    if planes.size == 0:
        return targets
    targets[0] = planes.size
    distance = np.abs(objects[:, 0, None] - planes)
    nearest, reach = distance.min(axis=1), objects[:, 1]
    is_none = (nearest > FAR_PX) & (nearest - reach / 2 > NEAR_PX)
    is_near = (nearest <= NEAR_PX) & (reach <= LEANING_PX)
    targets[1:] = np.where(is_near, distance.argmin(axis=1), np.where(is_none, planes.size, NOT_COUNTED))
    return targets
