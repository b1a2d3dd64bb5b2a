"""Outlines of regions to the pixel: where does a region's light end?

A pixel belongs to a region if the photons that meet there, in the section at the region's own depth, come
rather at the rate inside than at the rate around it, where there is only the dark and defocused light of
others. Both rates are local, so shading is no outline. The shortest outline that fits is found by minimising
total variation (Chan, Esedoglu and Nikolova 2006).
"""

import numpy as np

from pcii.imaging.bright_regions import SMALLEST_REGION_PX, dilated, large_pieces

LENGTH_NATS = 1.5
"""What an outline must earn per px of its length: a contour's next step is one of three or so, log 3 nats,
and it must pay for noise."""
ITERATIONS = 150
ROUNDS = 3
PHOTONS_PER_RATE = 100.0
NARROWEST_PX, WIDEST_PX = 2.0, 24.0
LEAST_INSIDE, LEAST_OUTSIDE = 0.05, 0.01
"""Rates inside are at least this share of the region's mean, which shadows are, and rates around it too, else
where no photon happened to land anything would be more likely than darkness."""
LARGEST_BIN_PX = 8
LARGEST_HOLE = 0.05
"""Holes of less than this share of a region are dark paint."""
SPILL, SPILL_PHOTONS = 0.2, 6.0
"""Views are shifted by whole pixels and so bring light of the inside beside it: if this share is expected
there, an outline lies where half of the light is left. Below 6 photons a pixel noise misplaces it more than
that, and more contrast between inside and outside helps more."""
AWAY_PX, FIRST_AWAY_PX = 2, 8
"""What is farther from a region is surely around it; at first, when its outline is known to cells only."""


def outlined(photons: np.ndarray, samples: np.ndarray, start: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """The region (H, W) bool that `start` (H, W) grows or shrinks to; nothing of `taken` (H, W).

    `photons` and `samples` (H, W, C) are the counts and the coverage of the section at the region's depth.
    """
    rate = float(photons.sum(axis=-1)[start].mean()) if start.any() else 0.0
    if rate <= 0:
        return np.zeros_like(start)
    inner = float(np.clip(np.sqrt(PHOTONS_PER_RATE / (4 * np.pi * rate)), NARROWEST_PX, WIDEST_PX))
    bin_px = int(np.clip(round(np.sqrt(1 / rate)), 1, LARGEST_BIN_PX))
    region = start
    for round_ in range(ROUNDS):
        # The start may be too small, so that what is right beside it is the region's own light.
        away_px = FIRST_AWAY_PX if round_ == 0 else AWAY_PX
        gain = _gain(photons, samples, region, taken, inner, away_px)
        region = _least_outline(gain, bin_px) & ~taken
        if not region.any():
            return region
    return _tidied(region, taken)


def _gain(
    photons: np.ndarray,
    samples: np.ndarray,
    region: np.ndarray,
    taken: np.ndarray,
    inner_px: float,
    away_px: int,
) -> np.ndarray:
    """Nats that each pixel gains by being inside, (H, W) float32; -50 where it cannot be."""
    outside = ~(taken | dilated(region, away_px))
    outer_px = max(inner_px, 10.0)
    rate = float(photons.sum(axis=-1)[region].mean())
    spill = SPILL * min(1.0, rate / SPILL_PHOTONS)
    gain = np.zeros(region.shape, np.float32)
    for c in range(photons.shape[-1]):
        K, V = photons[..., c], samples[..., c]
        whole = float(K[region].sum()) / max(float(V[region].sum()), 1.0)
        around = (float(K[outside].sum()) + 1) / max(float(V[outside].sum()), 1.0)
        inside_rate = np.maximum(_local_rate(K, V, region, inner_px), max(LEAST_INSIDE * whole, 1e-12))
        least = max(LEAST_OUTSIDE * whole, around, 1e-12)
        outside_rate = np.maximum(_local_rate(K, V, outside, outer_px), least)
        outside_rate = np.maximum(outside_rate, spill * inside_rate)
        gain += K * np.log(inside_rate / outside_rate) - V * (inside_rate - outside_rate)
    return np.where(taken, np.float32(-50), gain)


def _local_rate(K: np.ndarray, V: np.ndarray, where: np.ndarray, width_px: float) -> np.ndarray:
    """Photons per sample around each pixel, from the pixels of `where`; far from them their mean."""
    from scipy.ndimage import gaussian_filter

    own = (np.where(where, part, 0).astype(np.float32) for part in (K, V))
    photons, samples = (gaussian_filter(part, width_px) for part in own)
    mean = float(K[where].sum()) / max(float(V[where].sum()), 1.0)
    prior = np.float32(1e-3 * max(float(V.mean()), 1e-6))
    return (photons + np.float32(mean) * prior) / (samples + prior)


def _least_outline(gain: np.ndarray, bin_px: int) -> np.ndarray:
    """The mask of least outline, found on bins in which there is about a photon, then between them."""
    from scipy.ndimage import map_coordinates

    from pcii.removal.likelihood import outline_kernels as kernels

    H, W = gain.shape
    h, w = -(-H // bin_px), -(-W // bin_px)
    padded = np.pad(gain, ((0, h * bin_px - H), (0, w * bin_px - W)))
    binned = padded.reshape(h, bin_px, w, bin_px).sum(axis=(1, 3), dtype=np.float32)
    inside = np.empty((h, w), np.float32)
    kernels.least_outline(binned, LENGTH_NATS * bin_px, ITERATIONS, inside)
    if bin_px > 1:
        rows, cols = ((np.arange(size) + 0.5) / bin_px - 0.5 for size in (H, W))
        where = np.meshgrid(rows, cols, indexing="ij")
        inside = map_coordinates(inside, where, order=1, mode="nearest")
    return inside > 0.5


def _tidied(region: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Without small holes, then without specks."""
    from scipy.ndimage import binary_fill_holes

    holes = np.asarray(binary_fill_holes(region)) & ~region & ~taken
    small = holes & ~large_pieces(holes, LARGEST_HOLE * np.count_nonzero(region))
    return large_pieces(region | small, SMALLEST_REGION_PX)
