"""Photon cubes and frames of strangers come in, and what is wrong is one sentence."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run_pcii as run
from picture_folders import OPTICS, check_refused
from stored_datasets import one_sentence
from twins import unit_grid

import pcii
from pcii import CameraGrid, FrameFormat, ViewOrder, import_counts, open_dataset
from pcii.types import PhotonCounts

CAMERAS = ["--pitch-mm", "5", "7", "--focal-mm", "50", "--pixel-mm", "0.05"]
GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=11, width=13)
FRAMES = 9


def bits_of(grid: CameraGrid, frames: int = FRAMES, share: float = 0.1) -> np.ndarray:
    """Random bits (K, L, T, H, W), bool."""
    K, L, H, W = grid.shape_KLHW
    return np.random.default_rng(1).random((K, L, frames, H, W)) < share


def counts_of(bits: np.ndarray, grid: CameraGrid, cfa: str | None = None) -> pcii.PhotonCounts:
    """Photon counts with the frame of each."""
    k, l, frame, i, j = np.nonzero(bits)
    ones = np.ones(k.size, int)
    readout: dict[str, Any] = {"frames": bits.shape[2], "bits": 1, "frame": frame}
    return pcii.PhotonCounts.from_events(k, l, i, j, ones, grid, cfa=cfa, **readout)


def write_cubes(root: Path, bits: np.ndarray, grid: CameraGrid, cfa: str | None = None) -> Path:
    """The export of a dataset of these bits."""
    data = pcii.save_dataset(root / "data", counts_of(bits, grid, cfa), photon_budget=90)
    return pcii.export_dataset(data, "photoncube", root / "cubes")


def packed(bits: np.ndarray) -> np.ndarray:
    """Eight pixels of a row in a byte, the first in the highest bit, written out."""
    padded = np.concatenate([bits, np.zeros((*bits.shape[:-1], -bits.shape[-1] % 8), bool)], axis=-1)
    eights = padded.reshape(*bits.shape[:-1], -1, 8)
    return (eights * [128, 64, 32, 16, 8, 4, 2, 1]).sum(axis=-1).astype(np.uint8)


BITS = bits_of(GRID)


def counts_of_bits(bits: np.ndarray, span: tuple[int, int]) -> PhotonCounts:
    """Counts of packed frames in memory."""
    frames, width = (span[0], span[1] - 1), bits.shape[4]
    stored = FrameFormat(bitpack=True, width=width)
    return import_counts(packed(bits), OPTICS, frames=frames, stored=stored, note=[].append)


def check_counts(counts: PhotonCounts, bits: np.ndarray) -> None:
    """Sums and the frame of every single count are those of the bits (K, L, T, H, W)."""
    np.testing.assert_array_equal(counts.dense, bits.sum(axis=2))
    events: Any = counts.frame_events
    listed = np.stack([events.k, events.l, events.i, events.j, events.frame], axis=1)
    np.testing.assert_array_equal(listed, np.argwhere(bits.transpose(0, 1, 3, 4, 2)))


@pytest.mark.parametrize("most_kept", [1 << 24, 100])
@pytest.mark.parametrize(("piece_bytes", "span"), [(1 << 23, (0, FRAMES)), (1, (2, 6))])
def test_sums_do_not_depend_on_what_is_kept(monkeypatch, most_kept, piece_bytes, span) -> None:
    for shape, share in (((1, 1, 1), 1.0), ((2, 3, 5), 0.0), ((300, 2, 33), 0.5)):
        bits = np.random.default_rng(3).random((1, 1, *shape)) < share
        check_counts(counts_of_bits(bits, (0, shape[0])), bits)
    monkeypatch.setattr("pcii.exchange.count_arrays.MOST_KEPT", most_kept)
    monkeypatch.setattr("pcii.exchange.count_arrays.PIECE_BYTES", piece_bytes)
    counts, seen = counts_of_bits(BITS, span), BITS[:, :, span[0] : span[1]]
    if seen.sum() <= most_kept:
        check_counts(counts, seen)
    else:
        np.testing.assert_array_equal(counts.dense, seen.sum(axis=2))
        assert counts.frame is None


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
        pattern, source = "{row}_{col}.npy", tmp_path
        for k, l in np.ndindex(BITS.shape[:2]):
            np.save(tmp_path / f"{k}_{l}.npy", packed(BITS[k, l]))
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
    rng, notes = np.random.default_rng(1), []
    import_counts(packed(rng.random((1, 2, 40, 16, 64)) < share), OPTICS, note=notes.append)
    words = "warning: array looks like bits packed eight to a byte; if so, import again with --bitpack"
    assert notes == [words]
    counts = rng.poisson(20 * share, (1, 2, 40, 16, 64)).astype(np.uint8)
    import_counts(counts, OPTICS, note=notes.append)
    assert len(notes) == 1


@pytest.mark.parametrize(("lit", "width"), [(61, 64), (61, None), (50, 64), (61, 61)])
def test_columns_without_a_count_are_warned_of(lit: int, width: int | None) -> None:
    bits, notes = np.zeros((1, 2, 40, 16, 64), bool), []
    bits[..., :lit] = np.random.default_rng(1).random((1, 2, 40, 16, lit)) < 0.1
    import_counts(packed(bits), OPTICS, stored=FrameFormat(bitpack=True, width=width), note=notes.append)
    words = f"warning: the last {64 - lit} columns of 64 have no count in any view"
    assert [sentence.split(";")[0] for sentence in notes] == ([] if lit == width else [words])


def cubes(view: str = ".", **members: Any) -> Callable[[Path], Path]:
    """An export, or one camera of it, of which members of its transforms.json are replaced."""

    def make(root: Path) -> Path:
        folder = write_cubes(root, BITS, GRID) / view
        document = json.loads((folder / "transforms.json").read_text()) | members
        (folder / "transforms.json").write_text(json.dumps(document))
        return folder

    return make


def with_a_shorter_view(root: Path) -> Path:
    folder = write_cubes(root, BITS, GRID)
    np.save(folder / "01_00" / "frames.npy", packed(BITS[1, 0])[1:])
    return folder


POSES = [{"transform_matrix": (np.eye(4) + step * np.eye(4, k=3)).tolist()} for step in (0, 1e-6)]
FILES = ["--bitpack", "--pattern", "{row}_{col}/frames.npy", *CAMERAS]
WRONG: list[tuple[Callable[[Path], Path], list[Any], str]] = [
    (cubes(), [*FILES, "--frames", 3, 9], r"has the frames 0 to 8; .* got 3 and 9"),
    (cubes(), [*FILES, "--width", 10], "bits beyond the 10 pixels of a row are set"),
    (cubes(), [*FILES, "--width", 0], "and the stated width is 0"),
    (cubes(), ["--counts", *FILES[1:], "--width", 13], "--width: is for packed frames"),
    (cubes(bitpack_dim=1), [], "bitpack_dim: expected 2, the width, got 1"),
    (cubes(w=30, cx=15), [], "rows are of 9 to 16 pixels, and the stated width is 30"),
    (cubes(cfa="RGGB"), ["--cfa", "GRBG"], "cfa: is RGGB; leave out --cfa"),
    (cubes("00_01", frames=POSES), [], "the camera moves, and a moving camera is no grid"),
    (with_a_shorter_view, FILES, "frames.npy: has frames uint8 .8, 11, 2., where .*00_00/frames.npy"),
]


@pytest.mark.parametrize(("make", "options", "words"), WRONG)
def test_one_sentence_and_exit_code_2(tmp_path: Path, capsys, make, options, words: str) -> None:
    check_refused(make(tmp_path), tmp_path / "out", options, words, capsys)


BLOCK_BYTES = 4096
SHEARED = replace(GRID, cols=2, height=6, width=16, shear_px=(1.5, -2))


@pytest.mark.parametrize("grid", [GRID, SHEARED])
def test_cubes_are_the_packed_frames_of_every_view(tmp_path: Path, grid: pcii.CameraGrid) -> None:
    bits = bits_of(grid)
    out = write_cubes(tmp_path, bits, grid, "GRBG")
    K, L, H, W = grid.shape_KLHW
    top = json.loads((out / "transforms.json").read_text())
    packing = {"c": 1, "bitpack": True, "bitpack_dim": 2, "cfa": "GRBG"}
    assert top.items() >= (packing | {"num_frames": FRAMES, "photon_budget": 90}).items()
    for (k, l), frame in zip(np.ndindex(K, L), top["frames"], strict=True):
        assert frame["file_path"] == f"0{k}_0{l}/frames.npy"
        np.testing.assert_array_equal(np.load(out / frame["file_path"]), packed(bits[k, l]))
        view = json.loads((out / f"0{k}_0{l}" / "transforms.json").read_text())
        assert view.items() >= (packing | {"w": W, "h": H, "file_path": "frames.npy"}).items()
        assert view["frames"] == [{"transform_matrix": frame["transform_matrix"]}] * FRAMES
        # A camera further right is at a larger X, one further down at a smaller Y, in metres.
        x, y = np.array(frame["transform_matrix"])[:2, 3]
        assert (x, y) == pytest.approx((0.005 * (l - (L - 1) / 2), -0.007 * (k - (K - 1) / 2)))
        shear = np.array([(l - (L - 1) / 2) * grid.shear_px[0], (k - (K - 1) / 2) * grid.shear_px[1]])
        assert [view["cx"], view["cy"]] == pytest.approx(np.array([W / 2, H / 2]) + shear)


def test_blocks_without_photons_take_no_room(tmp_path: Path) -> None:
    grid = unit_grid(1, 1, 256, 256)
    frame, i, j = np.array([[0, 0, 150, 299], [0, 3, 100, 255], [0, 9, 50, 255]])
    zero, one = np.zeros(4, int), np.ones(4, int)
    counts = pcii.PhotonCounts.from_events(zero, zero, i, j, one, grid, frames=300, bits=1, frame=frame)
    data = pcii.save_dataset(tmp_path / "data", counts)
    path = pcii.export_dataset(data, "photoncube", tmp_path / "out") / "00_00" / "frames.npy"
    assert path.stat().st_size > 300 * 256 * 32
    assert path.stat().st_blocks * 512 <= 8 * BLOCK_BYTES
    indices = np.argwhere(np.unpackbits(np.load(path), axis=2))
    np.testing.assert_array_equal(indices, np.stack([frame, i, j], axis=1))


def test_counts_without_frames_are_refused_and_a_single_frame_is_one(tmp_path: Path) -> None:
    bits = bits_of(GRID)
    sums = pcii.PhotonCounts.from_dense(bits.sum(axis=2), GRID, frames=FRAMES, bits=1)
    data = pcii.save_dataset(tmp_path / "sums", sums)
    message = one_sentence(lambda: pcii.export_dataset(data, "photoncube", tmp_path / "out"), data.path)
    assert "products.frames = true" in message
    assert not (tmp_path / "out").exists()
    single_frame = pcii.PhotonCounts.from_dense(bits[:, :, 0].astype(int), GRID, bits=1)
    data = pcii.save_dataset(tmp_path / "single", single_frame)
    out = pcii.export_dataset(data, "photoncube", tmp_path / "out")
    np.testing.assert_array_equal(np.load(out / "01_02" / "frames.npy"), packed(bits[1, 2, :1]))
