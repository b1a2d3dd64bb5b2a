# ruff: noqa: E501
"""Photon cubes come in as they went out; frames of strangers come in, and what is wrong is one sentence."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from command_runs import check_refused, run
from photon_cubes import FRAMES, bits_of, packed, write_cubes
from picture_folders import OPTICS

from pcii.core.camera_grid import CameraGrid
from pcii.exchange.export_formats import export_dataset
from pcii.importing.camera_order import ViewOrder
from pcii.importing.count_frames import import_counts
from pcii.io.dataset import open_dataset

CAMERAS = ["--pitch-mm", "5", "7", "--focal-mm", "50", "--pixel-mm", "0.05"]
PACKED = ["--counts", "--bitpack", "--pattern", "{row}_{col}.npy", *CAMERAS]
GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=11, width=13)
EIGHTS = CameraGrid(
    rows=1, cols=2, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=4, width=16, shear_px=(1.5, 0)
)
BITS = bits_of(GRID)
CUBE = packed(BITS[1, 0])


def contents(root: Path) -> dict[Path, bytes]:
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def files_of(folder: Path, bits: np.ndarray) -> Path:
    """A folder of packed views, row_col.npy."""
    folder.mkdir()
    for k, l in np.ndindex(bits.shape[:2]):
        np.save(folder / f"{k}_{l}.npy", packed(bits[k, l]))
    return folder


@pytest.mark.parametrize(("grid", "cfa"), [(GRID, "GRBG"), (EIGHTS, None)])
def test_export_import_export_gives_the_same_bytes(tmp_path: Path, capsys, grid: CameraGrid, cfa) -> None:
    cubes = write_cubes(tmp_path, bits_of(grid), grid, cfa)
    assert run("import", cubes, "-o", tmp_path / "back") == 0
    said = capsys.readouterr().out
    assert ("left out 3 padding bits at the end of each row" in said) == (grid == GRID)
    back = open_dataset(tmp_path / "back")
    assert (back.grid, back.cfa, back.photon_budget) == (grid, cfa, 90)
    assert back.counts.frame_events is not None
    again = export_dataset(back, "photoncube", tmp_path / "again")
    assert contents(again) == contents(cubes)


def test_a_part_of_the_exposure_has_its_part_of_the_budget(tmp_path: Path) -> None:
    cubes = write_cubes(tmp_path, BITS, GRID)
    assert run("import", cubes / "transforms.json", "-o", tmp_path / "part", "--frames", 2, 4) == 0
    part = open_dataset(tmp_path / "part")
    np.testing.assert_array_equal(part.counts.dense, BITS[:, :, 2:5].sum(axis=2))
    assert (part.counts.readout.frames, part.photon_budget) == (3, 30)


def test_a_dataset_of_visionsim_is_one_camera(tmp_path: Path, capsys) -> None:
    view = write_cubes(tmp_path, BITS, GRID) / "01_02"
    document = json.loads((view / "transforms.json").read_text())
    del document["cfa"]
    (view / "transforms.json").write_text(json.dumps(document))
    np.save(view / "frames.npy", packed(BITS[1, 2])[..., None])  # visionsim has an axis for the channel
    assert run("import", view, "-o", tmp_path / "one", "--pixel-mm", 0.05, "--cfa", "RGGB") == 0
    dataset = open_dataset(tmp_path / "one")
    assert (dataset.grid.rows, dataset.grid.cols, dataset.grid.focal_mm, dataset.cfa) == (1, 1, 50, "RGGB")
    np.testing.assert_array_equal(dataset.counts.view(0, 0), BITS[1, 2].sum(axis=0))


@pytest.mark.parametrize("kept", ["packed", "one file", "bool", "uint16", "tif"])
def test_frames_in_numpy_files(tmp_path: Path, kept: str) -> None:
    order, pattern, source = ViewOrder(flip_rows=True), "{row}_{col}.npy", tmp_path / "views"
    options: dict[str, Any] = {"bitpack": True, "width": 13, "frames": (1, 7)}
    files_of(source, BITS)
    if kept == "one file":
        source, pattern = tmp_path / "all.npy", None
        np.save(source, packed(BITS))
    elif kept == "tif":
        options, pattern = {"frames": (1, 7)}, "{row}_{col}.tif"
        for k, l in np.ndindex(2, 3):
            tifffile.imwrite(
                source / f"{k}_{l}.tif", 300 * BITS[k, l].astype(np.uint16), photometric="minisblack"
            )
    elif kept != "packed":
        options = {"frames": (1, 7)}
        for k, l in np.ndindex(2, 3):
            view = BITS[k, l] if kept == "bool" else 300 * BITS[k, l].astype(np.uint16)
            np.save(source / f"{k}_{l}.npy", view)
    counts = import_counts(source, OPTICS, pattern=pattern, order=order, cfa="GRBG", **options)
    sums = BITS[::-1, :, 1:8].sum(axis=2)
    many = kept in ("uint16", "tif")
    np.testing.assert_array_equal(counts.dense, sums * (300 if many else 1))
    assert counts.readout.frames == 7
    assert counts.readout.bits == (None if many else 1)
    assert (counts.frame is None) == many


@pytest.mark.parametrize(
    ("dtype", "frames", "sums", "bits"),
    [
        (bool, 9, np.uint8, 1),
        (np.uint8, 1, np.uint8, None),
        (np.uint8, 2, np.uint16, None),
        (np.uint16, 9, np.uint32, None),
        (np.int64, 9, np.uint64, None),
        (np.float32, 9, np.uint64, None),
    ],
)
def test_sums_are_of_the_smallest_type_that_holds_them(dtype, frames, sums, bits) -> None:
    counts = import_counts(BITS[:, :, :frames].astype(dtype), OPTICS)
    assert (counts.dense.dtype, counts.readout.frames, counts.readout.bits) == (sums, frames, bits)
    np.testing.assert_array_equal(counts.dense, BITS[:, :, :frames].sum(axis=2))


def test_many_single_counts_are_told(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("pcii.frames.frame_sums.MOST_KEPT", 100)
    monkeypatch.setattr("pcii.importing.count_frames.MOST_KEPT", 100)
    source = files_of(tmp_path / "views", BITS)
    assert run("import", source, "-o", tmp_path / "out", *PACKED, "--width", 13) == 0
    assert f"only the sums of {FRAMES} frames are kept: there are {BITS.sum()}" in capsys.readouterr().out
    assert open_dataset(tmp_path / "out").counts.frame_events is None


Make = Callable[[Path], Path]
NO_OPTIONS: list[Any] = []


def cubes(**members: Any) -> Make:
    """An export of which members of its transforms.json are replaced."""

    def make(root: Path) -> Path:
        out = write_cubes(root, BITS, GRID)
        document = json.loads((out / "transforms.json").read_text()) | members
        (out / "transforms.json").write_text(json.dumps(document))
        return out

    return make


def cube_with(array: np.ndarray) -> Make:
    """An export of which one cube is another array."""

    def make(root: Path) -> Path:
        out = write_cubes(root, BITS, GRID)
        np.save(out / "01_00" / "frames.npy", array)
        return out

    return make


def posed(change: Callable[[np.ndarray], None]) -> Make:
    """An export of which one pose is changed."""

    def make(root: Path) -> Path:
        out = write_cubes(root, BITS, GRID)
        document = json.loads((out / "transforms.json").read_text())
        pose = np.array(document["frames"][4]["transform_matrix"])
        change(pose)
        document["frames"][4]["transform_matrix"] = pose.tolist()
        (out / "transforms.json").write_text(json.dumps(document))
        return out

    return make


def one_camera(change: Callable[[dict[str, Any]], None]) -> Make:
    def make(root: Path) -> Path:
        view = write_cubes(root, BITS, GRID) / "00_01"
        document = json.loads((view / "transforms.json").read_text())
        change(document)
        (view / "transforms.json").write_text(json.dumps(document))
        return view

    return make


def views(array: np.ndarray) -> Make:
    """Packed files of which one is this array."""

    def make(root: Path) -> Path:
        folder = files_of(root / "views", BITS)
        np.save(folder / "1_0.npy", array)
        return folder

    return make


def stack(array: np.ndarray) -> Make:
    def make(root: Path) -> Path:
        np.save(root / "in.npy", array)
        return root / "in.npy"

    return make


def header_alone(root: Path) -> Path:
    """A header that promises 2^60 frames."""
    folder = files_of(root / "views", BITS)
    with (folder / "0_0.npy").open("wb") as file:
        header = {"descr": "|u1", "fortran_order": False, "shape": (1 << 60, 11, 2)}
        np.lib.format.write_array_header_1_0(file, header)
    return folder


def cut(root: Path) -> Path:
    folder = files_of(root / "views", BITS)
    (folder / "0_1.npy").write_bytes((folder / "0_1.npy").read_bytes()[:-1])
    return folder


def missing(folder: Path) -> Path:
    (folder / "01_02" / "frames.npy").unlink()
    return folder


def archive(root: Path) -> Path:
    folder = files_of(root / "views", BITS)
    with (folder / "0_2.npy").open("wb") as file:
        np.savez(file, frames=CUBE)
    return folder


def no_array(root: Path) -> Path:
    folder = files_of(root / "views", BITS)
    (folder / "0_2.npy").write_bytes(b"\x93NUMPY\x01\x00\x10\x00{'shape': (-1,,) ")
    return folder


def turned(pose: np.ndarray) -> None:
    pose[0, :3] *= -1


def larger(pose: np.ndarray) -> None:
    pose[:3, :3] *= 2


def moves(document: dict[str, Any]) -> None:
    document["frames"][3] = {"transform_matrix": (np.eye(4) + 1e-6).tolist()}
    document["frames"][3]["transform_matrix"][3] = [0, 0, 0, 1]


WRONG: list[tuple[str, Make, list[Any], str]] = [
    ("frames beyond", cubes(), ["--frames", 3, 9], r"has the frames 0 to 8; .* got 3 and 9"),
    ("frames backwards", cubes(), ["--frames", 3, 2], "got 3 and 2"),
    ("number of frames", cubes(num_frames=8), NO_OPTIONS, "num_frames: says 8 frames, and .*frames.npy has 9"),
    ("packed along the height", cubes(bitpack_dim=1), NO_OPTIONS, "bitpack_dim: expected 2"),
    ("channels", cubes(c=3), NO_OPTIONS, "c: expected 1; of a photon cube one channel is read"),
    ("pattern", cubes(cfa="RGB"), NO_OPTIONS, "no Bayer pattern 'RGB'"),
    ("budget", cubes(photon_budget=-1), NO_OPTIONS, "photon_budget: expected photons"),
    ("width", cubes(w=30, cx=15, camera_grid=None), NO_OPTIONS, "rows are of 9 to 16 pixels, where transforms.json says 30"),
    ("padding", cubes(w=12, cx=6, camera_grid=None), NO_OPTIONS, "bits beyond the 12 pixels of a row are set"),
    ("height", cubes(h=12, cy=6, camera_grid=None), NO_OPTIONS, "is 11 px high, where transforms.json says 12"),
    ("type", cube_with(CUBE.astype(np.int8)), NO_OPTIONS, "frames.npy: expected bits that are packed in uint8, got int8"),
    ("colour", cube_with(np.repeat(CUBE[..., None], 3, axis=3)), NO_OPTIONS, "three colours, .*one channel is read"),
    ("two axes", cube_with(CUBE[0]), NO_OPTIONS, r"expected \(T, H, W / 8\) with eight pixels in a byte, got \(11, 2\)"),
    ("other frames", cube_with(CUBE[1:]), NO_OPTIONS, "01_00/frames.npy: has 8 frames of .* where .*00_00/frames.npy has 9"),
    ("no frames", cube_with(CUBE[:0]), NO_OPTIONS, "has no frames"),
    ("Fortran", cube_with(np.asfortranarray(CUBE)), NO_OPTIONS, "is in Fortran's order"),
    ("objects", cube_with(np.array([None])), NO_OPTIONS, "holds Python objects"),
    ("reflection", posed(turned), NO_OPTIONS, "is a reflection"),
    ("scale", posed(larger), NO_OPTIONS, "is scaled by 2"),
    ("options of light", cubes(), ["--linear"], "leave out options of views and light other than --frames"),
    ("another width", cubes(), ["--width", 13], "leave out options of views and light other than --frames"),
    ("pattern twice", cubes(), ["--cfa", "GRBG"], "tells the Bayer pattern"),
    ("moving camera", one_camera(moves), NO_OPTIONS, "a moving camera is no grid of cameras"),
    ("poses", one_camera(lambda d: d["frames"].pop()), NO_OPTIONS, "frames: says 8 frames, and .* has 9"),
    ("cut", cut, PACKED, r"0_1.npy: cut off, it has 197 of the 198 bytes of \(9, 11, 2\)"),
    ("missing", lambda root: missing(cubes()(root)), NO_OPTIONS, "01_02/frames.npy: there is no such file"),
    ("an archive", archive, PACKED, "is an archive; save a .npy file"),
    ("no array", no_array, PACKED, "0_2.npy: not a NumPy array"),
    ("huge", header_alone, PACKED, "GiB, and at most 16 are read"),
    ("padding of files", views(CUBE), [*PACKED, "--width", 10], "bits beyond the 10 pixels of a row are set"),
    ("width of files", views(CUBE), [*PACKED, "--width", 17], "rows are of 9 to 16 pixels, where --width says 17"),
    ("no width", views(CUBE), [*PACKED, "--width", 0], "where --width says 0"),
    ("unpacked", views(BITS[1, 0]), PACKED, "expected bits that are packed in uint8, got bool"),
    ("without counts", views(CUBE), ["--bitpack", "--pattern", "{row}_{col}.npy", *CAMERAS], "are for --counts"),
    ("width alone", views(CUBE), ["--counts", "--pattern", "{row}_{col}.npy", *CAMERAS, "--width", 13], "--width: is for --bitpack"),
    ("four axes", stack(packed(BITS[0])), ["--counts", "--bitpack", *CAMERAS], r"expected \(K, L, T, H, W / 8\)"),
    ("text", stack(np.array(["x"])), ["--counts", "--bitpack", *CAMERAS], "expected bits that are packed in uint8"),
    ("frames of an array", stack(BITS), ["--counts", "--frames", 0, 9, *CAMERAS], "has the frames 0 to 8"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "options", "words"), [pytest.param(*row[1:], id=row[0]) for row in WRONG])
def test_one_sentence_and_exit_code_2(tmp_path: Path, capsys, make: Make, options, words: str) -> None:
    check_refused(make(tmp_path), tmp_path / "out", options, words, capsys)
