"""PNG files by the specification, without a library that might share a fault."""

import struct
import zlib
from collections.abc import Iterable

import numpy as np


def chunk(name: bytes, content: bytes = b"") -> bytes:
    """A chunk of a PNG file."""
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png_file(
    width: int, height: int, bits: int, colour_type: int, pixels: bytes, extra: bytes = b""
) -> bytes:
    """A PNG file with this header, whatever its compressed pixels are; `extra` chunks stand before them."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour_type, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + extra + chunk(b"IDAT", pixels) + chunk(b"IEND")


def compressed(rows: Iterable[np.ndarray]) -> bytes:
    """Rows of pixels, each of which no filter was used for."""
    return zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))


def png16(image: np.ndarray) -> bytes:
    """An image (H, W, C) as a PNG file of 16 bits."""
    height, width, channels = image.shape
    colour_type = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    return png_file(width, height, 16, colour_type, compressed(image.astype(">u2")))
