"""Files that a scene brings along: found only inside its folder, checked before anything uses them."""

from pathlib import Path

import numpy as np

from pcii.errors import InputError

LARGEST_TEXTURE_PIXELS = 1 << 26


def asset(folder: Path, name: str, where: str) -> Path:
    """A file of a scene, which must lie inside the scene's folder."""
    root = folder.resolve()
    path = (root / name).resolve()
    if not path.is_relative_to(root):
        raise InputError(f"{where}: {name!r} lies outside the scene's folder")
    if not path.is_file():
        raise InputError(f"{where}: there is no file {name!r} in {folder}")
    return path


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 sRGB in [0, 1] to linear."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def read_image(path: Path) -> np.ndarray:
    """An image file as linear RGB, (H, W, 3) float32; size checked before it is decoded."""
    from PIL import Image

    try:
        with Image.open(path, formats=("PNG", "JPEG", "TIFF")) as image:
            if image.width * image.height > LARGEST_TEXTURE_PIXELS:
                raise InputError(
                    f"{path}: {image.width} x {image.height} pixels is more than a texture may "
                    f"have ({LARGEST_TEXTURE_PIXELS})"
                )
            pixels = np.asarray(image.convert("RGB"))
    except (OSError, SyntaxError, Image.DecompressionBombError) as fault:
        raise InputError(f"{path}: cannot be read as an image ({fault})") from None
    table = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
    return table[pixels]
