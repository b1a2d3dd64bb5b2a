"""Depth from the posterior probability of a piecewise smooth surface, by the evidence of texture.

Blocks without evidence follow their neighbours, and where there is none at all the posterior still has a
largest value. So whether a surface is seen is decided apart: there are photons, and two halves of the cameras
show the same structure (`pcii.evidence.half_agreement`).
"""

from dataclasses import dataclass, field

import numpy as np

from pcii.core.estimates import DepthMap
from pcii.core.focal_planes import FocalPlanes
from pcii.core.geometry import depth_of_total_disparity_mm
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.depth.smooth_surface import SurfacePrior, surface_posterior
from pcii.evidence.cells import CELL_PX
from pcii.evidence.half_agreement import halves_of, least_agreement
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.evidence.texture_evidence import CELL_BLOCKS, TextureModel, evidence_of_texture
from pcii.sections.photon_statistics import cells_to_pixels

MOST_VALUES = 1 << 26
"""Blocks times planes, which decides on the memory: some 2 GB. Where there are more, blocks are larger."""


@dataclass(frozen=True)
class PosteriorDepth:
    """The method with its constants; docs/experiments/depth.md has what they change."""

    model: TextureModel = field(default_factory=TextureModel)
    prior: SurfacePrior = field(default_factory=SurfacePrior)
    step_px: float = 1.0
    """Total disparity between planes."""
    block_px: int = 2
    window_px: float = 8.0
    """Standard deviation of the window in which there are to be photons."""
    least_photons: float = 10.0
    """Their least number, in a Gaussian of weight 1 at its centre."""

    def __call__(self, data: PhotonCounts | Views, z_range_mm: tuple[float, float]) -> DepthMap:
        """Depth (H, W), and the posterior probability that it is within a plane, 1 px, of the truth."""
        planes = FocalPlanes.between(data.grid, *z_range_mm, self.step_px)
        block_px = self.block_px
        while len(planes) * data.grid.height * data.grid.width / block_px**2 > MOST_VALUES:
            block_px *= 2
        if isinstance(data, PhotonCounts):
            data = without_hot_pixels(data)
        evidence = evidence_of_texture(data, planes, block_px, self.model)
        posterior = surface_posterior(evidence.nats, self.prior)
        best, confidence, total_px = _most_probable(posterior, planes.total_disparity_px)
        seen = self._has_photons(evidence.photons, best, block_px)
        if isinstance(data, PhotonCounts):
            seen &= _halves_agree(data, planes, best, block_px)
        depth = np.where(seen, depth_of_total_disparity_mm(data.grid, total_px), np.nan)
        confidence = np.where(seen, confidence, 0.0)
        return DepthMap(*(cells_to_pixels(part, block_px, data.grid) for part in (depth, confidence)))

    def _has_photons(self, photons: np.ndarray, best: np.ndarray, block_px: int) -> np.ndarray:
        """Whether there are enough photons (h, w) around a block at the plane `best` (h, w)."""
        from scipy.ndimage import gaussian_filter

        sigma = self.window_px / (block_px * CELL_BLOCKS)
        around = gaussian_filter(photons, sigma, mode="constant", axes=(1, 2)) * (2 * np.pi * sigma**2)
        i, j = (np.arange(size) // CELL_BLOCKS for size in best.shape)
        return around[best, i[:, None], j] >= self.least_photons


def _halves_agree(counts: PhotonCounts, planes: FocalPlanes, best: np.ndarray, block_px: int) -> np.ndarray:
    """Whether two halves of the cameras agree (h, w) that there is structure at the plane `best` (h, w).

    Structure is there at neighbouring planes as well, so that every other one is enough.
    """
    every_other = planes.take(slice(None, None, 2))
    i, j = (
        np.minimum(np.arange(-(-size // CELL_PX)) * CELL_PX // block_px, blocks - 1)
        for size, blocks in zip((counts.grid.height, counts.grid.width), best.shape, strict=True)
    )
    plane = best[np.ix_(i, j)] // 2
    t = halves_of(counts, every_other).agreement(plane, np.ones(plane.shape, bool))
    agree = cells_to_pixels(t >= least_agreement(len(every_other)), CELL_PX, counts.grid)
    return agree[::block_px, ::block_px]


def _most_probable(posterior: np.ndarray, total_px: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The plane (h, w) most probable with its neighbours, their probability, and the mean disparity there.

    The mean is of two planes on either side.
    """
    near = _over_neighbours(posterior)
    best = near.argmax(axis=-1)
    at = best[..., None] + np.arange(-2, 3)
    inside = (at >= 0) & (at < total_px.size)
    at = np.clip(at, 0, total_px.size - 1)
    weight = np.where(inside, np.take_along_axis(posterior, at, axis=-1), 0).astype(np.float64)
    mean_px = (weight * total_px[at]).sum(axis=-1) / weight.sum(axis=-1)
    confidence = np.take_along_axis(near, best[..., None], axis=-1)[..., 0]
    return best, np.minimum(confidence, 1.0), mean_px


def _over_neighbours(values: np.ndarray) -> np.ndarray:
    """Sums of each plane and the planes on either side (h, w, Z)."""
    total = values.copy()
    total[..., 1:] += values[..., :-1]
    total[..., :-1] += values[..., 1:]
    return total
