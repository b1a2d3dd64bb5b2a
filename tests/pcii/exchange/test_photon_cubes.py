# ruff: noqa: E501
"""Photon cubes and frames of strangers come in, and what is wrong is one sentence."""

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

from pcii import CameraGrid, ViewOrder, import_counts, open_dataset
from pcii.exchange import count_arrays
from pcii.exchange.count_arrays import FrameStack, add_frames, places_of_bits
from pcii.types.photon_counts import PhotonCounts

CAMERAS = ["--pitch-mm", "5", "7", "--focal-mm", "50", "--pixel-mm", "0.05"]
PACKED = ["--counts", "--bitpack", "--pattern", "{row}_{col}.npy", *CAMERAS]
GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=11, width=13)
EIGHTS = CameraGrid(
    rows=1, cols=2, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=4, width=16, shear_px=(1.5, 0)
)
BITS = bits_of(GRID)
CUBE = packed(BITS[1, 0])


def files_of(folder: Path, bits: np.ndarray) -> Path:
    """A folder of packed views, row_col.npy."""
    folder.mkdir()
    for k, l in np.ndindex(bits.shape[:2]):
        np.save(folder / f"{k}_{l}.npy", packed(bits[k, l]))
    return folder


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 1.0])
@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 5), (3, 4, 16), (300, 2, 33)])
def test_sums_and_places_are_those_of_unpacked_bits(shape: tuple[int, int, int], share: float) -> None:
    bits = np.random.default_rng(3).random((1, 1, *shape)) < share
    frames = packed(bits[0, 0])
    np.testing.assert_array_equal(np.stack(places_of_bits(frames), axis=1), np.argwhere(bits[0, 0]))
    grid = CameraGrid(
        rows=1, cols=1, pitch_mm=(1, 1), focal_mm=1, pixel_mm=1, height=shape[1], width=shape[2]
    )
    check_counts(counts_of_bits(bits, grid, (0, shape[0])), bits)


def counts_of_bits(bits: np.ndarray, grid: CameraGrid, span: tuple[int, int]) -> PhotonCounts:
    """Counts of packed frames in memory."""
    stacks = np.empty(bits.shape[:2], object)
    for camera in np.ndindex(*stacks.shape):
        stacks[camera] = FrameStack("frames", lambda c=camera: packed(bits[c]))
    frames = span[0], span[1] - 1
    return add_frames(
        stacks, lambda shape: grid, frames=frames, bitpack=True, width=grid.width, tell=[].append
    )


def check_counts(counts: PhotonCounts, bits: np.ndarray) -> None:
    """Sums and the frame of every single count are those of the bits (K, L, T, H, W)."""
    np.testing.assert_array_equal(counts.dense, bits.sum(axis=2))
    events = counts.frame_events
    assert events is not None
    listed = np.stack([events.k, events.l, events.i, events.j, events.frame], axis=1)
    np.testing.assert_array_equal(listed, np.argwhere(bits.transpose(0, 1, 3, 4, 2)))


@pytest.mark.parametrize("most_kept", [1 << 24, 100, 0])
@pytest.mark.parametrize("piece_bytes", [1 << 23, 1])
@pytest.mark.parametrize("span", [(0, FRAMES), (2, 6), (8, 9)])
def test_sums_do_not_depend_on_what_is_kept(monkeypatch, most_kept, piece_bytes, span) -> None:
    monkeypatch.setattr(count_arrays, "MOST_KEPT", most_kept)
    monkeypatch.setattr(count_arrays, "PIECE_BYTES", piece_bytes)
    counts, seen = counts_of_bits(BITS, GRID, span), BITS[:, :, span[0] : span[1]]
    if seen.sum() <= most_kept:
        check_counts(counts, seen)
    else:
        np.testing.assert_array_equal(counts.dense, seen.sum(axis=2))
        assert counts.frame is None


