"""Exports, by what the authors of each format publish of it, and nothing is half written."""

import configparser
import json
import shutil
import tarfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from stored_datasets import (
    DENSE,
    GRID,
    IDS,
    Z_MM,
    flip_a_bit,
    largest_file,
    list_datasets,
    make_dataset,
    one_sentence,
    rewrite_manifest,
)

import pcii
from pcii.store import (
    COUNTS,
    RADIANCE,
    TRUTH,
    TRUTH_LABELS,
    list_files,
    read_manifest,
    save_dataset,
    write_arrays_safely,
    write_index,
)
from pcii.types import CameraGrid, Truth, Views, mosaic

ABOVE_MM, BELOW_MM = 500.0, 800.0


def plane_z_mm(grid: CameraGrid, k: float, l: float) -> np.ndarray:
    """Depth (H, W) that camera (k, l) sees: the near plane is at Y < 0, above."""
    return np.where(_position_mm(grid, k, l, ABOVE_MM)[1] < 0, ABOVE_MM, BELOW_MM)


def _position_mm(grid: CameraGrid, k: float, l: float, z_mm: Any) -> tuple[np.ndarray, np.ndarray]:
    """Where in the world (X, Y) the camera's pixels see a plane at z."""
    i, j = np.mgrid[: grid.height, : grid.width]
    right, down = l - (grid.cols - 1) / 2, k - (grid.rows - 1) / 2
    per_px = z_mm * grid.pixel_mm / grid.focal_mm
    x = right * grid.pitch_mm[0] + per_px * (j - (grid.width - 1) / 2 - right * grid.shear_px[0])
    y = down * grid.pitch_mm[1] + per_px * (i - (grid.height - 1) / 2 - down * grid.shear_px[1])
    return x, y


def view(grid: CameraGrid, k: int, l: int) -> np.ndarray:
    """Radiance (H, W, 3) of camera (k, l): waves 9 px and longer on the middle plane, in colours."""
    x, y = _position_mm(grid, k, l, plane_z_mm(grid, k, l))
    px_mm = 650 * grid.pixel_mm / grid.focal_mm
    rng = np.random.default_rng(5)
    image = np.ones((grid.height, grid.width, 3))
    for _ in range(12):
        angle, wavelength, phase = rng.uniform(0, np.pi), rng.uniform(9, 30), rng.uniform(0, 2 * np.pi, 3)
        along = (x * np.cos(angle) + y * np.sin(angle)) / (wavelength * px_mm)
        image += 0.08 * np.sin(2 * np.pi * along[..., None] + phase)
    return image


def srgb(radiance: np.ndarray) -> np.ndarray:
    """Radiance, of which 1 is white, as sRGB (IEC 61966-2-1)."""
    share = np.clip(radiance, 0, 1)
    return np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)


def write_planes(root: Path, grid: CameraGrid, cfa: str | None = None, *, view_truth: bool = False) -> Path:
    """A dataset of radiance, a mosaic if there is a pattern, and truth, with `view_truth` of every view."""
    images = np.array([[view(grid, k, l) for l in range(grid.cols)] for k in range(grid.rows)])
    views = Views(images if cfa is None else mosaic(images, cfa)[..., None], grid, cfa)
    z_mm = plane_z_mm(grid, (grid.rows - 1) / 2, (grid.cols - 1) / 2)
    truth = Truth(z_mm, np.where(z_mm == ABOVE_MM, 1, 2), {1: "above", 2: "below"})
    every = np.array([[plane_z_mm(grid, k, l) for l in range(grid.cols)] for k in range(grid.rows)])
    return save_dataset(root, views, truth, view_z_mm=every if view_truth else None).path


def grid_of(rows: int, cols: int, **changes: Any) -> CameraGrid:
    values = {"pitch_mm": (9.0, 7.0), "focal_mm": 25.0, "pixel_mm": 0.1, "height": 40, "width": 48}
    return CameraGrid(rows=rows, cols=cols, **values | changes)


def hci_grid(rows: int, cols: int, **changes: Any) -> CameraGrid:
    """Parallax of 4.5 px at 500 mm, 2.8125 px at 800 mm."""
    return grid_of(rows, cols, **{"pitch_mm": (9.0, 9.0), "height": 80, "width": 96} | changes)


