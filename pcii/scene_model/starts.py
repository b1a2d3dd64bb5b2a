"""Labellings to start the search from, by the posterior probability of depth."""

import numpy as np

from pcii.core.estimates import DepthPosterior
from pcii.scene_model.rays import Rays

SMOOTHINGS_BLOCKS = (0.0, 1.0, 2.0)
"""Standard deviations by which the posterior is smoothed: a start of the most probable labels each."""
QUANTILES = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Of the depth of what is probably a surface, from far to near: each place once with the far thing, once with
the near one."""


def starts_of(posterior: DepthPosterior, rays: Rays) -> list[np.ndarray]:
    """Labels (h, w) int16: the most probable ones of the posterior when smoothed, and quantiles of it."""
    from scipy.ndimage import gaussian_filter

    ladder_px = rays.planes.total_disparity_px
    places = [np.abs(ladder_px - px).argmin() for px in posterior.planes.total_disparity_px]
    label_of = np.array([-1, *places], np.int16)
    probability = np.concatenate([posterior.no_surface[None], posterior.probability])
    maps = [gaussian_filter(probability, blocks, axes=(1, 2)).argmax(axis=0) for blocks in SMOOTHINGS_BLOCKS]
    reached = np.cumsum(posterior.probability, axis=0) / np.maximum(1 - posterior.no_surface, 1e-6)
    for quantile in QUANTILES:
        plane = 1 + np.minimum((reached < quantile).sum(axis=0), len(places) - 1)
        maps.append(np.where(posterior.no_surface > 0.5, 0, plane))
    i, j = (
        np.minimum((np.arange(cells) * rays.cell_px + rays.cell_px // 2) // posterior.block_px, blocks - 1)
        for cells, blocks in zip(rays.shape, posterior.no_surface.shape, strict=True)
    )
    return [label_of[found][np.ix_(i, j)] for found in maps]
