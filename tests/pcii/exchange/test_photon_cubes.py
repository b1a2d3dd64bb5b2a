"""Photon cubes and frames of strangers come in, and what is wrong is one sentence."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import check_refused, run
from photon_cubes import FRAMES, bits_of, packed, write_cubes
from picture_folders import OPTICS

from pcii import CameraGrid, FrameFormat, InputError, ViewOrder, import_counts, open_dataset
from pcii.exchange import count_arrays
from pcii.types import PhotonCounts

CAMERAS = ["--pitch-mm", "5", "7", "--focal-mm", "50", "--pixel-mm", "0.05"]
GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=11, width=13)
EIGHTS = CameraGrid(
    rows=1, cols=2, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=4, width=16, shear_px=(1.5, 0)
)
BITS = bits_of(GRID)
PACKED = FrameFormat(bitpack=True)


def files_of(folder: Path, bits: np.ndarray) -> Path:
    """A folder of packed views, row_col.npy."""
    folder.mkdir()
    for k, l in np.ndindex(bits.shape[:2]):
        np.save(folder / f"{k}_{l}.npy", packed(bits[k, l]))
    return folder


@pytest.mark.parametrize(("shape", "share"), [((1, 1, 1), 1.0), ((2, 3, 5), 0.0), ((300, 2, 33), 0.5)])
def test_sums_and_frames_are_those_of_unpacked_bits(shape: tuple[int, int, int], share: float) -> None:
    bits = np.random.default_rng(3).random((1, 1, *shape)) < share
    check_counts(counts_of_bits(bits, (0, shape[0])), bits)


def counts_of_bits(bits: np.ndarray, span: tuple[int, int]) -> PhotonCounts:
    """Counts of packed frames in memory."""
    frames, width = (span[0], span[1] - 1), bits.shape[4]
    stored = FrameFormat(bitpack=True, width=width)
    return import_counts(packed(bits), OPTICS, frames=frames, stored=stored, note=[].append)


def check_counts(counts: PhotonCounts, bits: np.ndarray) -> None:
    """Sums and the frame of every single count are those of the bits (K, L, T, H, W)."""
    np.testing.assert_array_equal(counts.dense, bits.sum(axis=2))
    events = counts.frame_events
    assert events is not None
    listed = np.stack([events.k, events.l, events.i, events.j, events.frame], axis=1)
    np.testing.assert_array_equal(listed, np.argwhere(bits.transpose(0, 1, 3, 4, 2)))


@pytest.mark.parametrize("most_kept", [1 << 24, 100])
@pytest.mark.parametrize(("piece_bytes", "span"), [(1 << 23, (0, FRAMES)), (1, (2, 6))])
def test_sums_do_not_depend_on_what_is_kept(monkeypatch, most_kept, piece_bytes, span) -> None:
    monkeypatch.setattr(count_arrays, "MOST_KEPT", most_kept)
    monkeypatch.setattr(count_arrays, "PIECE_BYTES", piece_bytes)
    counts, seen = counts_of_bits(BITS, span), BITS[:, :, span[0] : span[1]]
    if seen.sum() <= most_kept:
        check_counts(counts, seen)
    else:
        np.testing.assert_array_equal(counts.dense, seen.sum(axis=2))
        assert counts.frame is None


@pytest.mark.parametrize(("grid", "cfa"), [(GRID, "GRBG"), (EIGHTS, None)])
def test_exported_cubes_come_in_by_their_poses(tmp_path: Path, grid: CameraGrid, cfa: str | None) -> None:
    cubes = write_cubes(tmp_path, bits_of(grid), grid, cfa)
    assert run("import", cubes, "-o", tmp_path / "back", "--focal-mm", 50, "--counts") == 0
    back = open_dataset(tmp_path / "back")
    assert (back.cfa, back.grid.shape_KLHW, back.grid.shear_px) == (cfa, grid.shape_KLHW, grid.shear_px)
    assert back.grid.pixel_mm == pytest.approx(grid.pixel_mm)
    check_counts(back.counts, bits_of(grid))


def test_a_dataset_of_visionsim_is_one_camera(tmp_path: Path) -> None:
    view = write_cubes(tmp_path, BITS, GRID) / "01_02"
    np.save(view / "frames.npy", packed(BITS[1, 2])[..., None])  # visionsim has an axis for the channel
    options = ["--pixel-mm", 0.05, "--cfa", "RGGB", "--frames", 2, 8]
    assert run("import", view, "-o", tmp_path / "one", *options) == 0
    dataset = open_dataset(tmp_path / "one")
    assert (dataset.grid.rows, dataset.grid.cols, dataset.grid.focal_mm, dataset.cfa) == (1, 1, 50, "RGGB")
    np.testing.assert_array_equal(dataset.counts.view(0, 0), BITS[1, 2, 2:].sum(axis=0))


@pytest.mark.parametrize("kept", ["files", "one file", "counted file"])
def test_frames_in_numpy_files(tmp_path: Path, kept: str) -> None:
    pattern, source = None, tmp_path / "all.npy"
    options: dict[str, Any] = {"stored": FrameFormat(bitpack=True, width=13), "note": [].append}
    if kept == "files":
        pattern, source = "{row}_{col}.npy", files_of(tmp_path / "views", BITS)
    elif kept == "one file":
        np.save(source, packed(BITS))
    else:
        np.save(source, packed(BITS).reshape(6, *packed(BITS).shape[2:]))
        options["grid"] = (2, 3)
    order = ViewOrder(flip_rows=True)
    counts = import_counts(source, OPTICS, pattern=pattern, frames=(1, 7), order=order, **options)
    assert counts.readout.frames == 7
    check_counts(counts, BITS[::-1, :, 1:8])


@pytest.mark.parametrize("share", [0.01, 0.3])
def test_packed_bits_that_are_read_as_counts_are_warned_of(share: float) -> None:
    rng, told = np.random.default_rng(1), []
    import_counts(packed(rng.random((1, 2, 40, 16, 64)) < share), OPTICS, note=told.append)
    assert told == [
        "warning: array looks like bits packed eight to a byte; if so, import again with --bitpack"
    ]
    counts = rng.poisson(20 * share, (1, 2, 40, 16, 64)).astype(np.uint8)
    import_counts(counts, OPTICS, note=told.append)
    assert len(told) == 1


@pytest.mark.parametrize(("lit", "width"), [(61, 64), (61, None), (50, 64), (61, 61)])
def test_columns_without_a_count_are_warned_of(lit: int, width: int | None) -> None:
    bits, told = np.zeros((1, 2, 40, 16, 64), bool), []
    bits[..., :lit] = np.random.default_rng(1).random((1, 2, 40, 16, lit)) < 0.1
    import_counts(packed(bits), OPTICS, stored=FrameFormat(bitpack=True, width=width), note=told.append)
    words = f"warning: the last {64 - lit} columns of 64 have no count in any view"
    assert [sentence.split(";")[0] for sentence in told] == ([] if lit == width else [words])


def cubes(view: str = ".", **members: Any) -> Callable[[Path], Path]:
    """An export, or one camera of it, of which members of its transforms.json are replaced."""

    def make(root: Path) -> Path:
        folder = write_cubes(root, BITS, GRID) / view
        document = json.loads((folder / "transforms.json").read_text()) | members
        (folder / "transforms.json").write_text(json.dumps(document))
        return folder

    return make


POSES = [{"transform_matrix": (np.eye(4) + step * np.eye(4, k=3)).tolist()} for step in (0, 1e-6)]
FILES = ["--bitpack", "--pattern", "{row}_{col}/frames.npy", *CAMERAS]
WRONG: list[tuple[Callable[[Path], Path], list[Any], str]] = [
    (cubes(), [*FILES, "--frames", 3, 9], r"has the frames 0 to 8; .* got 3 and 9"),
    (cubes(), [*FILES, "--width", 10], "bits beyond the 10 pixels of a row are set"),
    (cubes(), ["--counts", *FILES[1:], "--width", 13], "--width: is for packed frames"),
    (cubes(bitpack_dim=1), [], "bitpack_dim: expected 2, the width, got 1"),
    (cubes(w=30, cx=15), [], "rows are of 9 to 16 pixels, and the stated width is 30"),
    (cubes(cfa="RGGB"), ["--cfa", "GRBG"], "cfa: is RGGB; leave out --cfa"),
    (cubes("00_01", frames=POSES), [], "the camera moves, and a moving camera is no grid"),
]


@pytest.mark.parametrize(("make", "options", "words"), WRONG)
def test_one_sentence_and_exit_code_2(tmp_path: Path, capsys, make, options, words: str) -> None:
    check_refused(make(tmp_path), tmp_path / "out", options, words, capsys)


def test_a_view_of_other_frames_is_refused(tmp_path: Path) -> None:
    np.save(files_of(tmp_path / "views", BITS) / "1_0.npy", packed(BITS[1, 0])[1:])
    with pytest.raises(InputError, match=r"1_0.npy: has frames uint8 .8, 11, 2., where .*0_0.npy"):
        import_counts(tmp_path / "views", OPTICS, pattern="{row}_{col}.npy", stored=PACKED)
