"""Maps in PFM files: portable float maps of one channel."""

from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible

LONGEST_HEADER = 256


def read_pfm(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """A map (H, W), float32, top row first; `InputError` for another size, or what is no such file.

    A PFM file is a line "Pf", one with width and height, one with a scale whose sign tells the byte order
    (below 0: little-endian), and the rows from the bottom.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(LONGEST_HEADER)
            lines = head.split(b"\n", 3)
            if len(lines) < 4 or lines[0].strip() != b"Pf":
                raise InputError(f"{path}: not a PFM map of one channel, which begins with a line Pf")
            start = len(head) - len(lines[3])
            try:
                width, height = map(int, lines[1].split())
                scale = float(lines[2])
            except ValueError:
                fields = visible(b" ".join(lines[1:3]).decode(errors="replace"))
                raise InputError(f"{path}: its header has {fields!r} for width, height and scale") from None
            if (height, width) != shape:
                raise InputError(
                    f"{path}: is {height} x {width} px, where the views are {shape[0]} x {shape[1]}"
                )
            if not np.isfinite(scale) or scale == 0:
                raise InputError(f"{path}: its scale is {scale:g}; expected a number other than 0")
            if size - start != 4 * width * height:
                raise InputError(
                    f"{path}: has {size - start} bytes after its header, where {height} x {width} numbers "
                    f"have {4 * width * height}"
                )
            file.seek(start)
            content = file.read()
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
    numbers = np.frombuffer(content, "<f4" if scale < 0 else ">f4").reshape(shape)
    return numbers[::-1].astype(np.float32)