class Published:
    """A light field as the benchmark's own scripts read it: sorted images, row by row, and its parameters."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        parser = configparser.ConfigParser()
        assert parser.read(folder / "parameters.cfg")
        inside, outside, meta = parser["intrinsics"], parser["extrinsics"], parser["meta"]
        self.width, self.height = (int(inside[f"image_resolution_{axis}_px"]) for axis in "xy")
        self.focal_mm, self.sensor_mm = float(inside["focal_length_mm"]), float(inside["sensor_size_mm"])
        self.fstop = float(inside["fstop"])
        self.cols, self.rows = int(outside["num_cams_x"]), int(outside["num_cams_y"])
        self.baseline_mm, self.focus_m = float(outside["baseline_mm"]), float(outside["focus_distance_m"])
        self.offset_px = float(outside["offset"])
        self.disp_min, self.disp_max = float(meta["disp_min"]), float(meta["disp_max"])
        files = sorted(folder.glob("input_*.png"))
        assert len(files) == self.rows * self.cols
        images = np.array([np.array(Image.open(file)) for file in files])
        assert images.dtype == np.uint8
        self.light_field = images.reshape(self.rows, self.cols, self.height, self.width, 3)
        self.readme = " ".join((folder / "README.txt").read_text().split())

    def pfm(self, name: str) -> np.ndarray:
        with (self.folder / name).open("rb") as file:
            assert file.readline() == b"Pf\n"
            width, height = map(int, file.readline().split())
            scale = float(file.readline())
            values = np.frombuffer(file.read(), "<f4" if scale < 0 else ">f4")
        return values.reshape(height, width)[::-1] * abs(scale)

    def disparity_px(self, depth_m: np.ndarray) -> np.ndarray:
        """The benchmark's conversion of depth, step by step as it stands in its toolkit."""
        factor = (self.baseline_mm / 1000) * self.focal_mm * max(self.width, self.height)
        return (factor * self.focus_m / depth_m - factor) / self.focus_m / self.sensor_mm

    def depth_m(self, disparity_px: np.ndarray) -> np.ndarray:
        factor = self.baseline_mm * self.focal_mm * max(self.width, self.height)
        return 1 / (1000 * self.sensor_mm * disparity_px / factor + 1 / self.focus_m)


def exported_hci(dataset: Path) -> Published:
    return Published(pcii.export_dataset(dataset, "hci", dataset.with_name("hci")))


@pytest.mark.parametrize("cfa", [None, "GRBG"])
@pytest.mark.parametrize("shear", [0.0, 3.5])
def test_images_are_those_of_the_cameras_row_by_row(tmp_path, shear, cfa):
    grid = hci_grid(3, 3, shear_px=(shear, shear))
    hci = exported_hci(write_planes(tmp_path / "planes", grid, cfa))
    disparity = hci.pfm("gt_disp_lowres.pfm")
    for rows, parallax in ((slice(10, 30), 4.5), (slice(52, 70), 2.8125)):
        assert np.median(disparity[rows]) == pytest.approx(parallax - shear, abs=1e-5)
    white = float(hci.readme.split("255 is ")[1].split()[0])
    numbers = np.array([[srgb(view(grid, k, l) / white) for l in range(3)] for k in range(3)])
    if cfa is None:
        np.testing.assert_allclose(hci.light_field / 255, numbers, atol=0.51 / 255)
    else:  # demosaicing changes edges; the next view is off by 0.023 to 0.08 on average
        assert np.abs(hci.light_field / 255 - numbers).mean(axis=(2, 3, 4)).max() < 0.01


@pytest.mark.parametrize("shear", [0.0, 3.5])
def test_the_published_formulas_hold_for_maps_and_parameters(tmp_path, shear):
    hci = exported_hci(write_planes(tmp_path / "planes", hci_grid(3, 5, shear_px=(shear, shear))))
    depth, disparity = hci.pfm("gt_depth_lowres.pfm"), hci.pfm("gt_disp_lowres.pfm")
    np.testing.assert_allclose(depth[0], ABOVE_MM / 1000, rtol=1e-6)
    np.testing.assert_allclose(depth[-1], BELOW_MM / 1000, rtol=1e-6)
    np.testing.assert_allclose(hci.disparity_px(depth), disparity, atol=1e-5)
    np.testing.assert_allclose(hci.depth_m(disparity), depth, rtol=1e-5)
    assert hci.disp_min <= disparity.min() <= disparity.max() <= hci.disp_max
    assert hci.disp_max - hci.disp_min < np.ptp(disparity) + 0.2
    assert hci.offset_px == shear
    if shear:  # where the views converge
        assert hci.focus_m == pytest.approx(9 * 25 / (shear * 0.1) / 1000)
        assert hci.disparity_px(np.array(hci.focus_m)) == pytest.approx(0, abs=1e-12)
    else:
        assert hci.focus_m == 1e9


