"""Focus from the Poisson likelihood: where do the photons say that the surface is?

Let K be the count at a voxel of the section at z and V its coverage. If the surface is at z, all
samples of the voxel share one rate, and the profile log-likelihood over a window is the sum of
K log(K / V) - K. Maximising it over z is minimising the entropy of where the photons land, Eq. 9 of
Muniraj et al. 2017 with the right statistics. From it we take what a flat patch of the same mean
would give, so that the score of a patch without texture has mean 0 and a known spread.

References: Muniraj et al. 2017 for Eq. 9; the identity of likelihood and entropy follows from
setting each voxel's rate to its maximum-likelihood value K / V.
"""

from functools import cache

import numpy as np

from pcii import statistics
from pcii.geometry import landing
from pcii.photon_counts import PhotonCounts
from pcii.reconstruct import coverage_of

BLOCK_PX = 2
"""Voxels of 2 x 2 pixels: whatever the shifts, each block is covered equally by each Bayer colour.

Single pixels are not. At depths where all shifts are even a colour falls on every fourth voxel only,
where photons have four times as many partners, and textured patches would be drawn to such depths.
"""
CELL_PX = 4
"""Scores are kept on cells of 4 x 4 pixels: windows are far larger."""
BLOCKS = CELL_PX // BLOCK_PX
LARGEST_RATE = 64.0
"""Above this rate the expectation for a flat patch follows its asymptotic form."""


def focus_scores(counts: PhotonCounts, z_mm: np.ndarray, *, sigma_px: float) -> np.ndarray:
    """Log-likelihood ratio of depth z against a flat patch, (Z, H / 4, W / 4) float64, in nats.

    Summed over the colours and over a Gaussian window of `sigma_px` (weight 1 at its centre), on
    cells of 4 x 4 pixels; H and W are rounded up to whole cells.
    """
    return np.stack([_plane_score(counts, depth, sigma_px) for depth in z_mm])


def flat_deviation(counts: PhotonCounts, z_mm: float, *, sigma_px: float) -> np.ndarray:
    """Standard deviation that `focus_scores` has over a flat patch, (H / 4, W / 4) float64, in nats.

    The patch has the mean that the counts have around each cell in the section at z.
    """
    from scipy.ndimage import gaussian_filter

    sigma = sigma_px / CELL_PX
    variance = np.zeros(cell_shape(counts))
    for photons in _block_counts(counts, z_mm):
        rate = gaussian_filter(_sum_on_cells(photons), sigma, mode="constant") / BLOCKS**2
        variance += np.interp(rate, *_noise_table())
    # The squares of weights that are 1 at the centre sum to pi sigma^2 cells.
    return np.sqrt(np.pi * sigma**2 * BLOCKS**2 * variance)


def photons_nearby(counts: PhotonCounts, z_mm: np.ndarray, *, sigma_px: float) -> np.ndarray:
    """Photons of all colours in a Gaussian window (weight 1 at its centre), (Z, H / 4, W / 4)."""
    from scipy.ndimage import gaussian_filter

    sigma = sigma_px / CELL_PX
    planes = (_sum_on_cells(_block_counts(counts, depth).sum(axis=0)) for depth in z_mm)
    smooth = (gaussian_filter(plane, sigma, mode="constant") for plane in planes)
    return np.stack([2 * np.pi * sigma**2 * plane for plane in smooth])


