"""The folder that nerfstudio reads, by NumPy and the format's description: X right, Y up, looking to -Z."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rendered_planes import ABOVE_MM, plane_z_mm, srgb, view, write_planes
from stored_datasets import rewrite_manifest

import pcii
from pcii.store import TRUTH, list_files, read_manifest, write_arrays_safely
from pcii.types import TRUTH_LABELS


def grid_of(rows: int, cols: int, **changes: Any) -> pcii.CameraGrid:
    values = {"pitch_mm": (9.0, 7.0), "focal_mm": 25.0, "pixel_mm": 0.1, "height": 40, "width": 48}
    return pcii.CameraGrid(rows=rows, cols=cols, **values | changes)


class Posed:
    """The file and its pictures; members of a frame win over those at the top."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.top = json.loads((folder / "transforms.json").read_text())
        self.frames = [self.top | frame for frame in self.top.pop("frames")]
        self.poses = np.array([frame["transform_matrix"] for frame in self.frames])

    def picture(self, number: int) -> np.ndarray:
        return np.array(Image.open(self.folder / self.frames[number]["file_path"]))

    def depth_m(self, number: int) -> np.ndarray:
        """As data_utils.get_depth_image_from_path and the default of depth_unit_scale_factor have it."""
        return np.load(self.folder / self.frames[number]["depth_file_path"]).astype(np.float32) * 1e-3

    def image_px(self, number: int, point_m: np.ndarray) -> np.ndarray:
        """Where points (..., 3) are in a picture: (column, row), the first pixel's centre at 0.5."""
        frame, pose = self.frames[number], self.poses[number]
        x, y, z = np.moveaxis((point_m - pose[:3, 3]) @ pose[:3, :3], -1, 0)
        return np.stack([frame["cx"] + frame["fl_x"] * x / -z, frame["cy"] - frame["fl_y"] * y / -z], axis=-1)

    def points_m(self, number: int) -> np.ndarray:
        """What the pixels of a picture see, (H, W, 3), by its depth."""
        frame, pose, depth = self.frames[number], self.poses[number], self.depth_m(number)
        i, j = np.mgrid[: frame["h"], : frame["w"]] + 0.5
        x = (j - frame["cx"]) / frame["fl_x"] * depth
        y = -(i - frame["cy"]) / frame["fl_y"] * depth
        return np.stack([x, y, -depth], axis=-1) @ pose[:3, :3].T + pose[:3, 3]


def exported(dataset: Path) -> Posed:
    return Posed(pcii.export_dataset(dataset, "nerfstudio", dataset.with_name(f"{dataset.name}-posed")))


SHEARS = pytest.mark.parametrize("shear_px", [(0.0, 0.0), (1.5, -0.75)], ids=["plain", "sheared"])


@SHEARS
def test_points_are_where_the_cameras_of_the_dataset_see_them(tmp_path: Path, shear_px) -> None:
    """A point (X, Y, Z) mm is at column (W-1)/2 + f (X - X_l) / (Z p) + shear; see docs/cameras.md."""
    grid = grid_of(3, 4, shear_px=shear_px)
    posed = exported(write_planes(tmp_path / "planes", grid))
    for X, Y, Z in ((13.0, -21.0, 450.0), (-8.0, 11.0, 900.0)):
        for number, (k, l) in enumerate(np.ndindex(3, 4)):
            right, down = l - 1.5, k - 1
            expected = [
                (48 - 1) / 2 + 250 * (X - 9 * right) / Z + shear_px[0] * right,
                (40 - 1) / 2 + 250 * (Y - 7 * down) / Z + shear_px[1] * down,
            ]
            position = posed.image_px(number, np.array([X, -Y, -Z]) / 1000)
            np.testing.assert_allclose(position - 0.5, expected, atol=1e-9)
    places = posed.poses[:, :3, 3].reshape(3, 4, 3)
    np.testing.assert_allclose(np.diff(places[..., 0], axis=1), 0.009)  # further right: larger x
    np.testing.assert_allclose(np.diff(places[..., 1], axis=0), -0.007)  # further down: smaller y
    assert posed.frames[5]["file_path"] == "images/01_01.png"
    assert ("cx" in posed.top) != any(shear_px)  # nerfstudio would take a centre at the top for all frames


