from typing import NamedTuple

import numpy as np
import pytest
from twins import bayer_photons, blocky_texture, patch_views, square_mask, unit_grid

from pcii.types import CameraGrid, PhotonCounts


class TwoSquares(NamedTuple):
    """Two textured squares on a dark field, photon-limited, and where they are."""

    grid: CameraGrid
    dense: np.ndarray
    counts: PhotonCounts
    z_mm: tuple[float, float]
    masks: tuple[np.ndarray, np.ndarray]


SIDE_PX = 72
CORNERS_PX = (44, 140)
DISPARITIES_PX = (3, 7)  # 7 x 7 views: 18 and 42 px of total disparity, 12 px of blur at the other depth
RATE = 0.06  # photons per pixel and view of the brightest texture; two per voxel


@pytest.fixture(scope="session")
def two_squares() -> TwoSquares:
    grid = unit_grid(7, 7, 256, 256)
    rng = np.random.default_rng(1)
    rates = np.zeros((*grid.shape_KLHW, 3))
    for corner, disparity in zip(CORNERS_PX, DISPARITIES_PX, strict=True):
        # Corner to corner along the diagonal, so that neither hides the other in any view.
        rates += patch_views(RATE * blocky_texture(rng, SIDE_PX, SIDE_PX), corner, corner, disparity, grid)
    dense = bayer_photons(rates, "GRBG", seed=1)
    counts = PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    first, second = (square_mask(grid, corner, corner, SIDE_PX) for corner in CORNERS_PX)
    z_mm = (1 / DISPARITIES_PX[0], 1 / DISPARITIES_PX[1])
    return TwoSquares(grid, dense, counts, z_mm, (first, second))
