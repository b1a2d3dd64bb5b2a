"""The HCI layout, read by what the benchmark publishes of it: names, keys, formulas, PFM."""

import configparser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rendered_planes import ABOVE_MM, BELOW_MM, plane_z_mm, srgb, view, write_planes
from stored_datasets import one_sentence

import pcii

INFINITY_M = 1e9


def grid_of(rows: int, cols: int, **changes: object) -> pcii.CameraGrid:
    """Parallax of 4.5 px at 500 mm, 2.8125 px at 800 mm."""
    values = {"pitch_mm": (9.0, 9.0), "focal_mm": 25.0, "pixel_mm": 0.1, "height": 80, "width": 96}
    return pcii.CameraGrid(rows=rows, cols=cols, **values | changes)  # type: ignore[arg-type]


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


def exported(dataset: Path) -> Published:
    return Published(pcii.export_dataset(dataset, "hci", dataset.with_name("hci")))


@pytest.mark.parametrize("cfa", [None, "GRBG"])
@pytest.mark.parametrize("shear", [0.0, 3.5])
def test_images_are_those_of_the_cameras_row_by_row(tmp_path, shear, cfa):
    grid = grid_of(3, 3, shear_px=(shear, shear))
    hci = exported(write_planes(tmp_path / "planes", grid, cfa))
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
    hci = exported(write_planes(tmp_path / "planes", grid_of(3, 5, shear_px=(shear, shear))))
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
        assert hci.focus_m == INFINITY_M


def test_cameras_have_their_own_maps_and_an_even_grid_has_none_of_its_centre(tmp_path):
    grid = grid_of(2, 3)
    hci = exported(write_planes(tmp_path / "planes", grid, view_truth=True))
    for k, l in np.ndindex(2, 3):
        depth = hci.pfm(f"gt_depth_lowres_Cam{3 * k + l:03d}.pfm")
        np.testing.assert_allclose(depth, plane_z_mm(grid, k, l) / 1000, rtol=1e-6)
        disparity = hci.pfm(f"gt_disp_lowres_Cam{3 * k + l:03d}.pfm")
        np.testing.assert_allclose(hci.disparity_px(depth), disparity, atol=1e-5)
    assert not (hci.folder / "gt_depth_lowres.pfm").exists()


@pytest.mark.parametrize("shear_px", [(1.0, 2.0), (-1.0, -1.0)])
def test_what_the_layout_cannot_say_is_refused(tmp_path, shear_px):
    data = write_planes(tmp_path / "planes", grid_of(2, 2, height=8, width=8, shear_px=shear_px))
    assert "shear_px" in one_sentence(lambda: pcii.export_dataset(data, "hci", tmp_path / "hci"), data)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["planes"]