@SHEARS
def test_depths_and_poses_fit_the_planes(tmp_path: Path, shear_px) -> None:
    grid = grid_of(2, 3, shear_px=shear_px)
    posed = exported(write_planes(tmp_path / "planes", grid, view_truth=True))
    for number, (k, l) in enumerate(np.ndindex(2, 3)):
        z_m = plane_z_mm(grid, k, l) / 1000
        np.testing.assert_allclose(posed.depth_m(number), z_m, rtol=1e-6)
        points = posed.points_m(number)
        np.testing.assert_allclose(points[..., 2], -z_m, rtol=1e-6)
        # The near plane is where Y < 0, which is up: its pixels are those that see it.
        near = z_m == ABOVE_MM / 1000
        assert (points[near][:, 1] > 0).all()
        numbers = srgb(view(grid, k, l) / posed.top["white"])
        np.testing.assert_allclose(posed.picture(number) / 255, numbers, atol=0.51 / 255)


def test_what_hits_nothing_has_no_depth(tmp_path: Path) -> None:
    grid = grid_of(1, 2)
    z_mm = np.full(grid.shape_KLHW, 500.0)
    z_mm[0, 1, 3, 4] = np.inf
    views = pcii.Views(np.ones((*grid.shape_KLHW, 3), np.float32), grid)
    posed = exported(pcii.save_dataset(tmp_path / "data", views, view_z_mm=z_mm).path)
    assert posed.depth_m(1)[3, 4] == 0
    assert np.count_nonzero(posed.depth_m(0)) == 40 * 48


def test_photons_are_proportional_to_the_numbers(tmp_path: Path) -> None:
    grid = grid_of(1, 2, height=2, width=3)
    dense = np.arange(12).reshape(grid.shape_KLHW) * 100
    counts = pcii.PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    posed = exported(pcii.save_dataset(tmp_path / "data", counts).path)
    stated = {name: posed.top[name] for name in ("quantity", "unit", "white", "cfa")}
    assert stated == {"quantity": "photons", "unit": "photons", "white": 1100, "cfa": "GRBG"}
    for l in range(2):
        photons = posed.picture(l) / 255 * 1100
        np.testing.assert_allclose(photons, np.repeat(dense[0, l, ..., None], 3, axis=2), atol=1100 / 510)


def test_poses_are_those_of_the_true_cameras_and_depth_is_along_their_axes(tmp_path: Path) -> None:
    """A wall at Z = 600 mm: camera 1 is 5 mm ahead of its place and looks 30 degrees to the right."""
    grid = grid_of(1, 2)
    data = tmp_path / "data"
    pcii.save_dataset(data, pcii.Views(np.ones((*grid.shape_KLHW, 3), np.float32), grid))
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    rotation = np.broadcast_to(np.eye(3), (1, 2, 3, 3)).copy()
    rotation[0, 1] = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T  # columns: right, down, forward
    arrays = {
        "camera_position_mm": np.array([[[-4.5, 0, 0], [4.5, 2, 5]]]),
        "camera_rotation": rotation,
        "view_z_mm": np.full(grid.shape_KLHW, 600.0, np.float32),
    }
    write_arrays_safely(data / TRUTH, arrays, TRUTH_LABELS)
    rewrite_manifest(data, files=read_manifest(data).files | list_files(data, [TRUTH]))
    posed = exported(data)
    assert "camera_grid" not in posed.top
    np.testing.assert_allclose(posed.poses[1, :3, 3], [0.0045, -0.002, -0.005])
    np.testing.assert_allclose(posed.poses[1, :3, 2], [-s, 0, c], atol=1e-15)  # backwards: to the left
    for number in range(2):
        np.testing.assert_allclose(posed.points_m(number)[..., 2], -0.6, rtol=1e-6)
    hci = pcii.export_dataset(data, "hci", tmp_path / "hci")  # whose maps are of cameras in their places
    assert not list(hci.glob("*.pfm"))
