"""Where between pixels objects end: the share of each pixel that its centre's object covers."""

import numpy as np

from pcii.types import CameraGrid
from simgen.build import Built
from simgen.rays import first_objects
from simgen.truth import towards_film

SAMPLES = 89
"""Rays through a pixel, on a Fibonacci lattice: any straight edge is told to about 2 / 89 of the pixel."""
_GENERATOR = 55
PART = 1 << 15
"""Pixels that are sampled at once."""


def coverage(built: Built, grid: CameraGrid, object_id: np.ndarray, x_mm: float, y_mm: float) -> np.ndarray:
    """Share (H, W) float32 of each pixel's square in which rays hit the object that its centre hits first.

    Seen from the camera at (x, y, 0), whose `object_id` (H, W) is given; what is no object (id 0) counts as
    one. A pixel is sampled if one of its eight neighbours has another id, else its share is 1: exact but
    for what is so thin that it passes between the centres of pixels.
    """
    share = np.ones(object_id.shape, dtype=np.float32)
    row, col = np.nonzero(_beside_another(object_id))
    down, right = _lattice()
    for start in range(0, row.size, PART):
        i, j = row[start : start + PART], col[start : start + PART]
        rays = towards_film(grid, i[:, None] + down, j[:, None] + right).reshape(-1, 3)
        found = first_objects(built, np.array([x_mm, y_mm, 0.0]), rays).reshape(i.size, SAMPLES)
        share[i, j] = (found == object_id[i, j, None]).mean(axis=1)
    return share


def _lattice() -> tuple[np.ndarray, np.ndarray]:
    """Offsets (row, column) from a pixel's centre of points that are spread evenly over its square."""
    number = np.arange(SAMPLES)
    return (number + 0.5) / SAMPLES - 0.5, (number * _GENERATOR % SAMPLES + 0.5) / SAMPLES - 0.5


def _beside_another(object_id: np.ndarray) -> np.ndarray:
    from scipy.ndimage import maximum_filter, minimum_filter

    most, least = maximum_filter(object_id, 3, mode="nearest"), minimum_filter(object_id, 3, mode="nearest")
    return np.asarray(most != least)
