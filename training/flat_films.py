"""Films that show no depth: even light, vignetting, shading, flicker and hot pixels.

They need no renderer. What the network is to learn from them is that there is no surface, at any light.
"""

import numpy as np

from pcii.types import CameraGrid, PhotonCounts, depth_of_total_disparity_mm

FLAT_FILM = "flat_film"
MAX_PHOTONS = 1e6
GRIDS = (3, 3), (5, 5), (10, 10), (10, 10), (15, 15)
SIDES_PX = 128, 192, 256, 384
FAR_PX, SPAN_PX = (4.0, 40.0), (4.0, 30.0)
"""Total disparity of the farthest plane that is named, and how much nearer the nearest is."""
HOT_SHARE = 1e-3


def draw_flat_film(rng: np.random.Generator, min_photons: float) -> tuple[PhotonCounts, np.ndarray]:
    """Photons of a film without depth, of any of the kinds or several of them at once, and named depths."""
    rows, cols = GRIDS[rng.integers(len(GRIDS))]
    height, width = rng.choice(SIDES_PX, 2).tolist()
    grid = CameraGrid(
        rows=rows, cols=cols, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.0704, height=height, width=width
    )
    far_px = rng.uniform(*FAR_PX)
    planes_px = far_px + rng.uniform(*SPAN_PX) * np.sort(rng.random(rng.integers(1, 4)))
    photons = np.exp(rng.uniform(np.log(min_photons), np.log(MAX_PHOTONS)))
    light = draw_light_without_depth(grid, rng)
    film = rng.poisson(light * (photons / light[0, 0].sum()))
    counts = PhotonCounts.from_dense(film, grid, cfa="GRBG" if rng.random() < 0.7 else None)
    return counts, depth_of_total_disparity_mm(grid, planes_px)


def draw_light_without_depth(grid: CameraGrid, rng: np.random.Generator) -> np.ndarray:
    """Light (K, L, H, W) that belongs to the films, or varies too slowly to show a depth."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in (grid.height, grid.width)), indexing="ij")
    light = np.ones(grid.shape_KLHW)
    if rng.random() < 0.4:  # vignetting
        light *= (1 + rng.uniform(0.1, 0.6) * (x**2 + y**2)) ** -2
    if rng.random() < 0.4:  # shading
        turn, phase = rng.uniform(0, 2 * np.pi, 2)
        light *= 1 + rng.uniform(0.1, 0.8) * np.sin(2 * (np.cos(turn) * x + np.sin(turn) * y) + phase)
    if rng.random() < 0.3:  # flicker
        light *= rng.uniform(1 - rng.uniform(0, 0.5), 1, (grid.rows, grid.cols, 1, 1))
    if rng.random() < 0.3:  # hot pixels
        light += rng.uniform(1, 20) * (rng.random((grid.height, grid.width)) < HOT_SHARE)
    return light
