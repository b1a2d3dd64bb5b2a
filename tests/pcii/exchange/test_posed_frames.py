"""Pictures with a transforms.json: read as nerfstudio does, put into a grid, or refused in a sentence."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run_pcii as run
from picture_folders import H, W, numbers, write
from scipy.spatial.transform import Rotation
from stored_datasets import one_sentence

from pcii import (
    CameraGrid,
    Dataset,
    InputError,
    Views,
    export_dataset,
    open_dataset,
    save_dataset,
    srgb_to_linear,
)
from pcii.exchange import TransformsFile, find_grid, read_transforms
from pcii.store import verify

TOP = {"fl_x": 1000.0, "fl_y": 1000.0, "w": 640, "h": 480}
Frame = dict[str, Any]


def frames_of(
    rows: int,
    cols: int,
    pitch_mm: tuple[float, float] = (5.0, 4.0),
    turn: np.ndarray | None = None,
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Frame]:
    """Frames row by row from the top left: right is the first column of `turn`, down against its second."""
    turn = np.eye(3) if turn is None else turn
    frames = []
    for k, l in np.ndindex(rows, cols):
        pose = np.eye(4)
        pose[:3, :3] = turn
        pose[:3, 3] = turn @ np.array([l * pitch_mm[0], -k * pitch_mm[1], 0]) / 1000 + place_m
        frames.append({"file_path": f"images/{k}_{l}.png", "transform_matrix": pose.tolist()})
    return frames


def moved(frame: Frame, x_mm: float, y_mm: float, z_mm: float) -> None:
    """Move the camera of a frame in the world of the file."""
    for row, off in zip(frame["transform_matrix"], (x_mm, y_mm, z_mm), strict=False):
        row[3] += off / 1000


def turned(frame: Frame, turn: np.ndarray) -> None:
    """Turn the camera of a frame about its own place."""
    pose = np.array(frame["transform_matrix"])
    pose[:3, :3] = turn @ pose[:3, :3]
    frame["transform_matrix"] = pose.tolist()


def about_y(degrees: float) -> np.ndarray:
    """Rotation about the second axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def written(folder: Path, frames: list[Frame], **top: Any) -> Path:
    """The file; members of `top` that are None are left out."""
    members = {name: value for name, value in (TOP | top).items() if value is not None}
    path = folder / "transforms.json"
    path.write_text(json.dumps(members | {"frames": frames}))
    return path


def read(folder: Path, frames: list[Frame], **top: Any) -> TransformsFile:
    """What is read of such a file."""
    return read_transforms(written(folder, frames, **top))


SLANTED = (np.eye(4) + 0.3 * np.eye(4, k=1)).tolist()


def test_intrinsics_of_frames_win_and_centres_are_the_middle_by_default(tmp_path: Path) -> None:
    frames = frames_of(1, 2)
    frames[0] |= {"cx": 300}
    for frame in frames:
        frame |= {"fl_x": 900, "fl_y": 900}
    file = read(tmp_path, frames, cy=200.5, k1=0.0, p2=0, camera_model="OPENCV", is_fisheye=False)
    assert file.centres_px.tolist() == [[300, 200.5], [320, 200.5]]
    assert file.focal_px == 900


@pytest.mark.parametrize(
    ("name", "value", "focal_px"),
    [("camera_angle_x", math.pi / 2, 320), ("camera_angle_y", math.pi / 2, 240), ("fl_y", 300, 300)],
)
def test_any_statement_of_the_focal_length_will_do(tmp_path: Path, name, value, focal_px) -> None:
    file = read(tmp_path, frames_of(1, 1), **{"fl_x": None, "fl_y": None, name: value})
    assert file.focal_px == pytest.approx(focal_px)


