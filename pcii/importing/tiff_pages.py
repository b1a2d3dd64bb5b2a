"""Pages of TIFF files: grey or RGB, of up to 16 bits or of floats."""

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
    from tifffile import PHOTOMETRIC, TiffFile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # faults are raised, not logged
    with TiffFile(path) as file:
        count = len(file.pages)
        if not 1 <= count <= MOST_PAGES:
            raise InputError(f"has {count} pages; expected 1 to {MOST_PAGES}")
        page: Any = file.pages[0]
        known = (PHOTOMETRIC.MINISBLACK, PHOTOMETRIC.RGB, PHOTOMETRIC.CFA)
        if page.photometric not in known:
            name = getattr(page.photometric, "name", page.photometric)
            raise InputError(f"a TIFF picture of the kind {name}; save it as RGB or grey")
        if str(page.dtype) not in TYPES:
            raise InputError(f"has pixels of the type {page.dtype}; save it in 8 or 16 bits, or as float32")
        dtype, alpha = np.dtype(page.dtype), len(page.extrasamples) == 1
        fewer = dtype.kind == "u" and page.bitspersample < 8 * dtype.itemsize
        return {
            "shape": (page.imagelength, page.imagewidth, page.samplesperpixel - alpha),
            "dtype": dtype,
            "pages": count,
            "bits": page.bitspersample if fewer else None,
            "alpha": alpha,
            "orientation": page.tags.valueof(274, default=1),
        }


def decode_tiff(path: Path) -> Iterator[np.ndarray]:
    """Pixels of each page, (H, W) or (H, W, C); `InputError` for a page of another size than the first."""
    from tifffile import TiffFile

    with TiffFile(path) as file:
        size = None
        for index in range(len(file.pages)):
            page: Any = file.pages[index]
            size = size or page.shape
            if page.shape != size:
                raise InputError(f"page {index} is of the shape {page.shape}, the first of {size}")
            pixels = np.asarray(page.asarray(maxworkers=1))
            yield np.moveaxis(pixels, 0, -1) if page.axes.startswith("S") else pixels
