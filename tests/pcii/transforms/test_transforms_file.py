"""What strangers write into transforms.json: read as nerfstudio reads it, or refused in one sentence."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posed_frames import TOP, frames_of, read, written
from stored_datasets import one_sentence

from pcii.base.errors import InputError
from pcii.transforms.film_sizes import camera_grid_of
from pcii.transforms.grid_of_poses import find_grid
from pcii.transforms.transforms_file import read_transforms

MATRIX = frames_of(1, 1)[0]["transform_matrix"]


def scaled(by: float, column: slice = slice(0, 3)) -> list[list[float]]:
    """The matrix with columns of the rotation times a number."""
    rows = [list(row) for row in MATRIX]
    for row in rows[:3]:
        row[column] = [by * value for value in row[column]]
    return rows


def changed(row: int, col: int, value: Any) -> list[list[Any]]:
    rows: list[list[Any]] = [list(row) for row in MATRIX]
    rows[row][col] = value
    return rows


def test_intrinsics_of_frames_win_and_centres_are_the_middle_by_default(tmp_path: Path) -> None:
    frames = frames_of(1, 2)
    frames[0] |= {"cx": 300}
    for frame in frames:
        frame |= {"fl_x": 900, "fl_y": 900}
    file = read(tmp_path, frames, cy=200.5, k1=0.0, p2=0, camera_model="OPENCV", aabb_scale=16)
    assert file.centres_px.tolist() == [[300, 200.5], [320, 200.5]]
    assert file.focal_px == 900


def test_an_angle_of_view_tells_the_focal_length(tmp_path: Path) -> None:
    file = read(tmp_path, frames_of(1, 1), fl_x=None, fl_y=None, camera_angle_x=math.pi / 2)
    assert file.focal_px == pytest.approx(320)
    frames = frames_of(1, 1)
    frames[0]["file_path"] = "./images/a.png"
    assert read(tmp_path, frames).file_paths == ("images/a.png",)


def test_a_photon_cube_says_so(tmp_path: Path) -> None:
    """The file that visionsim writes: one file of pictures, none in the frames."""
    frames = [{"transform_matrix": MATRIX}, {"transform_matrix": MATRIX}]
    file = read(tmp_path, frames, file_path="frames.npy", bitpack=True, bitpack_dim=2, c=1)
    assert (file.is_bitpacked, file.stack_path, file.file_paths) == (True, "frames.npy", (None, None))
    assert file.frame_name(1) == "frames.1"
    assert not read(tmp_path, frames_of(1, 1)).is_bitpacked


@pytest.mark.parametrize(
    ("top", "told"),
    [
        ({"fl_x": None}, "fl_x: missing"),
        ({"w": None}, "w: missing"),
        ({"h": None}, "h: missing"),
        ({"h": 480.5}, "h: expected a whole number"),
        ({"w": -3}, "w: expected a whole number"),
        ({"fl_x": "1000"}, "fl_x: expected a number up to 1e+09, got '1000'"),
        ({"fl_x": 0}, "fl_x: expected a number above 0, got 0"),
        ({"fl_x": 10**400}, "fl_x: expected a number"),
        ({"fl_y": 1010.0}, "fl_y: is 1010 where fl_x is 1000; pixels that are not square"),
        ({"fl_x": None, "fl_y": None, "camera_angle_x": 4}, "camera_angle_x: expected an angle"),
        ({"k1": 0.01}, "k1: the lens distorts"),
        ({"p2": -1e-7}, "p2: the lens distorts"),
        ({"k2": "none"}, "k2: expected a number"),
        ({"distortion_params": [0, 0, 0.1]}, "distortion_params: the lens distorts"),
        ({"camera_model": "OPENCV_FISHEYE"}, "camera_model: expected one of OPENCV"),
        ({"file_path": "../frames.npy"}, "file_path: expected a path inside the folder"),
    ],
)
def test_members_at_the_top_that_are_wrong_are_named(tmp_path: Path, top, told) -> None:
    path = written(tmp_path, frames_of(1, 1), **top)
    assert one_sentence(lambda: read_transforms(path), path).startswith(f"{path}: {told}")


@pytest.mark.parametrize(
    ("frame", "told"),
    [
        ({"transform_matrix": None}, "transform_matrix: expected four rows of four numbers"),
        ({"transform_matrix": MATRIX[:3]}, "transform_matrix: expected four rows of four numbers"),
        ({"transform_matrix": changed(1, 1, True)}, "transform_matrix: expected four rows of four numbers"),
        ({"transform_matrix": changed(3, 3, 2)}, "transform_matrix: the last row of a pose is 0 0 0 1"),
        ({"transform_matrix": changed(0, 3, 1e300)}, "transform_matrix: a place in metres"),
        ({"transform_matrix": changed(0, 0, 1e300)}, "transform_matrix: its columns are not of equal length"),
        ({"transform_matrix": changed(0, 1, 0.3)}, "transform_matrix: its columns are not of equal length"),
        ({"transform_matrix": scaled(0)}, "transform_matrix: its columns are not of equal length"),
        ({"transform_matrix": scaled(2.5)}, "transform_matrix: its rotation is scaled by 2.5"),
        ({"transform_matrix": scaled(-1)}, "transform_matrix: its rotation is a reflection"),
        ({"transform_matrix": scaled(-1, slice(1, 2))}, "transform_matrix: its rotation is a reflection"),
        (
            {"transform_matrix": scaled(-3)},
            "transform_matrix: its rotation is scaled by 3, and a pose has the",
        ),
        ({"file_path": None}, "file_path: expected the path of a file, got nothing"),
        ({"file_path": "/etc/passwd"}, "file_path: expected a path inside the folder"),
        ({"file_path": "images/../../x.png"}, "file_path: expected a path inside the folder"),
        ({"file_path": "C:\\x.png"}, "file_path: expected a path inside the folder"),
        ({"file_path": "a\0b\n.png"}, "file_path: expected a path inside the folder"),
        ({"file_path": "out/secret.png"}, "file_path: 'out/secret.png' leads out of the folder"),
        ({"file_path": "."}, "file_path: '.' leads out of the folder"),
        ({"file_path": "./images/0_0.png"}, "file_path: 'images/0_0.png' is that of frames.0 too"),
        ({"depth_file_path": "../d.npy"}, "depth_file_path: expected a path inside the folder"),
        ({"w": 320}, "w: 480 x 320 px, where the first frame has 480 x 640"),
        ({"fl_x": 1100, "fl_y": 1100}, "fl_x: 1100 px, where the first frame has 1000"),
        ({"cx": [1]}, "cx: expected a number up to 1e+09, got a list"),
    ],
)
def test_members_of_a_frame_that_are_wrong_are_named(tmp_path: Path, frame, told) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    frames = frames_of(1, 2)
    frames[1] |= frame
    path = written(folder, frames)
    assert one_sentence(lambda: read_transforms(path), path).startswith(f"{path}: frames.1.{told}")


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"{}", b'{"frames": []}', b'{"frames": [3]}', b'{"fl_x": NaN}', b"[" * 10**5, b"\xff{}"],
)
def test_what_is_no_such_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "transforms.json"
    path.write_bytes(content)
    one_sentence(lambda: read_transforms(path), path)


ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(allow_nan=False),
    st.text(max_size=5),
    st.lists(st.integers(), max_size=3),
    st.just({}),
)
GRID = {
    "rows": 2,
    "cols": 2,
    "pitch_mm": [5, 4],
    "focal_mm": 50,
    "pixel_mm": 0.05,
    "height": 480,
    "width": 640,
    "shear_px": [0, 0],
}


@given(st.data())
def test_one_member_of_any_kind_gives_a_grid_or_one_sentence(tmp_path_factory, data) -> None:
    document: Any = json.loads(json.dumps(TOP | {"camera_grid": GRID, "frames": frames_of(2, 2)}))
    frame = data.draw(st.sampled_from(document["frames"]))
    place = data.draw(
        st.sampled_from(
            [document, document["camera_grid"], frame, *frame["transform_matrix"], frame["transform_matrix"]]
        )
    )
    names = list(range(len(place))) if isinstance(place, list) else [*place, "cx", "k1", "bitpack"]
    place[data.draw(st.sampled_from(names))] = data.draw(ODD)
    path = tmp_path_factory.mktemp("odd") / "transforms.json"
    path.write_text(json.dumps(document))
    try:
        file = read_transforms(path)
        found = camera_grid_of(file, find_grid(file))[0].view_count
    except InputError as fault:
        found = str(fault)
    assert found == 4 or (str(found).startswith(f"{path}: ") and "\n" not in str(found))
