"""What strangers write into transforms.json: read as nerfstudio reads it, or refused in one sentence."""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from picture_folders import H, W, numbers, write
from posed_frames import frames_of, read, written
from stored_datasets import one_sentence

from pcii.exchange import find_grid, read_transforms

MATRIX = frames_of(1, 1)[0]["transform_matrix"]


def changed(row: int, col: int, value: Any) -> list[list[Any]]:
    rows: list[list[Any]] = [list(row) for row in MATRIX]
    rows[row][col] = value
    return rows


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
        frame |= {"camera_angle_x": 2 * math.atan(W / 2 / 50), "cx": "4.0", "k1": None}  # wins over fl_x
        del frame["transform_matrix"][3]
    path = written(tmp_path, frames, w=None, h=None, applied_scale=0.5, aabb_scale=16)
    path.write_text(path.read_text(), "utf-16")
    told: list[str] = []
    file = read_transforms(path, note=told.append)
    assert told == ["not used of transforms.json: aabb_scale, sharpness"]
    assert (file.height, file.width, file.focal_px) == (H, W, pytest.approx(50))
    assert [file.frame_name(n) for n in range(2)] == ["images/0_0.png", "images/0_1.png"]
    assert find_grid(file, focal_mm=50)[0].pitch_mm == (10, 10)


@pytest.mark.parametrize(
    ("top", "frame", "told"),
    [
        ({"fl_x": None, "fl_y": None}, {}, "fl_x: missing"),
        ({"fl_y": 1010.0}, {}, "fl_y: is 1010 where fl_x is 1000; pixels that are not square"),
        ({"p2": -1e-7}, {}, r"frames\.0: the lens distorts"),
        ({"camera_model": "OPENCV_FISHEYE"}, {}, "camera_model: expected one of OPENCV"),
        ({}, {"transform_matrix": changed(0, 1, 0.3)}, r"frames\.1\.transform_matrix: is no rotation"),
        ({}, {"file_path": "images/../../x.png"}, r"frames\.1\.file_path: expected a path inside"),
        ({}, {"file_path": "out/secret.png"}, r"frames\.1\.file_path: expected a path inside"),
        ({}, {"fl_x": 1100, "fl_y": 1100}, r"frames\.1: 480 x 640 px and a focal length of 1100 px"),
    ],
)
def test_members_that_are_wrong_are_named(tmp_path: Path, top, frame, told) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    frames = frames_of(1, 2)
    frames[1] |= frame
    path = written(folder, frames, **top)
    message = one_sentence(lambda: read_transforms(path), path)
    assert re.match(rf"{path}: {told}", message), message
