"""Pictures of sections, masks and depth maps as 8-bit sRGB, and as PNG files."""

import base64
import io
from pathlib import Path

import numpy as np

from pcii.base.srgb import linear_to_srgb

PHOTO_QUALITY = 78
"""Of WebP: grain of single photons still looks like grain."""
LOSSLESS_PX = 16_384
"""Up to so many pixels single pixels are seen, and colours of neighbours must not mix."""
WHOLE = np.s_[:, :]
UNSURE = 0.5
"""Grey of depths without any confidence."""
AGREED, MISSED, WRONG = (235, 235, 235), (70, 130, 235), (235, 80, 50)
"""Colours of the comparison with the truth: claimed and true, true only, claimed only."""


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


def white_level(
    linear: np.ndarray, box: tuple[slice, slice] = WHOLE, samples: np.ndarray | None = None
) -> float:
    """The level to show as white in a box: the 98th percentile of the values above 0; 1 if there are none.

    With `samples`, of the shape of `linear`, each value counts as often as it has samples: means of
    few samples, as at the borders of a section, are noisy, and the brightest are not the brightest things.

    >>> mean, samples = np.array([[0.0, 0.1, 0.1, 1.0]]), np.array([[100, 100, 100, 1]])
    >>> white_level(mean), white_level(mean, samples=samples)
    (0.964, 0.1)
    """
    values = linear[box]
    lit = (values > 0) & np.isfinite(values)
    if not lit.any():
        return 1.0
    if samples is None:
        return float(np.quantile(values[lit], 0.98))
    return float(np.quantile(values[lit], 0.98, weights=samples[box][lit], method="inverted_cdf"))


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


def depth_image(
    z_mm: np.ndarray, near_mm: float, far_mm: float, confidence: np.ndarray | None = None
) -> np.ndarray:
    """Depth in viridis from near (bright) to far (dark), 8-bit RGB (H, W, 3); black where not finite.

    With `confidence` (H, W), from 0 to 1, colours are the greyer the less sure a depth is: darker ones would
    look like those of far depths, or like black.
    """
    from matplotlib import colormaps

    known = np.isfinite(z_mm)
    nearness = (far_mm - np.where(known, z_mm, far_mm)) / max(far_mm - near_mm, 1e-9)
    image = colormaps["viridis"](np.clip(nearness, 0, 1))[..., :3]
    if confidence is not None:
        image = UNSURE + (image - UNSURE) * np.where(known, confidence, 0)[..., None]
    return (image * known[..., None] * 255).astype(np.uint8)


def error_image(error: np.ndarray, limit: float) -> np.ndarray:
    """Signed errors (H, W), 8-bit RGB (H, W, 3): blue below 0, red above, saturated at `limit`.

    No error is nearly white; pixels without a number are black.

    >>> error_image(np.array([[-9.0, 9.0, np.nan]]), 3.0)[0].tolist()
    [[5, 48, 97], [103, 0, 31], [0, 0, 0]]
    """
    from matplotlib import colormaps

    known = np.isfinite(error)
    place = 0.5 + np.where(known, error, 0) / (2 * max(limit, 1e-30))
    image = colormaps["RdBu_r"](np.clip(place, 0, 1))[..., :3] * known[..., None]
    return np.round(image * 255).astype(np.uint8)


def png_bytes(image: np.ndarray) -> bytes:
    """An 8-bit RGB image (H, W, 3) as PNG."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def data_uri(image: np.ndarray) -> str:
    """An 8-bit RGB image as a data URI for HTML."""
    return uri_of("png", png_bytes(image))


def uri_of(kind: str, content: bytes) -> str:
    """A picture in a file of this kind, as a data URI."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def photo_bytes(image: np.ndarray) -> bytes:
    """An 8-bit RGB image, of which the eye would not miss the finest noise, as WebP.

    It takes about a fifth of the bytes of `png_bytes`. Small images keep every bit.
    """
    from PIL import Image

    buffer = io.BytesIO()
    lossless = image.shape[0] * image.shape[1] <= LOSSLESS_PX
    Image.fromarray(np.ascontiguousarray(image)).save(
        buffer, format="WEBP", quality=PHOTO_QUALITY, method=4, lossless=lossless
    )
    return buffer.getvalue()


def photo_uri(image: np.ndarray) -> str:
    """`photo_bytes` as a data URI."""
    return uri_of("webp", photo_bytes(image))


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an 8-bit RGB image (H, W, 3)."""
    from pcii.base.safe_files import write_bytes_safely

    write_bytes_safely(path, png_bytes(image))
