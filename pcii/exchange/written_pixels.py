"""Files of pixels that other tools read: PNG of 8 and 16 bits, PFM."""

from pathlib import Path

import numpy as np


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an image (H, W) or (H, W, 3), uint8 or uint16, as PNG.

    Pillow, which draws the other pictures, has no colour images of 16 bits.
    """
    import imagecodecs

    path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(image)))


def write_pfm(path: Path, values: np.ndarray) -> None:
    """Write a map (H, W) as float32 PFM: rows from the bottom to the top, the scale -1 for little endian.

    Debevec's Portable FloatMap, as described at https://netpbm.sourceforge.net/doc/pfm.html.
    """
    height, width = values.shape
    header = f"Pf\n{width} {height}\n-1\n".encode()
    path.write_bytes(header + values[::-1].astype("<f4").tobytes())