def test_cameras_have_their_own_maps_and_an_even_grid_has_none_of_its_centre(tmp_path):
    grid = hci_grid(2, 3)
    hci = exported_hci(write_planes(tmp_path / "planes", grid, view_truth=True))
    for k, l in np.ndindex(2, 3):
        depth = hci.pfm(f"gt_depth_lowres_Cam{3 * k + l:03d}.pfm")
        np.testing.assert_allclose(depth, plane_z_mm(grid, k, l) / 1000, rtol=1e-6)
        disparity = hci.pfm(f"gt_disp_lowres_Cam{3 * k + l:03d}.pfm")
        np.testing.assert_allclose(hci.disparity_px(depth), disparity, atol=1e-5)
    assert not (hci.folder / "gt_depth_lowres.pfm").exists()


@pytest.mark.parametrize("shear_px", [(1.0, 2.0), (-1.0, -1.0)])
def test_what_the_layout_cannot_say_is_refused(tmp_path, shear_px):
    data = write_planes(tmp_path / "planes", hci_grid(2, 2, height=8, width=8, shear_px=shear_px))
    assert "shear_px" in one_sentence(lambda: pcii.export_dataset(data, "hci", tmp_path / "hci"), data)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["planes"]


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
    z_mm = np.full(grid.shape_KLHW, 600.0, np.float32)
    z_mm[0, 1, 3, 4] = np.inf  # what hits nothing
    position = np.array([[[-4.5, 0, 0], [4.5, 2, 5]]])
    arrays = {"camera_position_mm": position, "camera_rotation": rotation, "view_z_mm": z_mm}
    write_arrays_safely(data / TRUTH, arrays, TRUTH_LABELS)
    rewrite_manifest(data, files=read_manifest(data).files | list_files(data, [TRUTH]))
    posed = exported(data)
    assert "camera_grid" not in posed.top
    np.testing.assert_allclose(posed.poses[1, :3, 3], [0.0045, -0.002, -0.005])
    np.testing.assert_allclose(posed.poses[1, :3, 2], [-s, 0, c], atol=1e-15)  # backwards: to the left
    for number in range(2):
        has_depth = posed.depth_m(number) > 0
        np.testing.assert_array_equal(has_depth, np.isfinite(z_mm[0, number]))
        np.testing.assert_allclose(posed.points_m(number)[has_depth][:, 2], -0.6, rtol=1e-6)
    hci = pcii.export_dataset(data, "hci", tmp_path / "hci")  # whose maps are of cameras in their places
    assert not list(hci.glob("*.pfm"))


FORMATS = ("hci", "nerfstudio", "photoncube", "events")


def test_events_are_read_by_numpy_alone(tmp_path):
    data = make_dataset(tmp_path / "data", frames=8)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "precious.txt").write_text("mine")
    for folder in (tmp_path / "full", data / "export"):
        one_sentence(lambda folder=folder: pcii.export_dataset(data, "events", folder), folder)
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["precious.txt"]
    out = pcii.export_dataset(data, "events", tmp_path / "new" / "folder")
    assert [path.name for path in out.iterdir()] == ["events.npz"]
    with np.load(out / "events.npz", allow_pickle=False) as stored:
        arrays = dict(stored)
    counts = np.zeros(GRID.shape_KLHW, dtype=int)
    np.add.at(counts, tuple(arrays[name] for name in "klij"), arrays["n"])
    np.testing.assert_array_equal(counts, DENSE)
    grid = {name: arrays[name].tolist() for name in asdict(GRID)}
    assert grid == json.loads(json.dumps(asdict(GRID)))
    scalars = {name: arrays[name].item() for name in ("cfa", "frames", "bits", "photon_budget")}
    assert scalars == {"cfa": "GRBG", "frames": 8, "bits": 1, "photon_budget": 10}
    np.testing.assert_array_equal(arrays["frame"], np.concatenate([np.arange(n) for n in arrays["n"]]))
    assert (arrays["analysis_z_mm"], arrays["analysis_z_range_mm"].tolist()) == ([540], [450, 750])
    np.testing.assert_array_equal(arrays["truth_z_mm"], Z_MM)
    np.testing.assert_array_equal(arrays["truth_object_id"], IDS)
    assert arrays["object_keys"].tolist() == [1]
    assert arrays["object_names"].tolist() == ["ball"]
    assert arrays["photon_z_mm"].tolist() == [540.0] * DENSE.sum()


