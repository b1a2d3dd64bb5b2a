"""Light, masks, depth and errors as 8-bit sRGB pictures, and their files."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.safe_files import write_bytes_safely
from pcii.base.srgb import linear_to_srgb

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


def to_srgb8(linear: np.ndarray, white: float) -> np.ndarray:
    """Linear values (H, W) or (H, W, C) as 8-bit sRGB (H, W, 3); `white` and above become 255.

    >>> to_srgb8(np.array([[0.0, 0.5, 1.0]]), white=1.0)[0, :, 0].tolist()
    [0, 188, 255]
    """
    encoded = linear_to_srgb(np.nan_to_num(linear) / max(white, 1e-30))
    image = np.round(255 * encoded).astype(np.uint8)
    if image.ndim == 2:
        image = image[..., None]
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


def depth_image(
    z_mm: np.ndarray, near_mm: float, far_mm: float, confidence: np.ndarray | None = None
) -> np.ndarray:
    """Depth (H, W) from near (yellow) to far (violet), paler where less sure, grey where not finite."""
    return map_image(z_mm, DEPTH_COLOURS, (near_mm, far_mm), confidence)


def png_bytes(image: np.ndarray) -> bytes:
    """An 8-bit RGB image (H, W, 3) as PNG."""
    return _file_bytes(image, "PNG", optimize=True)


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an 8-bit RGB image (H, W, 3)."""
    write_bytes_safely(path, png_bytes(image))


def drawing_uri(image: np.ndarray) -> str:
    """An 8-bit RGB image as a data URI that keeps every bit."""
    return uri_of("png", png_bytes(image))


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
