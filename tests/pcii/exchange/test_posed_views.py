"""Strangers' pictures with a transforms.json, by the command: what comes in, and what is told instead."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run
from picture_folders import H, W, numbers, write
from posed_frames import frames_of

from pcii import Dataset, open_dataset, srgb_to_linear
from pcii.store.verification import verify


def posed(
    root: Path,
    rows: int = 2,
    cols: int = 3,
    *,
    ending: str = "png",
    dtype: Any = np.uint8,
    channels: int = 3,
    depth: np.ndarray | None = None,
    **top: Any,
) -> Path:
    """A folder of pictures whose frames are listed backwards; `depth` (H, W) is written for each as .npy."""
    (root / "images").mkdir(parents=True)
    frames = frames_of(rows, cols, (2.0, 3.0), place_m=(1.0, 2.0, 3.0))
    for frame, (k, l) in zip(frames, np.ndindex(rows, cols), strict=True):
        frame["file_path"] = f"./images/{k}_{l}.{ending}"
        write(root / frame["file_path"], numbers(k, l, dtype, channels))
        if depth is not None:
            frame["depth_file_path"] = f"{k}_{l}.npy"
            np.save(root / frame["depth_file_path"], depth + 3 * k + l)
    members = {"fl_x": 40.0, "w": W, "h": H} | top | {"frames": frames[::-1]}
    (root / "transforms.json").write_text(json.dumps(members))
    return root


def imported(source: Path, *options: object) -> Dataset:
    out = source.with_name("mine")
    assert run("import", source, "-o", out, *options) == 0
    assert verify(out) > 0
    return open_dataset(out)


def refused(capsys: pytest.CaptureFixture[str], source: Path, *options: object) -> str:
    """The one line that is said."""
    capsys.readouterr()
    assert run("import", source, "-o", source.with_name("mine"), *options) == 2
    (line,) = (line for line in capsys.readouterr().err.splitlines() if not line.startswith("pictures: "))
    return line


@pytest.mark.parametrize(
    ("ending", "dtype"),
    [("png", np.uint8), ("png", np.uint16), ("tif", np.uint8), ("exr", np.float32)],
)
def test_pictures_of_any_kind_come_in_by_their_poses(tmp_path: Path, ending, dtype) -> None:
    dataset = imported(posed(tmp_path / "data", ending=ending, dtype=dtype))
    assert dataset.grid.pitch_mm == (2, 3)
    assert (dataset.grid.focal_mm, dataset.grid.pixel_mm) == (0.2, 0.005)
    assert dataset.views is not None
    for k, l in np.ndindex(2, 3):
        image = numbers(k, l, dtype)
        light = image if dtype == np.float32 else srgb_to_linear(image)
        np.testing.assert_allclose(dataset.views.view(k, l), light, rtol=1e-5)


def test_a_file_of_another_name_and_options_of_light_and_film(tmp_path: Path, capsys) -> None:
    source = posed(tmp_path / "data")
    path = (source / "transforms.json").rename(source / "train.json")
    dataset = imported(path, "--linear", "--cfa", "GRBG", "--photons", 50, "--focal-mm", 35)
    said = capsys.readouterr().out
    assert "pictures with a transforms.json of train.json" in said
    assert "are not in train.json" not in said
    assert (dataset.grid.focal_mm, dataset.grid.pixel_mm) == (35, 35 / 40)
    assert (dataset.cfa, dataset.budgets) == ("GRBG", (50,))
    assert dataset.views is not None
    first, second = numbers(1, 2)[0, :2] / 255  # a row of GRBG begins with green and red
    np.testing.assert_allclose(dataset.views.view(1, 2)[0, :2, 0], [first[1], second[0]], rtol=1e-5)


def test_depths_of_the_views_and_of_the_middle_one_come_in(tmp_path: Path, capsys) -> None:
    depth = np.full((H, W), 500.25)
    depth[0, 0] = 400
    dataset = imported(posed(tmp_path / "odd", 3, 3, depth=depth))
    views_mm = dataset.truth_array("view_z_mm")
    assert views_mm.dtype == np.float32
    np.testing.assert_array_equal(views_mm[2, 1], np.float32(depth + 7))
    assert dataset.truth is not None
    np.testing.assert_array_equal(dataset.truth.z_mm, views_mm[1, 1])
    assert "true depth of every view, in units of 1 mm" in capsys.readouterr().out


def test_depths_of_an_even_grid_are_of_no_virtual_centre(tmp_path: Path) -> None:
    depth_m = np.where(np.arange(H * W).reshape(H, W) == 5, 0.0, 0.5)
    source = posed(tmp_path / "even", 1, 2, depth=depth_m, depth_unit_scale_factor=1.0)
    np.save(source / "0_1.npy", depth_m)
    dataset = imported(source)
    assert dataset.truth is None
    views_mm = dataset.truth_array("view_z_mm")
    np.testing.assert_array_equal(views_mm[0, 1], np.where(depth_m == 0, np.inf, 500))


def test_depths_as_pictures_of_16_bits(tmp_path: Path) -> None:
    source = posed(tmp_path / "data", 1, 1)
    members = json.loads((source / "transforms.json").read_text())
    members["frames"][0]["depth_file_path"] = "depth.png"
    (source / "transforms.json").write_text(json.dumps(members))
    write(source / "depth.png", np.arange(H * W, dtype=np.uint16).reshape(H, W, 1) * 1000)
    views_mm = imported(source).truth_array("view_z_mm")[0, 0].ravel()
    assert np.isposinf(views_mm[0])
    np.testing.assert_array_equal(views_mm[1:], np.arange(1, H * W) * 1000)


def test_depths_without_an_agreed_unit_are_left_out(tmp_path: Path, capsys) -> None:
    source = posed(tmp_path / "data", 1, 2, depth=np.ones((H, W)))
    members = json.loads((source / "transforms.json").read_text())
    write(source / "depth.exr", np.ones((H, W, 1), np.float32))
    members["frames"][1]["depth_file_path"] = "depth.exr"
    (source / "transforms.json").write_text(json.dumps(members))
    dataset = imported(source)
    assert not dataset.has_truth_array("view_z_mm")
    assert (
        "not used: depth_file_path; expected a .npy, .png or .tif file of every frame"
        in capsys.readouterr().out
    )


def test_pictures_that_do_not_fit(tmp_path: Path, capsys) -> None:
    source = posed(tmp_path / "a", w=W + 1)
    assert f"is {H} x {W} px, where transforms.json says {H} x {W + 1}" in refused(capsys, source)
    source = posed(tmp_path / "b")
    (source / "images" / "0_1.png").unlink()
    assert f"{source}/images/0_1.png: there is no such file" in refused(capsys, source)
    source = posed(tmp_path / "c", channels=4)
    assert "has an alpha channel that is not opaque everywhere" in refused(capsys, source)
    source = posed(tmp_path / "d", 1, 1, depth=np.ones((H, W + 1)))
    assert f"expected {H} x {W} numbers" in refused(capsys, source)
    source = posed(tmp_path / "e", 1, 1, depth=np.full((H, W), np.nan))
    assert "holds NaN or depths below 0" in refused(capsys, source)
    source = posed(tmp_path / "f", file_path="frames.npy")
    assert "file_path: expected one in each frame" in refused(capsys, source)
