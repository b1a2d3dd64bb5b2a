"""Photon cubes are what NumPy and other people's programs read, and take the room of their photons alone."""

import json
from pathlib import Path

import numpy as np
import pytest
from photon_cubes import FRAMES, bits_of, packed, write_cubes
from stored_datasets import one_sentence

import pcii

BLOCK_BYTES = 4096
GRID = pcii.CameraGrid(rows=2, cols=3, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=11, width=13)
SHEARED = pcii.CameraGrid(
    rows=2, cols=2, pitch_mm=(5, 7), focal_mm=50, pixel_mm=0.05, height=6, width=16, shear_px=(1.5, -2)
)


def one_camera(height: int, width: int) -> pcii.CameraGrid:
    return pcii.CameraGrid(
        rows=1, cols=1, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=height, width=width
    )


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
    grid = one_camera(256, 256)
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
