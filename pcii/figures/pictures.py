"""Arrays as 8-bit sRGB pictures, and their files."""

import base64
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import block_sums, linear_to_srgb, write_bytes_safely

DEPTH_COLOURS, ERROR_COLOURS, SHARE_COLOURS = "viridis_r", "RdBu_r", "magma"
"""Colour maps of Matplotlib: depth, near is bright; signed errors; confidence, more is bright."""
NO_ANSWER = (128, 128, 128)
"""Grey where there is no value. None of the colour maps has it, nor a colour of depth mixed with white."""
AGREED, MISSED, WRONG = (235, 235, 235), (70, 130, 235), (235, 80, 50)
"""Colours of the comparison with the truth: claimed and true, true only, claimed only."""
PHOTO_QUALITY = 78
"""Of WebP: grain of single photons still looks like grain."""
LOSSLESS_PX = 16_384
"""Largest picture, in pixels, that is stored without loss: pages enlarge it, and neighbours must not mix."""
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


def to_srgb8(linear: np.ndarray, white: float) -> np.ndarray:
    """Linear values (H, W) or (H, W, C) as 8-bit sRGB (H, W, 3); `white` and above become 255.

    >>> to_srgb8(np.array([[0.0, 0.5, 1.0]]), white=1.0)[0, :, 0].tolist()
    [0, 188, 255]
    """
    encoded = linear_to_srgb(np.nan_to_num(linear) / max(white, 1e-30))
    image = np.round(255 * encoded).astype(np.uint8)
    image = image if image.ndim == 3 else image[..., None]
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image


def white_level(linear: np.ndarray, samples: np.ndarray | None = None) -> float:
    """The level to show as white: the 98th percentile of the values above 0; 1 if there are none.

    With `samples`, of the shape of `linear`, each value counts as often as it has samples: means of
    few samples, as at the borders of a section, are noisy, and the brightest are not the brightest things.

    >>> mean, samples = np.array([[0.0, 0.1, 0.1, 1.0]]), np.array([[100, 100, 100, 1]])
    >>> white_level(mean), white_level(mean, samples)
    (0.964, 0.1)
    """
    lit = (linear > 0) & np.isfinite(linear)
    if not lit.any():
        return 1.0
    if samples is None:
        return float(np.quantile(linear[lit], 0.98))
    return float(np.quantile(linear[lit], 0.98, weights=samples[lit], method="inverted_cdf"))


def block_px(shape: Sequence[int], longest_px: int) -> int:
    """Side of the blocks of which an image (H, W, ...) has at most `longest_px` in a row or column."""
    return -(-max(shape[0], shape[1], 1) // longest_px)


def _image_block_sums(image: np.ndarray, step_px: int) -> np.ndarray:
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
        [_image_block_sums(counts, DENSITY_PX).sum(axis=-1).ravel() for counts in sections]
    )
    lit = squares[squares > 0].astype(np.float64)
    if not lit.size:
        return 0.0
    neighbours = float(np.quantile(lit, 0.5, weights=lit, method="inverted_cdf")) - 1  # of a photon
    density = max(neighbours, 1.0) / DENSITY_PX**2
    sigma = float(np.sqrt(SHOWN_PHOTONS / (4 * np.pi * density)))
    return round(sigma, 1) if sigma >= MIN_SMOOTHING_PX else 0.0


def smoothed(sums: np.ndarray, samples: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Sums and numbers of samples (h, w, C), each averaged by a Gaussian: their ratio is a mean again."""
    from scipy.ndimage import gaussian_filter

    sigmas = sigma, sigma, 0
    return gaussian_filter(sums.astype(float), sigmas), gaussian_filter(samples.astype(float), sigmas)


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


def exposed(
    images: Iterable[tuple[np.ndarray, np.ndarray]], step_px: int, smoothing_px: float = 0.0
) -> list[np.ndarray]:
    """8-bit pictures of images, each given by sums and numbers of samples (H, W, C), at the same exposure.

    They are shown in blocks of `step_px` x `step_px` pixels, smoothed by a Gaussian with a standard deviation
    of `smoothing_px` pixels.
    """
    blocks = list[tuple[np.ndarray, np.ndarray]]()
    for image in images:
        sums, samples = (_image_block_sums(values, step_px) for values in image)
        if smoothing_px:
            sums, samples = smoothed(sums, samples, smoothing_px / step_px)
        blocks.append((filled_means(sums, samples), samples))
    white = max(white_level(*block) for block in blocks)
    return [to_srgb8(means, white) for means, _ in blocks]


def photon_picture(counts: np.ndarray, step_px: int) -> np.ndarray:
    """8-bit picture of the photon counts (H, W) of one view: the photons in blocks, one or more are white."""
    sums = _image_block_sums(counts[..., None], step_px)
    return to_srgb8(sums, max(1.0, white_level(sums)))


def mask_image(mask: np.ndarray) -> np.ndarray:
    """A mask (H, W) in black and white, 8-bit RGB (H, W, 3)."""
    return np.repeat(np.where(mask, 255, 0).astype(np.uint8)[..., None], 3, axis=2)


def agreement_image(claimed: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Comparison of masks, 8-bit RGB (H, W, 3): agreed light grey, missed blue, wrongly claimed red."""
    image = np.zeros((*true.shape, 3), np.uint8)
    image[claimed & true] = AGREED
    image[~claimed & true] = MISSED
    image[claimed & ~true] = WRONG
    return image


def map_image(
    values: np.ndarray, colours: str, limits: tuple[float, float], confidence: np.ndarray | None = None
) -> np.ndarray:
    """Values (H, W) between two limits in a colour map, 8-bit RGB (H, W, 3); `NO_ANSWER` where not finite.

    With `confidence` (H, W), from 0 to 1, colours are the paler the less sure a value is: darker ones would
    look like those of far depths.

    >>> map_image(np.array([[-9.0, 9.0, np.nan]]), ERROR_COLOURS, (-3, 3))[0].tolist()
    [[5, 48, 97], [103, 0, 31], [128, 128, 128]]
    """
    from matplotlib import colormaps

    low, high = limits
    is_known = np.isfinite(values)
    place = (np.where(is_known, values, low) - low) / max(high - low, 1e-30)
    image = colormaps[colours](np.clip(place, 0, 1))[..., :3]
    if confidence is not None:
        image = 1 + (image - 1) * np.where(is_known, confidence, 0)[..., None]
    image = np.round(255 * image).astype(np.uint8)
    image[~is_known] = NO_ANSWER
    return image


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an 8-bit RGB image (H, W, 3)."""
    write_bytes_safely(path, _file_bytes(image, "PNG", optimize=True))


def drawing_uri(image: np.ndarray) -> str:
    """An 8-bit RGB image as a data URI that keeps every bit."""
    return uri_of("png", _file_bytes(image, "PNG", optimize=True))


def photo_uri(image: np.ndarray) -> str:
    """An 8-bit RGB image, of which the eye would not miss the finest noise, as a data URI of a WebP.

    It takes about a fifth of the bytes of `drawing_uri`. Small images keep every bit.
    """
    is_small = image.shape[0] * image.shape[1] <= LOSSLESS_PX
    return uri_of("webp", _file_bytes(image, "WEBP", quality=PHOTO_QUALITY, method=4, lossless=is_small))


def uri_of(kind: str, content: bytes) -> str:
    """A picture in a file of this kind, as a data URI for HTML."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _file_bytes(image: np.ndarray, kind: str, **options: Any) -> bytes:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(buffer, format=kind, **options)
    return buffer.getvalue()