@pytest.mark.parametrize(
    ("format", "kept"), [("hci", [TRUTH]), ("nerfstudio", [TRUTH]), ("events", [TRUTH, RADIANCE])]
)
def test_a_dataset_that_lacks_what_is_needed_is_refused(tmp_path, format, kept):
    files = pcii.open_dataset(make_dataset(tmp_path / "whole")).manifest["files"]
    part = {name: entry for name, entry in files.items() if name.split("/")[0] in kept}
    data = make_dataset(tmp_path / "data", files=part)
    one_sentence(lambda: pcii.export_dataset(data, format, tmp_path / "out"), data)
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def collection(tmp_path_factory):
    """Two datasets, by their seeds."""
    root = tmp_path_factory.mktemp("collections") / "sweep"
    root.mkdir()
    for seed in (1, 2):
        recipe = {"scene": "two", "seed": seed, "photons": {"scope": "view", "budget": 10.0, "nested": []}}
        make_dataset(root / f"seed_{seed}", frames=8, recipe=recipe, identity=f"no. {seed}")
    return list_datasets(root, {f"seed_{seed}": {"seed": seed} for seed in (1, 2)})


def contents(root):
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.mark.parametrize("format", FORMATS)
def test_datasets_of_a_collection_have_the_same_bytes_as_each_by_itself(collection, tmp_path, format):
    out = pcii.export_dataset(collection, format, tmp_path / "out", budget=10)
    assert sorted(path.name for path in out.iterdir()) == ["seed_1", "seed_2"]
    single = pcii.export_dataset(collection / "seed_2", format, tmp_path / "single" / "seed_2")
    assert contents(out / "seed_2") == contents(single)
    part = pcii.export_dataset(pcii.open_collection(collection)[1:], format, tmp_path / "part")
    assert contents(part) == contents(single.parent)


def test_shards_have_every_dataset_once_with_its_row(collection, tmp_path):
    out = pcii.export_dataset(collection, "webdataset", tmp_path / "out", budget=10)
    rows = pcii.open_collection(collection).rows
    with tarfile.open(out / "all-000000.tar") as shard:
        shard.extractall(tmp_path / "members", filter="data")
    contents = {path.name: path.read_bytes() for path in (tmp_path / "members").iterdir()}
    assert sorted(contents) == [f"{n:06d}.{kind}" for n in range(len(rows)) for kind in ("json", "npz")]
    for n, row in enumerate(rows):
        assert json.loads(contents[f"{n:06d}.json"])["path"] == row["path"]
        single = pcii.export_dataset(collection / row["path"], "events", tmp_path / row["path"], budget=10)
        assert contents[f"{n:06d}.npz"] == (single / "events.npz").read_bytes()
    again = pcii.export_dataset(collection, "webdataset", tmp_path / "again", budget=10)
    assert (again / "all-000000.tar").read_bytes() == (out / "all-000000.tar").read_bytes()
    single = collection / "seed_2"
    one_sentence(lambda: pcii.export_dataset(single, "webdataset", tmp_path / "one"), single)


def test_a_collection_is_exported_as_a_whole_or_not_at_all(collection, tmp_path):
    collection = shutil.copytree(collection, tmp_path / "sweep")
    one_sentence(lambda: pcii.export_dataset(collection, "events", collection / "out"), collection / "out")
    damaged = largest_file(collection / "seed_2", COUNTS)
    flip_a_bit(damaged, 80)
    one_sentence(lambda: pcii.export_dataset(collection, "events", tmp_path / "out"), damaged)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep"]
    write_index(collection, [])
    message = one_sentence(lambda: pcii.export_dataset(collection, "hci", tmp_path / "out"), collection)
    assert "no finished dataset" in message