@pytest.mark.parametrize(("grid", "cfa"), [(GRID, "GRBG"), (EIGHTS, None)])
def test_cubes_of_all_cameras_come_in(tmp_path: Path, capsys, grid: CameraGrid, cfa) -> None:
    cubes = write_cubes(tmp_path, bits_of(grid), grid, cfa)
    assert run("import", cubes, "-o", tmp_path / "back", "--focal-mm", 50) == 0
    said = capsys.readouterr().out
    assert ("left out 3 padding bits at the end of each row" in said) == (grid == GRID)
    back = open_dataset(tmp_path / "back")
    assert back.cfa == cfa
    assert back.grid.shape_KLHW == grid.shape_KLHW
    assert back.grid.pixel_mm == pytest.approx(grid.pixel_mm)
    assert back.grid.shear_px == grid.shear_px
    check_counts(back.counts, bits_of(grid))


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


@pytest.mark.parametrize(
    "kept", ["packed", "one file", "counted file", "bool", "bool array", "uint16", "tif"]
)
def test_frames_in_numpy_files(tmp_path: Path, kept: str) -> None:
    pattern, source = "{row}_{col}.npy", tmp_path / "views"
    files_of(source, BITS)
    options: dict[str, Any] = {"frames": (1, 7), "order": ViewOrder(flip_rows=True), "cfa": "GRBG"}
    if kept in ("one file", "counted file", "bool array"):
        source, pattern = tmp_path / "all.npy", None
        np.save(source, BITS if kept == "bool array" else packed(BITS))
    if kept == "counted file":
        np.save(source, packed(BITS).reshape(6, *packed(BITS).shape[2:]))
        options["grid"] = (2, 3)
    if kept == "tif":
        pattern = "{row}_{col}.tif"
        for k, l in np.ndindex(2, 3):
            view = 300 * BITS[k, l].astype(np.uint16)
            tifffile.imwrite(source / f"{k}_{l}.tif", view, photometric="minisblack")
    elif kept in ("bool", "uint16"):
        for k, l in np.ndindex(2, 3):
            np.save(
                source / f"{k}_{l}.npy", BITS[k, l] if kept == "bool" else 300 * BITS[k, l].astype(np.uint16)
            )
    options["tell"] = [].append
    if kept in ("packed", "one file", "counted file"):
        options |= {"bitpack": True, "width": 13}
    counts = import_counts(source, OPTICS, pattern=pattern, **options)
    seen = BITS[::-1, :, 1:8]
    assert counts.readout.frames == 7
    if kept in ("uint16", "tif"):
        np.testing.assert_array_equal(counts.dense, 300 * seen.sum(axis=2))
        assert (counts.readout.bits, counts.frame) == (None, None)
    else:
        check_counts(counts, seen)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3])
def test_packed_bits_that_are_taken_for_counts_are_warned_of(tmp_path: Path, capsys, share: float) -> None:
    bits = np.random.default_rng(1).random((1, 2, 40, 16, 64)) < share
    np.save(tmp_path / "in.npy", packed(bits))
    assert run("import", tmp_path / "in.npy", "-o", tmp_path / "a", "--counts", *CAMERAS) == 0
    assert "looks like bits packed eight to a byte" in capsys.readouterr().out
    counts = np.random.default_rng(1).poisson(20 * share, (1, 2, 40, 16, 64)).astype(np.uint8)
    np.save(tmp_path / "in.npy", counts)
    assert run("import", tmp_path / "in.npy", "-o", tmp_path / "b", "--counts", *CAMERAS) == 0
    assert "looks like bits" not in capsys.readouterr().out


