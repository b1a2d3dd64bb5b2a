"""Small pictures whose numbers say of which view they are, and imports that are refused."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from command_runs import run_pcii
from PIL import Image
from png_files import png16

from pcii import Optics

OPTICS = Optics(pitch_mm=(2.0, 2.0), focal_mm=35.0, sensor_mm=36.0)
H, W = 6, 8


def numbers(k: int, l: int, dtype: Any = np.uint8, channels: int = 3) -> np.ndarray:
    """An image (H, W, C), different in every pixel, channel and view."""
    values = np.arange(H * W * channels).reshape(H, W, channels) + 3 * k + l + 1
    scale = {"uint8": 1, "uint16": 257}.get(np.dtype(dtype).name, 1 / 255)
    return (values * scale).astype(dtype)


def write(path: Path, image: np.ndarray, compression: str | None = None) -> None:
    """Write an image (H, W, C) in the format of the path's ending, in all of its bits."""
    if path.suffix == ".exr":
        write_exr(path, image)
    elif path.suffix == ".tif":
        kind = "rgb" if image.shape[2] >= 3 else "minisblack"
        more = {"extrasamples": ["unassalpha"], "planarconfig": "contig"} if image.shape[2] in (2, 4) else {}
        tifffile.imwrite(path, image.squeeze(), photometric=kind, compression=compression, **more)
    elif path.suffix == ".png" and image.dtype == np.uint16:
        path.write_bytes(png16(image))
    else:
        Image.fromarray(image.squeeze()).save(path)


def write_exr(path: Path, image: np.ndarray) -> None:
    import OpenEXR

    names = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}[image.shape[2]]
    planes = {name: np.ascontiguousarray(image[..., c], np.float32) for c, name in enumerate(names)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, planes) as file:
        file.write(str(path))


def make_folder(
    root: Path, rows: int = 2, cols: int = 3, *, ending: str = "png", dtype: Any = np.uint8, channels: int = 3
) -> Path:
    """A folder of files col_row.ending."""
    root.mkdir(parents=True, exist_ok=True)
    for k, l in np.ndindex(rows, cols):
        write(root / f"{l}_{k}.{ending}", numbers(k, l, dtype, channels))
    return root


def check_refused(
    source: Path, out: Path, options: Sequence[object], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """An import ends with exit code 2 and one sentence that has these words, and leaves nothing."""
    capsys.readouterr()
    assert run_pcii("import", source, "-o", out, *options) == 2
    *_, message = capsys.readouterr().err.strip().split("\n")
    assert message.startswith("error: ")
    assert re.search(words, message), message
    assert not out.exists()
