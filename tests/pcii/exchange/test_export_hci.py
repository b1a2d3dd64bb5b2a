"""The HCI layout, read by what the benchmark publishes of it: names, keys, formulas, PFM."""

import configparser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rendered_planes import ABOVE_MM, BELOW_MM, plane_z_mm, write_planes
from scipy.ndimage import map_coordinates, spline_filter
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


def measured_px(first: np.ndarray, second: np.ndarray, rows: slice, axis: int) -> float:
    """By how many px what the first image shows lies further left (axis 1) or up (0) in the second."""
    image, other = first.mean(axis=2), spline_filter(second.mean(axis=2), mode="nearest")
    inner = np.s_[rows, 16 : image.shape[1] - 16]
    i, j = np.mgrid[inner]
    shifts = np.arange(-7, 7, 0.05)
    errors = []
    for shift in shifts:
        at = (i - shift, j) if axis == 0 else (i, j - shift)
        moved = map_coordinates(other, at, order=3, mode="nearest", prefilter=False)
        errors.append(np.square(moved - image[inner]).mean())
    return float(shifts[np.argmin(errors)])


@pytest.mark.parametrize(
    ("shear_px", "cfa"), [((0.0, 0.0), None), ((3.5, 3.5), "GRBG")], ids=["plain", "sheared"]
)
def test_images_are_displaced_by_the_disparity_of_the_maps(tmp_path, shear_px, cfa):
    hci = exported(write_planes(tmp_path / "planes", grid_of(3, 3, shear_px=shear_px), cfa))
    disparity = hci.pfm("gt_disp_lowres.pfm")
    middle = hci.light_field[1, 1]
    for rows, parallax in ((slice(10, 30), 4.5), (slice(52, 70), 2.8125)):
        expected = float(np.median(disparity[rows]))
        assert expected == pytest.approx(parallax - shear_px[0], abs=1e-5)
        # The search has steps of 0.05 px; 8 bits and cubic interpolation, or demosaicing, add as much.
        assert measured_px(middle, hci.light_field[1, 2], rows, 1) == pytest.approx(expected, abs=0.15)
        assert measured_px(middle, hci.light_field[2, 1], rows, 0) == pytest.approx(expected, abs=0.15)


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