def test_files_as_other_programs_write_them(tmp_path: Path) -> None:
    """UTF-16, no size, no endings, backslashes, scaled places, nulls, strings, three rows, other members."""
    frames = frames_of(1, 2)
    (tmp_path / "images").mkdir()
    for frame in frames:
        write(tmp_path / frame["file_path"], numbers(0, 0))
        frame |= {"file_path": frame["file_path"].replace("/", "\\").removesuffix(".png"), "sharpness": 30}
        frame |= {"camera_angle_x": 2 * math.atan(W / 2 / 50)}  # wins over fl_x
        frame |= {"cx": "4.0", "k1": None, "k2": "0.0"}
        del frame["transform_matrix"][3]
    path = written(tmp_path, frames, w=None, h=None, applied_scale=0.5, aabb_scale=16)
    path.write_text(path.read_text(), "utf-16")
    notes: list[str] = []
    file = read_transforms(path, note=notes.append)
    assert notes == ["not used of transforms.json: aabb_scale, sharpness"]
    assert (file.height, file.width, file.focal_px) == (H, W, pytest.approx(50))
    assert [file.frame_name(n) for n in range(2)] == ["images/0_0.png", "images/0_1.png"]
    assert find_grid(file, focal_mm=50)[0].pitch_mm == (10, 10)


@pytest.mark.parametrize(
    ("top", "frame", "words"),
    [
        ({"fl_x": None, "fl_y": None}, {}, "fl_x: missing"),
        ({"fl_y": 1010.0}, {}, "fl_y: is 1010 where fl_x is 1000; pixels that are not square"),
        ({"p2": -1e-7}, {}, r"frames\.0: the lens distorts"),
        ({"distortion_params": [0, [0]]}, {}, r"distortion_params\.1: "),
        ({"camera_model": "OPENCV_FISHEYE"}, {}, "camera_model: expected one of OPENCV"),
        ({}, {"transform_matrix": SLANTED}, r"frames\.1\.transform_matrix: is no rotation"),
        ({}, {"file_path": "images/../../x.png"}, r"frames\.1\.file_path: expected a path inside"),
        ({}, {"file_path": "out/secret.png"}, r"frames\.1\.file_path: expected a path inside"),
        ({}, {"fl_x": 1100, "fl_y": 1100}, r"frames\.1: 480 x 640 px and a focal length of 1100 px"),
    ],
)
def test_members_that_are_wrong_are_named(tmp_path: Path, top, frame, words) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    frames = frames_of(1, 2)
    frames[1] |= frame
    path = written(folder, frames, **top)
    message = one_sentence(lambda: read_transforms(path), path)
    assert re.match(rf"{path}: {words}", message), message


def test_sizes_of_some_frames_alone_and_no_file_are_refused(tmp_path: Path) -> None:
    frames = frames_of(1, 2)
    frames[0] |= {"w": 640, "h": 480}
    path = written(tmp_path, frames, w=None, h=None)
    assert "frames.1: w, h: missing" in one_sentence(lambda: read_transforms(path), path)
    path.unlink()
    assert "there is no such file" in one_sentence(lambda: read_transforms(path), path)


SOMEWHERE = Rotation.from_euler("xyz", [40, -110, 20], degrees=True).as_matrix()


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (4, 1), (3, 4), (11, 13)])
def test_frames_in_any_order_of_a_rig_anywhere_are_put_in_their_places(tmp_path: Path, shape) -> None:
    rows, cols = shape
    frames = frames_of(rows, cols, (5.0, 3.7), SOMEWHERE, (12.0, -7.0, 3.5))
    mixed = [frames[n] for n in np.random.default_rng(1).permutation(len(frames))]
    notes: list[str] = []
    grid, files = find_grid(read(tmp_path, mixed), focal_mm=50, note=notes.append)
    names = [[path.name for path in row] for row in files]
    assert names == [[f"{k}_{l}.png" for l in range(cols)] for k in range(rows)]
    # Decimals come back as they were; an axis with one camera has the pitch of the other.
    across, down = (5.0 if cols > 1 else None), (3.7 if rows > 1 else None)
    assert grid.pitch_mm == (across or down or 1.0, down or across or 1.0)
    assert (grid.shear_px, notes) == ((0.0, 0.0), [])


