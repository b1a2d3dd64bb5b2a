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
from test_arrays_and_lenses import hci_folder, pfm

from pcii import InputError, import_arrays, import_counts, import_hci, import_images

GREY = np.random.default_rng(1).integers(0, 65536, (H, W)).astype(np.uint16)
BITS = np.random.default_rng(2).random((2, 2, 5, H, W)) < 0.3
COUNTS = np.random.default_rng(3).poisson(2.0, (2, 2, 5, H, W))


@pytest.mark.parametrize(("value", "unused"), [(0.45455, []), (1.0, ["not used: the gamma of 1 in 0_0.png"])])
def test_a_gamma_that_is_not_used_is_named(tmp_path: Path, value: float, unused: list[str]) -> None:
    pixels = compressed((GREY >> 8).astype(np.uint8))
    gamma = chunk(b"gAMA", struct.pack(">I", round(1e5 * value)))
    (tmp_path / "0_0.png").write_bytes(png_file(W, H, 8, 0, pixels, gamma))
    (tmp_path / "._0_0.png").write_bytes(b"\0\5\x16\7")  # what macOS leaves beside files
    notes: list[str] = []
    views = import_images(tmp_path, "*{row}_{col}.png", OPTICS, encoding="linear", note=notes.append)
    np.testing.assert_allclose(views.view(0, 0)[..., 0], (GREY >> 8) / 255, rtol=1e-6)
    assert notes == unused


def write_ome_set(folder: Path) -> None:
    """Files of which each holds the frames of one view, and names all the others as parts of one image."""
    names = {(k, l): f"{k}_{l}.tif" for k, l in np.ndindex(2, 2)}
    data = "".join(
        f'<TiffData FirstZ="{z}" FirstT="0" FirstC="0" IFD="0" PlaneCount="5"><UUID FileName="{name}">'
        f"urn:uuid:{z:032d}</UUID></TiffData>"
        for z, name in enumerate(names.values())
    )
    for z, (camera, name) in enumerate(names.items()):
        ome = (
            '<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" '
            f'UUID="urn:uuid:{z:032d}"><Image ID="Image:0"><Pixels ID="Pixels:0" DimensionOrder="XYTZC" '
            f'Type="uint16" SizeX="{W}" SizeY="{H}" SizeT="5" SizeZ="4" SizeC="1">'
            f'<Channel ID="Channel:0:0" SamplesPerPixel="1"/>{data}</Pixels></Image></OME>'
        )
        tifffile.imwrite(folder / name, COUNTS[camera].astype(np.uint16), description=ome, metadata=None)


def write_counts(folder: Path, kind: str) -> str:
    """Files of the frames of each view; returns the pattern of their names."""
    if kind == "OME set":
        write_ome_set(folder)
        return "{row}_{col}.tif"
    # ImageJ and tifffile write one header for all frames of a large stack, or one for each of several parts.
    options: dict[str, dict[str, Any]] = {
        "ImageJ": {"imagej": True, "truncate": True},
        "shaped": {"truncate": True},
    }
    options |= {"appended": {"append": True}, ">u2": {"byteorder": ">"}}
    for k, l in np.ndindex(2, 2):
        path, frames = folder / f"{k}_{l}.tif", COUNTS[k, l].astype("int16" if kind == "int16" else "uint16")
        for part in np.split(frames, 5) if kind == "appended" else [frames]:
            tifffile.imwrite(path, part, photometric="minisblack", **options.get(kind, {}))
    return "{row}_{col}.tif"


@pytest.mark.parametrize("kind", ["plain", "ImageJ", "shaped", "appended", ">u2", "int16", "OME set"])
def test_frames_of_tiff_files_are_added_up(tmp_path: Path, kind: str) -> None:
    counts = import_counts(tmp_path, OPTICS, pattern=write_counts(tmp_path, kind))
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
    single = import_counts(tmp_path, OPTICS, pattern="{row}_{col}.npy", note=[].append)
    np.testing.assert_array_equal(single.view(0, 0), array[0, 0, 0])
    with pytest.raises(InputError, match="--counts for photons; got int64"):
        import_arrays(COUNTS, OPTICS)


@pytest.mark.parametrize(
    ("ending", "words"),
    [("jpg", "not a PNG, TIFF or EXR picture"), ("tif", r"a calibration of ImageJ \(c0, c1\)")],
)
def test_pictures_that_do_not_keep_counts_are_refused(tmp_path: Path, ending: str, words: str) -> None:
    Image.fromarray(numbers(0, 0)[..., 0]).save(tmp_path / "0_0.jpg")
    signed: dict[str, Any] = {"imagej": True, "metadata": {"c0": -32768.0, "c1": 1.0}}
    tifffile.imwrite(tmp_path / "0_0.tif", (COUNTS[0, 0] + 32768).astype(np.uint16), **signed)
    with pytest.raises(InputError, match=words):
        import_counts(tmp_path, OPTICS, pattern=f"{{row}}_{{col}}.{ending}", note=[].append)


def test_a_benchmark_folder_of_another_system(tmp_path: Path) -> None:
    """Ends of lines, remarks, names in capitals, an author in Latin-1, a map with a scale, another file."""
    root = hci_folder(tmp_path / "scene")
    text = (root / "parameters.cfg").read_text().replace("= 100.0", "= 100.0 ; mm") + "authors = Jürgen\n"
    (root / "parameters.cfg").write_bytes(text.replace("\n", "\r\n").encode("latin-1"))
    for path in root.glob("*.png"):
        path.rename(path.with_suffix(".PNG"))
    pfm(root / "gt_depth_lowres.pfm", np.full((H, W), 2.0), scale=-2.0)
    (root / "valid.png").write_bytes(b"")
    notes: list[str] = []
    scene = import_hci(root, note=notes.append)
    assert scene.views.grid.focal_mm == 100
    assert notes[1:] == ["not used: valid.png", "not used of parameters.cfg: authors"]
    assert scene.truth is not None
    np.testing.assert_allclose(scene.truth.z_mm, 4000)
