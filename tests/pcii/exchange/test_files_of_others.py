"""What real files of the field are like: the case that mattered most of each kind of source."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from picture_folders import OPTICS, H, W, numbers
from PIL import Image
from png_files import chunk, compressed, png_file

from pcii import InputError, import_arrays, import_counts, import_images

GREY = np.random.default_rng(1).integers(0, 65536, (H, W)).astype(np.uint16)
BITS = np.random.default_rng(2).random((2, 2, 5, H, W)) < 0.3
COUNTS = np.random.default_rng(3).poisson(2.0, (2, 2, 5, H, W))


@pytest.mark.parametrize(("value", "unused"), [(0.45455, []), (1.0, ["not used: the gamma of 1 in 0_0.png"])])
def test_a_gamma_that_is_not_used_is_named(tmp_path: Path, value: float, unused: list[str]) -> None:
    pixels = compressed((GREY >> 8).astype(np.uint8))
    gamma = chunk(b"gAMA", struct.pack(">I", round(1e5 * value)))
    (tmp_path / "0_0.png").write_bytes(png_file(W, H, 8, 0, pixels, gamma))
    (tmp_path / "._0_0.png").write_bytes(b"\0\5\x16\7")  # what macOS leaves beside files
    told: list[str] = []
    views = import_images(tmp_path, "*{row}_{col}.png", OPTICS, encoding="linear", tell=told.append)
    np.testing.assert_allclose(views.view(0, 0)[..., 0], (GREY >> 8) / 255, rtol=1e-6)
    assert told == unused


def write_counts(folder: Path, kind: str) -> None:
    """Files of the frames of each view."""
    # ImageJ writes one header for all frames of a large stack, others one for each of several parts.
    options: dict[str, dict[str, Any]] = {
        "ImageJ": {"imagej": True, "truncate": True},
        "appended": {"append": True},
        ">u2": {"byteorder": ">"},
    }
    for k, l in np.ndindex(2, 2):
        frames = COUNTS[k, l].astype("uint16")
        for part in np.split(frames, 5) if kind == "appended" else [frames]:
            path = folder / f"{k}_{l}.tif"
            tifffile.imwrite(path, part, photometric="minisblack", **options[kind])


@pytest.mark.parametrize("kind", ["ImageJ", "appended", ">u2"])
def test_frames_of_tiff_files_are_added_up(tmp_path: Path, kind: str) -> None:
    write_counts(tmp_path, kind)
    counts = import_counts(tmp_path, OPTICS, pattern="{row}_{col}.tif")
    np.testing.assert_array_equal(counts.dense, COUNTS.sum(axis=2))
    assert counts.readout.frames == 5


@pytest.mark.parametrize(
    "array", [COUNTS, COUNTS.astype(">f8"), np.asfortranarray(COUNTS), BITS], ids=range(4)
)
def test_frames_of_arrays_are_added_up(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "all.npy", array)
    for source in (array, tmp_path / "all.npy"):
        counts = import_counts(source, OPTICS, cfa="GRBG")
        np.testing.assert_array_equal(counts.dense, array.sum(axis=2))
        assert (counts.cfa, counts.readout.frames) == ("GRBG", 5)
        assert (counts.frame is not None) == (array is BITS)  # of one bit the frame of each count is kept
    np.save(tmp_path / "0_0.npy", array[0, 0, 0])  # one frame without an axis of frames
    single = import_counts(tmp_path, OPTICS, pattern="{row}_{col}.npy", tell=[].append)
    np.testing.assert_array_equal(single.view(0, 0), array[0, 0, 0])


@pytest.mark.parametrize(
    ("array", "words"),
    [(COUNTS, "--counts for photons; got int64"), (np.array(3.0), r"\(K, L, H, W")],
)
def test_arrays_that_are_no_light_are_refused(array: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        import_arrays(array, OPTICS)


def test_pictures_that_do_not_keep_counts_are_refused(tmp_path: Path) -> None:
    Image.fromarray(numbers(0, 0)[..., 0]).save(tmp_path / "0_0.jpg")
    with pytest.raises(InputError, match="not a PNG, TIFF or EXR picture"):
        import_counts(tmp_path, OPTICS, pattern="{row}_{col}.jpg", tell=[].append)