def test_shear_and_a_common_principal_point_are_found(tmp_path: Path) -> None:
    frames = frames_of(3, 4)
    for frame, (k, l) in zip(frames, np.ndindex(3, 4), strict=True):
        frame |= {"cx": 320 + 7.5 + 1.25 * (l - 1.5), "cy": 240 - 3 - 0.5 * (k - 1)}
    notes: list[str] = []
    file = read(tmp_path, frames[::-1], cx=1.0, cy=1.0)  # frames win over the top
    grid, _ = find_grid(file, focal_mm=50, note=notes.append)
    assert grid.shear_px == (1.25, -0.5)
    assert "7.5 px to the right of their middle and -3 px below" in notes[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda frame: moved(frame, 2, 0, 0), "has the fewest in line with it"),
        (lambda frame: moved(frame, 0.004, 0, 0), r"is 0\.003\d* mm from its place.* and 0\.1 is allowed"),
        (lambda frame: moved(frame, 0, 0, -3), r"is 2\.7\d* mm from its place in a plane grid"),
        (lambda frame: turned(frame, about_y(2.4)), r"is 2\.2 degrees turned"),
        (lambda frame: frame.update(cx=321.2), r"is 1\.\d+ px from where cx and cy"),
    ],
)
def test_a_camera_out_of_its_place_is_named(tmp_path: Path, change, words) -> None:
    """A fit of 12 cameras follows one that is off by a tenth of that."""
    frames = frames_of(3, 4)
    change(frames[5])
    file = read(tmp_path, frames)
    assert re.search(f"images/1_1.png {words}", one_sentence(lambda: find_grid(file), file.path))


def test_what_moves_nothing_visibly_is_accepted(tmp_path: Path) -> None:
    """The nearest point moves by 640 / 4 px from camera to camera: 0.1 px are 1 / 1600 of 4 mm of pitch."""
    frames = frames_of(3, 4)
    moved(frames[5], 0.9 * 0.1 / 160 * 4, 0, 0)
    turned(frames[5], about_y(0.004))  # a point in a corner moves by less than 0.1 px
    grid, _ = find_grid(read(tmp_path, frames), focal_mm=50)
    assert grid.pitch_mm == pytest.approx((5, 4), rel=1e-4)


@pytest.mark.parametrize(
    ("film", "focal_mm", "pixel_mm"),
    [
        ({"focal_mm": 50}, 50, 0.05),
        ({"pixel_mm": 0.01}, 10, 0.01),
        ({"sensor_mm": 36}, 56.25, 0.05625),
        ({}, 5, 0.005),
    ],
)
def test_one_length_tells_the_others(tmp_path: Path, film, focal_mm, pixel_mm) -> None:
    file, notes = read(tmp_path, frames_of(2, 3), cx=330, cy=238), []
    grid, _ = find_grid(file, **film, note=notes.append)
    assert (grid.focal_mm, grid.pixel_mm) == (focal_mm, pixel_mm)
    assert (grid.pitch_mm, grid.shape_KLHW) == ((5, 4), (2, 3, 480, 640))
    assert "10 px to the right of their middle and -2 px below" in notes[-1]
    assert ("focal length and pixel size are not in transforms.json" in notes[0]) == (film == {})
    with pytest.raises(InputError, match="give one of them"):
        find_grid(file, 50, 0.01)


def test_every_place_has_one_camera(tmp_path: Path) -> None:
    for places in ((0, 1, 2, 3, 4), (0, 4), (0, 1, 2, 3, 4, 5, 1)):
        frames = [frames_of(2, 3)[n] | {"file_path": f"{count}.png"} for count, n in enumerate(places)]
        file = read(tmp_path, frames)
        words = f"frames: {len(places)} cameras do not stand one at each place of a plane grid"
        assert words in one_sentence(lambda file=file: find_grid(file), file.path)


