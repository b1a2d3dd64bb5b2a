"""Where between pixels objects end: the share of each pixel that its centre's object covers."""

from functools import reduce

import numpy as np

from simgen.cameras.rig import Camera
from simgen.renderer.intersection import first_objects
from simgen.renderer.mitsuba_scene import RenderScene

SAMPLES = 233
"""Rays through a pixel, on a Fibonacci lattice. An edge along one of its lines is worst: half of the some
15 points of a line may be on the wrong side, 3 % of the pixel; most edges are known to 1 %."""
_GENERATOR = 144
PART = 1 << 13
"""Pixels that are sampled at once."""


def over_squares(pick: np.ufunc, values: np.ndarray, side: int) -> np.ndarray:
    """`pick`, as `numpy.maximum`, over every square of `side` x `side` places that lies in a map (H, W).

    (H - `side` + 1, W - `side` + 1): pad the map first for values up to its border.

    >>> over_squares(np.maximum, np.array([[1, 0, 0, 2], [0, 3, 0, 0]]), 2).tolist()
    [[3, 3, 2]]
    """
    for _ in range(2):  # along rows, then along columns
        count = len(values) - side + 1
        values = reduce(pick, (values[first : first + count] for first in range(side))).T
    return values


def coverage(render_scene: RenderScene, camera: Camera, object_id: np.ndarray) -> np.ndarray:
    """Share (H, W) float32 of each pixel's square in which rays hit the object that its centre hits first.

    Seen by the camera, without its lens, whose `object_id` (H, W) is given; what is no object (id 0)
    counts as one. A pixel is sampled if it lies at the frame or one of its eight neighbours has another id,
    else its share is 1: what is lost is only what passes between the centres of pixels.
    """
    share = np.ones(object_id.shape, dtype=np.float32)
    row, col = np.nonzero(_beside_another(object_id))
    down, right = _lattice()
    for start in range(0, row.size, PART):
        i, j = row[start : start + PART], col[start : start + PART]
        rays = camera.towards(i[:, None] + down, j[:, None] + right).reshape(-1, 3)
        found = first_objects(render_scene, camera.position_mm, rays).reshape(i.size, SAMPLES)
        share[i, j] = (found == object_id[i, j, None]).mean(axis=1)
    return share


def _lattice() -> tuple[np.ndarray, np.ndarray]:
    """Offsets (row, column) from a pixel's centre of points that are spread evenly over its square."""
    number = np.arange(SAMPLES)
    return (number + 0.5) / SAMPLES - 0.5, (number * _GENERATOR % SAMPLES + 0.5) / SAMPLES - 0.5


def _beside_another(object_id: np.ndarray) -> np.ndarray:
    # No object has the id -1: what stands beyond the frame is another for all we know.
    framed = np.pad(object_id, 1, constant_values=-1)
    return over_squares(np.maximum, framed, 3) != over_squares(np.minimum, framed, 3)