def _plane_score(counts: PhotonCounts, z_mm: float, sigma_px: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter
    from scipy.special import xlogy

    K = _block_counts(counts, z_mm)
    V = _block_coverage(counts, z_mm)
    occupied = np.nonzero(K)
    information = np.zeros(K.shape)
    information[occupied] = K[occupied] * np.log(K[occupied] / V[occupied])
    sigma = sigma_px / CELL_PX
    score = np.zeros((K.shape[1] // BLOCKS, K.shape[2] // BLOCKS))
    for colour in range(counts.channel_count):
        own, photons, samples = (
            gaussian_filter(_sum_on_cells(values[colour]), sigma, mode="constant")
            for values in (information, K, V)
        )
        rate = photons / np.maximum(samples, 1e-9)
        # The window's own mean coverage: near borders some of the window is covered less or not at all.
        blocks = gaussian_filter(_sum_on_cells((V[colour] > 0).astype(np.float64)), sigma, mode="constant")
        coverage = samples / np.maximum(blocks, 1e-9)
        score += own - blocks * (flat_information(rate * coverage) - xlogy(rate * coverage, coverage))
    # The filter's weights sum to 1; with weight 1 at the centre they sum to 2 pi sigma^2.
    return 2 * np.pi * sigma**2 * score


def _block_counts(counts: PhotonCounts, z_mm: float) -> np.ndarray:
    """Photons of the section at z by colour and block, (C, blocks, blocks) float64."""
    events = counts.events
    row, col, inside = landing(counts.grid, events, z_mm)
    height, width = (n * BLOCKS for n in cell_shape(counts))
    block = (row[inside] // BLOCK_PX) * width + col[inside] // BLOCK_PX
    flat = counts.event_colours[inside] * (height * width) + block
    size = counts.channel_count * height * width
    return np.bincount(flat, events.n[inside], minlength=size).reshape(-1, height, width)


def _block_coverage(counts: PhotonCounts, z_mm: float) -> np.ndarray:
    """Samples of the section at z by colour and block, (C, blocks, blocks) float64."""
    coverage = np.moveaxis(coverage_of(counts.grid, counts.cfa, counts.channel_count, z_mm, 1), -1, 0)
    _, H, W = coverage.shape
    height, width = (n * CELL_PX for n in cell_shape(counts))
    whole = np.pad(coverage, ((0, 0), (0, height - H), (0, width - W)))
    pairs = whole.reshape(-1, height // BLOCK_PX, BLOCK_PX, width // BLOCK_PX, BLOCK_PX)
    return pairs.sum(axis=(2, 4), dtype=np.float64)


def _sum_on_cells(blocks: np.ndarray) -> np.ndarray:
    height, width = blocks.shape[0] // BLOCKS, blocks.shape[1] // BLOCKS
    return blocks.reshape(height, BLOCKS, width, BLOCKS).sum(axis=(1, 3))


def cell_shape(counts: PhotonCounts) -> tuple[int, int]:
    """Cells of the coarse grid, (H / 4, W / 4) rounded up."""
    return -(-counts.grid.height // CELL_PX), -(-counts.grid.width // CELL_PX)


def cells_to_pixels(cells: np.ndarray, counts: PhotonCounts) -> np.ndarray:
    """Values on cells (H / 4, W / 4) as values on pixels (H, W), each cell constant."""
    return statistics.cells_to_pixels(cells, CELL_PX, counts.grid)


def flat_information(rate: np.ndarray) -> np.ndarray:
    """E[K log K] of a Poisson variable K with this mean: the information of a flat patch, in nats."""
    rates, values = _information_table()
    inside = np.interp(rate, rates, values)
    # Expanding K log K about the mean: r log r + 1/2 + 1 / (12 r), good to 3e-5 from 64 on.
    large = np.maximum(rate, LARGEST_RATE)
    asymptotic = large * np.log(large) + 0.5 + 1 / (12 * large)
    return np.where(rate < LARGEST_RATE, inside, asymptotic)


@cache
def _poisson_table() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates (R,), counts (N,) and probabilities (R, N) of a Poisson variable."""
    from scipy.special import gammaln, xlogy

    rates = np.linspace(0, np.sqrt(LARGEST_RATE), 4096) ** 2
    k = np.arange(0.0, LARGEST_RATE + 14 * np.sqrt(LARGEST_RATE))
    return rates, k, np.exp(xlogy(k, rates[:, None]) - rates[:, None] - gammaln(k + 1))


@cache
def _information_table() -> tuple[np.ndarray, np.ndarray]:
    from scipy.special import xlogy

    rates, k, probability = _poisson_table()
    return rates, probability @ xlogy(k, k)


@cache
def _noise_table() -> tuple[np.ndarray, np.ndarray]:
    """Variance of K log K about its regression on K: the mean is fitted, so that part does not count.

    It tends to 1/2, the variance of half a chi-square variable.
    """
    from scipy.special import xlogy

    rates, k, probability = _poisson_table()
    value = xlogy(k, k)
    mean = probability @ value
    variance = probability @ value**2 - mean**2
    covariance = probability @ (value * k) - mean * rates
    residual = variance - covariance**2 / np.maximum(rates, 1e-12)
    return rates, np.maximum(residual, 0.0)
