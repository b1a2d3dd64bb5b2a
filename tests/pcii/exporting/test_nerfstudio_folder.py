"""The folder that nerfstudio reads, by NumPy and the format's description: X right, Y up, looking to -Z."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rendered_planes import ABOVE_MM, plane_z_mm, view, write_planes
from stored_datasets import make_dataset, one_sentence

import pcii
from pcii.app.commands import app
from pcii.base import command_line
from pcii.core.array_labels import TRUTH_LABELS
from pcii.core.camera_grid import CameraGrid
from pcii.exporting.export_formats import export_dataset
from pcii.importing.posed_pictures import import_posed_pictures
from pcii.io.dataset_layout import TRUTH, read_manifest, write_manifest
from pcii.io.zarr_groups import write_arrays_safely
from pcii.store.file_list import list_files
from pcii.transforms.transforms_file import read_transforms


def grid_of(rows: int, cols: int, **changes: Any) -> CameraGrid:
    values = {"pitch_mm": (9.0, 7.0), "focal_mm": 25.0, "pixel_mm": 0.1, "height": 40, "width": 48}
    return CameraGrid(rows=rows, cols=cols, **values | changes)


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

    def seen_px(self, number: int, point_m: np.ndarray) -> np.ndarray:
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


def exported(dataset: Path, name: str = "posed") -> Posed:
    return Posed(export_dataset(dataset, "nerfstudio", dataset.with_name(name)))


SHEARS = pytest.mark.parametrize("shear_px", [(0.0, 0.0), (1.5, -0.75)], ids=["plain", "sheared"])


@SHEARS
def test_points_are_where_the_cameras_of_the_dataset_see_them(tmp_path: Path, shear_px) -> None:
    """A point (X, Y, Z) mm is at column (W-1)/2 + f (X - X_l) / (Z p) + shear; see docs/cameras.md."""
    grid = grid_of(3, 4, shear_px=shear_px)
    found = exported(write_planes(tmp_path / "planes", grid))
    X, Y, Z = point = np.array([13.0, -21.0, 450.0])
    for k, l in np.ndindex(3, 4):
        right, down = l - 1.5, k - 1
        expected = [
            (48 - 1) / 2 + 250 * (X - 9 * right) / Z + shear_px[0] * right,
            (40 - 1) / 2 + 250 * (Y - 7 * down) / Z + shear_px[1] * down,
        ]
        seen = found.seen_px(4 * k + l, point * [1, -1, -1] / 1000)
        np.testing.assert_allclose(seen - 0.5, expected, atol=1e-9)
    assert found.frames[5]["file_path"] == "images/01_01.png"


def test_cameras_further_right_have_larger_x_and_further_down_smaller_y(tmp_path: Path) -> None:
    found = exported(write_planes(tmp_path / "planes", grid_of(2, 3)))
    places = found.poses[:, :3, 3].reshape(2, 3, 3)
    np.testing.assert_allclose(np.diff(places[..., 0], axis=1), 0.009)
    np.testing.assert_allclose(np.diff(places[..., 1], axis=0), -0.007)
    np.testing.assert_array_equal(places[..., 2], 0)
    np.testing.assert_array_equal(found.poses[:, :3, :3], np.broadcast_to(np.eye(3), (6, 3, 3)))


@SHEARS
def test_depths_and_poses_fit_the_planes(tmp_path: Path, shear_px) -> None:
    grid = grid_of(2, 3, shear_px=shear_px)
    found = exported(write_planes(tmp_path / "planes", grid, view_truth=True))
    for number, (k, l) in enumerate(np.ndindex(2, 3)):
        z_m = plane_z_mm(grid, k, l) / 1000
        np.testing.assert_allclose(found.depth_m(number), z_m, rtol=1e-6)
        points = found.points_m(number)
        np.testing.assert_allclose(points[..., 2], -z_m, rtol=1e-6)
        # The near plane is where Y < 0, which is up: its pixels are those that see it.
        near = z_m == ABOVE_MM / 1000
        assert (points[near][:, 1] > 0).all()
        np.testing.assert_allclose(
            found.picture(number) / 255, srgb(view(grid, k, l), found), atol=0.51 / 255
        )


def srgb(radiance: np.ndarray, found: Posed) -> np.ndarray:
    """Radiance as sRGB (IEC 61966-2-1), of which 1 is the white of the file."""
    share = np.clip(radiance / found.top["white"], 0, 1)
    return np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)


def test_what_hits_nothing_has_no_depth(tmp_path: Path) -> None:
    grid = grid_of(1, 2)
    z_mm = np.full(grid.shape_KLHW, 500.0)
    z_mm[0, 1, 3, 4] = np.inf
    views = pcii.Views(np.ones((*grid.shape_KLHW, 3), np.float32), grid)
    pcii.save_dataset(tmp_path / "data", views, view_z_mm=z_mm)
    found = exported(tmp_path / "data")
    assert found.depth_m(1)[3, 4] == 0
    assert np.count_nonzero(found.depth_m(0)) == 40 * 48


def test_nerfstudio_takes_centres_of_frames_only_where_there_is_none_at_the_top(tmp_path: Path) -> None:
    plain = exported(write_planes(tmp_path / "plain", grid_of(1, 2)), "a")
    assert (plain.top["cx"], plain.top["cy"]) == (24, 20)
    sheared = exported(write_planes(tmp_path / "sheared", grid_of(1, 2, shear_px=(1.0, 0.0))), "b")
    assert not {"cx", "cy"} & set(sheared.top)
    assert [frame["cx"] for frame in sheared.frames] == [23.5, 24.5]


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("grid", "cfa"),
    [
        (grid_of(3, 3), None),
        (grid_of(2, 3, shear_px=(1.5, -0.75)), None),
        (grid_of(1, 3, pixel_mm=0.1 / 3), "GRBG"),
        (grid_of(1, 1), None),
    ],
    ids=["plain", "sheared", "mosaic", "single"],
)
def test_exported_again_every_byte_is_the_same(tmp_path: Path, grid, cfa) -> None:
    planes = write_planes(tmp_path / "planes", grid, cfa, view_truth=True, radiance_unit="cd/m^2")
    first = exported(planes, "first")
    assert command_line.run(app, ["import", str(first.folder), "-o", str(tmp_path / "again")]) == 0
    assert pcii.open_dataset(tmp_path / "again").grid == grid
    second = exported(tmp_path / "again", "second")
    assert files(second.folder) == files(first.folder)
    assert first.top["unit"] == "cd/m^2"
    assert len(files(first.folder)) == 2 * grid.view_count + 1


@pytest.mark.parametrize("white", [0.0, 1e-20, 1e20])
def test_the_darkest_and_the_brightest_light_comes_back(tmp_path: Path, white: float) -> None:
    grid = grid_of(1, 3, height=4, width=5)
    light = white * np.linspace(0, 1, 3 * 4 * 5 * 3).reshape(*grid.shape_KLHW, 3)
    pcii.save_dataset(tmp_path / "data", pcii.Views(light.astype(np.float32), grid))
    first = exported(tmp_path / "data", "first")
    assert command_line.run(app, ["import", str(first.folder), "-o", str(tmp_path / "again")]) == 0
    assert files(exported(tmp_path / "again", "second").folder) == files(first.folder)


def test_photons_come_back_each(tmp_path: Path) -> None:
    kept = pcii.open_dataset(make_dataset(tmp_path / "data"))
    dark = {name: entry for name, entry in kept.manifest["files"].items() if not name.startswith("radiance")}
    data = make_dataset(tmp_path / "photons", files=dark)
    first = exported(data, "first")
    assert (first.top["quantity"], first.top["cfa"]) == ("photons", "GRBG")
    assert command_line.run(app, ["import", str(first.folder), "-o", str(tmp_path / "again")]) == 0
    again = pcii.open_dataset(tmp_path / "again")
    assert again.counts.cfa == "GRBG"
    np.testing.assert_array_equal(again.counts.dense, kept.counts.dense)
    assert files(exported(tmp_path / "again", "second").folder) == files(first.folder)


def test_more_photons_than_8_bits_hold_come_back_as_radiance(tmp_path: Path, capsys) -> None:
    grid = grid_of(1, 2, height=2, width=3)
    dense = np.arange(12).reshape(grid.shape_KLHW) * 100
    pcii.save_dataset(tmp_path / "data", pcii.PhotonCounts.from_dense(dense, grid, cfa="GRBG"))
    found = exported(tmp_path / "data")
    assert command_line.run(app, ["import", str(found.folder), "-o", str(tmp_path / "again")]) == 0
    assert "do not keep every photon" in capsys.readouterr().out
    views = pcii.open_dataset(tmp_path / "again").views
    assert views is not None
    assert views.cfa == "GRBG"
    np.testing.assert_allclose(np.asarray(views.radiance)[..., 0], dense, atol=1100 / 510 + 1e-3)


def test_true_cameras_are_told_and_depth_is_along_their_axes(tmp_path: Path) -> None:
    """A wall at Z = 600 mm: camera 1 is 5 mm ahead of its place and looks 30 degrees to the right."""
    grid = grid_of(1, 2)
    data = tmp_path / "data"
    pcii.save_dataset(data, pcii.Views(np.ones((*grid.shape_KLHW, 3), np.float32), grid))
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    rotation = np.broadcast_to(np.eye(3), (1, 2, 3, 3)).copy()
    rotation[0, 1] = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T  # columns: right, down, forward
    place = np.array([[[-4.5, 0, 0], [4.5, 2, 5]]])
    arrays = {
        "camera_position_mm": place,
        "camera_rotation": rotation,
        "view_z_mm": np.full(grid.shape_KLHW, 600.0, np.float32),
    }
    write_arrays_safely(data / TRUTH, arrays, TRUTH_LABELS)
    files_then = read_manifest(data)["files"] | list_files(data, [TRUTH])
    write_manifest(data, read_manifest(data) | {"files": files_then})
    found = exported(data)
    assert "camera_grid" not in found.top
    np.testing.assert_allclose(found.poses[1, :3, 3], [0.0045, -0.002, -0.005])
    np.testing.assert_allclose(found.poses[1, :3, 2], [-s, 0, c], atol=1e-15)  # backwards: to the left
    for number in range(2):
        np.testing.assert_allclose(found.points_m(number)[..., 2], -0.6, rtol=1e-6)
    told = one_sentence(
        lambda: import_posed_pictures(read_transforms(found.folder / "transforms.json")),
        found.folder / "transforms.json",
    )
    assert "degrees from the common orientation" in told
