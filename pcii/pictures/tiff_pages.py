"""Pages of TIFF files: grey, RGB or palettes, of up to 16 bits or of floats."""

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError

MOST_PAGES = 1 << 20
"""Most pages of a file."""
TYPES = ("bool", "uint8", "uint16", "float16", "float32", "float64")


def tiff_header(path: Path) -> dict[str, Any]:
    """What `Picture` says of the first page, and the number of pages; `InputError` if unsupported."""
    from tifffile import COMPRESSION, PHOTOMETRIC, TiffFile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # faults are raised, not logged
    with TiffFile(path) as file:
        count = len(file.pages)
        if not 1 <= count <= MOST_PAGES:
            raise InputError(f"has {count} pages; expected 1 to {MOST_PAGES}")
        page: Any = file.pages[0]
        known = {PHOTOMETRIC.MINISBLACK, PHOTOMETRIC.MINISWHITE, PHOTOMETRIC.RGB, PHOTOMETRIC.CFA}
        palette = page.photometric == PHOTOMETRIC.PALETTE and str(page.dtype) in ("bool", "uint8")
        # Decoded to RGB with the rest of JPEG.
        jpeg = page.photometric == PHOTOMETRIC.YCBCR and page.compression == COMPRESSION.JPEG
        if page.photometric not in known and not palette and not jpeg:
            name = getattr(page.photometric, "name", page.photometric)
            raise InputError(f"a TIFF picture of the kind {name}; save it as RGB or grey")
        if str(page.dtype) not in TYPES:
            raise InputError(f"has pixels of the type {page.dtype}; save it in 8 or 16 bits, or as float32")
        dtype, alpha = np.dtype(page.dtype), len(page.extrasamples) == 1
        fewer = dtype.kind == "u" and page.bitspersample < 8 * dtype.itemsize and not palette
        return {
            "shape": (page.imagelength, page.imagewidth, 3 if palette else page.samplesperpixel - alpha),
            "dtype": np.dtype(np.uint8) if palette else dtype,
            "pages": count,
            "bits": page.bitspersample if fewer else None,
            "alpha": alpha,
            "orientation": page.tags.valueof(274, default=1),
        }


def decode_tiff(path: Path, most: int) -> Iterator[np.ndarray]:
    """Pixels of each page, (H, W) or (H, W, C); `InputError` for a page of another size than the first.

    `most` is the number of full light, from which those of pages count down whose 0 is white.
    """
    from tifffile import PHOTOMETRIC, TiffFile

    with TiffFile(path) as file:
        size = None
        for index in range(len(file.pages)):
            page: Any = file.pages[index]
            size = size or page.shape
            if page.shape != size:
                raise InputError(f"page {index} is of the shape {page.shape}, the first of {size}")
            pixels = np.asarray(page.asarray(maxworkers=1))
            if page.axes.startswith("S"):
                pixels = np.moveaxis(pixels, 0, -1)
            if page.photometric == PHOTOMETRIC.PALETTE:
                numbers, *alpha = np.moveaxis(pixels.reshape(*pixels.shape[:2], -1).astype(np.uint8), -1, 0)
                pixels = np.dstack([(page.colormap >> 8).astype(np.uint8).T[numbers], *alpha])
            elif page.photometric == PHOTOMETRIC.MINISWHITE:
                pixels = (most - pixels).astype(pixels.dtype)
            yield pixels