def posed(
    root: Path, rows: int = 2, cols: int = 3, *, ending: str = "png", dtype: Any = np.uint8, **top: Any
) -> Path:
    """A folder of pictures whose frames are listed backwards."""
    (root / "images").mkdir(parents=True)
    frames = frames_of(rows, cols, (2.0, 3.0), place_m=(1.0, 2.0, 3.0))
    for frame, (k, l) in zip(frames, np.ndindex(rows, cols), strict=True):
        frame["file_path"] = f"./images/{k}_{l}.{ending}"
        write(root / frame["file_path"], numbers(k, l, dtype))
    members = {"fl_x": 40.0, "w": W, "h": H} | top | {"frames": frames[::-1]}
    (root / "transforms.json").write_text(json.dumps(members))
    return root


def imported(source: Path, *options: object) -> Dataset:
    out = source.with_name("mine")
    assert run("import", source, "-o", out, *options) == 0
    assert verify(out) > 0
    return open_dataset(out)


@pytest.mark.parametrize(("ending", "dtype"), [("png", np.uint16), ("exr", np.float32)])
def test_pictures_of_any_kind_come_in_by_their_poses(tmp_path: Path, ending, dtype) -> None:
    dataset: Any = imported(posed(tmp_path / "data", ending=ending, dtype=dtype))
    assert dataset.grid.pitch_mm == (2, 3)
    assert (dataset.grid.focal_mm, dataset.grid.pixel_mm) == (0.2, 0.005)
    for k, l in np.ndindex(2, 3):
        image = numbers(k, l, dtype)
        light = image if dtype == np.float32 else srgb_to_linear(image)
        np.testing.assert_allclose(dataset.views.view(k, l), light, rtol=1e-5)


def test_a_file_of_another_name_and_options_of_light_and_film(tmp_path: Path, capsys) -> None:
    source = posed(tmp_path / "data")
    path = (source / "transforms.json").rename(source / "train.json")
    dataset: Any = imported(path, "--linear", "--cfa", "GRBG", "--photons", 50, "--focal-mm", 35)
    printed = capsys.readouterr().out
    assert "pictures with a transforms.json of train.json" in printed
    assert "are not in train.json" not in printed
    assert (dataset.grid.focal_mm, dataset.grid.pixel_mm) == (35, 35 / 40)
    assert (dataset.cfa, dataset.light.photons) == ("GRBG", 50)
    first, second = numbers(1, 2)[0, :2] / 255  # a row of GRBG begins with green and red
    np.testing.assert_allclose(dataset.views.view(1, 2)[0, :2, 0], [first[1], second[0]], rtol=1e-5)


def test_cameras_that_the_source_states_are_not_to_be_corrected(tmp_path: Path, capsys) -> None:
    grid = CameraGrid(rows=3, cols=3, pitch_mm=(2, 2), focal_mm=35, pixel_mm=0.7, height=40, width=50)
    noise = Views(np.random.default_rng(1).random((*grid.shape_KLHW, 1)), grid)
    data = save_dataset(tmp_path / "data", noise)
    source = export_dataset(data, "nerfstudio", tmp_path / "posed")
    imported(source, "--focal-mm", 35)
    assert re.search("from .* mm to infinity; name depths to `pcii run` by --z-mm", capsys.readouterr().out)


def test_cubes_that_are_not_packed_come_in_by_their_poses(tmp_path: Path) -> None:
    source = posed(tmp_path / "data", 1, 2)
    path = source / "transforms.json"
    path.write_text(path.read_text().replace(".png", ".npy"))
    bits = np.random.default_rng(1).random((2, 5, H, W)) < 0.2
    for l in range(2):
        np.save(source / "images" / f"0_{l}.npy", bits[l])
    dataset = imported(source)
    assert (dataset.grid.pitch_mm, dataset.counts.readout.frames) == ((2, 2), 5)
    np.testing.assert_array_equal(dataset.counts.dense[0], bits.sum(axis=1))