@pytest.mark.parametrize("width", [61, 64])
def test_columns_without_a_count_are_warned_of(tmp_path: Path, capsys, width: int) -> None:
    bits = np.zeros((1, 2, 40, 16, 64), bool)
    bits[..., :61] = np.random.default_rng(1).random((1, 2, 40, 16, 61)) < 0.1
    np.save(tmp_path / "in.npy", packed(bits))
    told = ["--bitpack", "--width", width, *CAMERAS]
    assert run("import", tmp_path / "in.npy", "-o", tmp_path / "out", *told) == 0
    words = "warning: the last 3 columns of 64 have no count in any view"
    assert (words in capsys.readouterr().out) == (width == 64)


@pytest.mark.parametrize(
    ("dtype", "frames"),
    [(np.uint8, 1), (np.uint8, 2), (np.uint16, 9), (np.int64, 9), (np.float32, 9)],
)
def test_frames_of_any_numbers_are_added_up(dtype, frames) -> None:
    counts = import_counts(BITS[:, :, :frames].astype(dtype), OPTICS)
    assert (counts.readout.frames, counts.readout.bits) == (frames, None)
    np.testing.assert_array_equal(counts.dense, BITS[:, :, :frames].sum(axis=2))


def test_many_single_counts_are_told(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(count_arrays, "MOST_KEPT", 100)
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


def missing(folder: Path) -> Path:
    (folder / "01_02" / "frames.npy").unlink()
    return folder


def moves(document: dict[str, Any]) -> None:
    document["frames"][3] = {"transform_matrix": (np.eye(4) + 1e-6).tolist()}
    document["frames"][3]["transform_matrix"][3] = [0, 0, 0, 1]


WRONG: list[tuple[str, Make, list[Any], str]] = [
    ("frames beyond", cubes(), ["--frames", 3, 9], r"has the frames 0 to 8; .* got 3 and 9"),
    ("number of frames", cubes(num_frames=8), NO_OPTIONS, "frames: says 8, and .*frames.npy has 9"),
    ("channels", cubes(c=3), NO_OPTIONS, "bitpack_dim, c: expected 2 and 1"),
    ("width", cubes(w=30, cx=15), NO_OPTIONS, "rows are of 9 to 16 pixels, and the stated width is 30"),
    ("padding", cubes(w=12, cx=6), NO_OPTIONS, "bits beyond the 12 pixels of a row are set"),
    ("height", cubes(h=12, cy=6), NO_OPTIONS, "is 11 px high, and h is 12"),
    ("type", cube_with(CUBE.astype(np.int8)), NO_OPTIONS, "01_00/frames.npy: has frames int8"),
    ("other frames", cube_with(CUBE[1:]), NO_OPTIONS, "01_00/frames.npy: has frames uint8 .8, 11, 2., where .*00_00/frames.npy has uint8 .9, 11, 2."),
    ("options of light", cubes(), ["--linear"], "--linear: not for .*, which is read as photon cubes with a transforms.json"),
    ("pattern twice", cubes(cfa="RGGB"), ["--cfa", "GRBG"], "cfa: is RGGB; leave out --cfa"),
    ("moving camera", one_camera(moves), NO_OPTIONS, "a moving camera is no grid"),
    ("missing", lambda root: missing(cubes()(root)), NO_OPTIONS, "01_02/frames.npy: cannot be read"),
    ("padding of files", views(CUBE), [*PACKED, "--width", 10], "bits beyond the 10 pixels of a row are set"),
    ("width of files", views(CUBE), [*PACKED, "--width", 17], "rows are of 9 to 16 pixels, and the stated width is 17"),
    ("with light", views(CUBE), ["--bitpack", "--srgb", "--pattern", "{row}_{col}.npy", *CAMERAS], "--srgb: not for"),
    ("width alone", views(CUBE), ["--counts", "--pattern", "{row}_{col}.npy", *CAMERAS, "--width", 13], "--width: is for packed frames"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "options", "words"), [pytest.param(*row[1:], id=row[0]) for row in WRONG])
def test_one_sentence_and_exit_code_2(tmp_path: Path, capsys, make: Make, options, words: str) -> None:
    check_refused(make(tmp_path), tmp_path / "out", options, words, capsys)
