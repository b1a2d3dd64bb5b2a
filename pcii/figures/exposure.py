"""How photons become an image: blocks, smoothing, means, one exposure for several images."""

from collections.abc import Iterable, Sequence

import numpy as np

from pcii.base.blocks import block_sums
from pcii.figures.pictures import to_srgb8, white_level

PANEL_PX = 320
"""Pictures with longer sides are drawn in blocks of 2 x 2 pixels or more: a panel has about as many dots on a
screen, so single photons are still seen."""
SHOWN_PHOTONS = 80
"""Photons under the Gaussian with which few photons are smoothed: their noise is then 11 %. Far more would
blur what is small, far fewer leave colours that are noise."""
MIN_SMOOTHING_PX = 0.5
"""A narrower Gaussian is left out: a pixel would keep most of its weight."""
DENSITY_PX = 8
"""Side of the squares in which photons are counted to find how dense they are."""


def block_px(shape: Sequence[int], longest_px: int) -> int:
    """Side of the blocks of which an image (H, W, ...) has at most `longest_px` in a row or column."""
    return -(-max(shape[0], shape[1], 1) // longest_px)


def image_block_sums(image: np.ndarray, step_px: int) -> np.ndarray:
    """Sums over blocks of an image (H, W, C), as int64 or float64; infinite ones are no error."""
    with np.errstate(over="ignore", invalid="ignore"):
        return block_sums(image, step_px, np.float64 if image.dtype.kind == "f" else np.int64, (0, 1))


def smoothing_for(sections: Sequence[np.ndarray]) -> float:
    """Standard deviation of the Gaussian with which photons (H, W, C) are shown, in pixels; 0 for very many.

    `SHOWN_PHOTONS` are under it at the median of their densities, which a hot pixel does not move: a Gaussian
    averages over 4 pi sigma^2 pixels.

    >>> smoothing_for([np.ones((80, 80, 1), int)]), smoothing_for([np.full((80, 80, 3), 9)])
    (2.5, 0.0)
    """
    squares = np.concatenate(
        [image_block_sums(counts, DENSITY_PX).sum(axis=-1).ravel() for counts in sections]
    )
    lit = squares[squares > 0].astype(np.float64)
    if not lit.size:
        return 0.0
    beside = float(np.quantile(lit, 0.5, weights=lit, method="inverted_cdf")) - 1  # the others of a photon
    density = max(beside, 1.0) / DENSITY_PX**2
    sigma = float(np.sqrt(SHOWN_PHOTONS / (4 * np.pi * density)))
    return round(sigma, 1) if sigma >= MIN_SMOOTHING_PX else 0.0


def smoothed(sums: np.ndarray, samples: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Sums and numbers of samples (h, w, C), each averaged by a Gaussian: their ratio is a mean again."""
    from scipy.ndimage import gaussian_filter

    first, second = (
        gaussian_filter(values.astype(np.float64), (sigma, sigma, 0)) for values in (sums, samples)
    )
    return first, second


def filled_means(sums: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Mean per sample (h, w, C) of blocks with these sums and numbers of samples.

    A block without a sample of a colour has the mean of the 3 x 3 blocks around, so that nothing has a tint;
    0 if those have none either.
    """
    from scipy.ndimage import correlate

    empty = samples <= 0
    if empty.any():
        square = np.ones((3, 3, 1))
        sums, samples = (
            np.where(empty, correlate(values, square, mode="constant"), values) for values in (sums, samples)
        )
    means = np.zeros(sums.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.divide(sums, samples, out=means, where=samples > 0)


def encoded(blocks: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """8-bit pictures of block estimates with their samples, all at the same exposure."""
    white = max(white_level(estimate, samples) for estimate, samples in blocks)
    return [to_srgb8(estimate, white) for estimate, _ in blocks]


def exposed(images: Iterable[tuple[np.ndarray, np.ndarray]], step_px: int) -> list[np.ndarray]:
    """8-bit pictures of images, each given by sums and numbers of samples (H, W, C), at the same exposure.

    They are shown in blocks of `step_px` x `step_px` pixels.
    """
    blocks: list[tuple[np.ndarray, np.ndarray]] = []
    for sums, samples in images:
        sums, samples = image_block_sums(sums, step_px), image_block_sums(samples, step_px)
        blocks.append((filled_means(sums, samples), samples))
    return encoded(blocks)


def photon_picture(counts: np.ndarray, step_px: int) -> np.ndarray:
    """8-bit picture of the photon counts (H, W) of one view: the photons in blocks, one or more are white."""
    sums = image_block_sums(counts[..., None], step_px)
    return to_srgb8(sums, max(1.0, white_level(sums)))
