"""Files that strangers could send: each with the faults that its name tells."""

import io
import struct
import zlib

import numpy as np
from PIL import Image
from png_files import png_file


def scene_toml(
    shape: str = 'type = "sphere", radius_mm = 5.0', material: str = "reflectance = [1, 1, 1]"
) -> str:
    """A scene with one object."""
    return (
        'title = "t"\n[[lights]]\ntype = "uniform"\nluminance_cd_m2 = 1.0\n'
        '[[objects]]\nname = "a"\nposition_mm = [0, 0, 500]\n'
        f"shape = {{ {shape} }}\nmaterial = {{ {material} }}\n"
    )


def ply(
    vertices: str = "0 0 0\n10 0 0\n0 10 0\n",
    faces: str = "3 0 1 2\n",
    *,
    vertex_count: int = 3,
    face_count: int = 1,
    form: str = "ascii 1.0",
) -> bytes:
    """A PLY file with this header, whatever its numbers are."""
    return (
        f"ply\nformat {form}\nelement vertex {vertex_count}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {face_count}\nproperty list uchar int vertex_indices\n"
        f"end_header\n{vertices}{faces}"
    ).encode()


def binary_ply(*indices: int) -> bytes:
    """A little-endian PLY of three vertices and one face with these indices."""
    body = np.array([0, 0, 0, 10, 0, 0, 0, 10, 0], "<f4").tobytes()
    body += struct.pack("<B", len(indices)) + np.array(indices, "<i4").tobytes()
    return ply("", "", form="binary_little_endian 1.0") + body


def obj(*lines: str) -> bytes:
    """A sound triangle in OBJ, and these lines."""
    return "\n".join(["v 0 0 0", "v 10 0 0", "v 0 10 0", "f 1 2 3", *lines, ""]).encode()


def png(side: int = 4, data: bytes = b"") -> bytes:
    """A square PNG file with this header, whatever its pixels are."""
    return png_file(side, side, 8, 2, data or zlib.compress(bytes(side * (1 + side * 3))), b"")


def picture(mode: str, form: str) -> bytes:
    """A small picture by Pillow."""
    file = io.BytesIO()
    Image.new(mode, (4, 4)).save(file, form)
    return file.getvalue()


def animation() -> bytes:
    """A PNG of two pictures."""
    file = io.BytesIO()
    frames = [Image.new("RGB", (4, 4), colour) for colour in ("red", "blue")]
    frames[0].save(file, "PNG", save_all=True, append_images=frames[1:])
    return file.getvalue()


BOMB = zlib.compress(bytes(1 << 27), 9)
"""128 MiB of zeros in 130 kB."""
