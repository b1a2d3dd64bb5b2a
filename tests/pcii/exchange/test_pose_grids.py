"""The grid behind poses: found in any order and place, or refused with the camera and how far off it is."""

import re
from pathlib import Path

import numpy as np
import pytest
from posed_frames import about_y, frames_of, moved, read, turned
from scipy.spatial.transform import Rotation
from stored_datasets import one_sentence

from pcii import InputError
from pcii.exchange import camera_grid_of, find_grid

SOMEWHERE = Rotation.from_euler("xyz", [40, -110, 20], degrees=True).as_matrix()


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (4, 1), (3, 4), (11, 13)])
def test_frames_in_any_order_of_a_rig_anywhere_are_put_in_their_places(tmp_path: Path, shape) -> None:
    rows, cols = shape
    frames = frames_of(rows, cols, (5.0, 3.7), SOMEWHERE, (12.0, -7.0, 3.5))
    mixed = [frames[n] for n in np.random.default_rng(1).permutation(len(frames))]
    file = read(tmp_path, mixed)
    found = find_grid(file)
    names = [[file.frame_name(n) for n in row] for row in found.numbers]
    assert names == [[f"images/{k}_{l}.png" for l in range(cols)] for k in range(rows)]
    # Decimals come back as they were; an axis with one camera has the pitch of the other.
    across, down = (5.0 if cols > 1 else None), (3.7 if rows > 1 else None)
    assert found.pitch_mm == (across or down or 1.0, down or across or 1.0)
    assert found.shear_px == found.offset_px == (0.0, 0.0)


def test_shear_and_a_common_principal_point_are_found(tmp_path: Path) -> None:
    frames = frames_of(3, 4)
    for frame, (k, l) in zip(frames, np.ndindex(3, 4), strict=True):
        frame |= {"cx": 320 + 7.5 + 1.25 * (l - 1.5), "cy": 240 - 3 - 0.5 * (k - 1)}
    found = find_grid(read(tmp_path, frames[::-1], cx=1.0, cy=1.0))  # frames win over the top
    assert found.shear_px == (1.25, -0.5)
    assert found.offset_px == (7.5, -3)


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
    assert find_grid(read(tmp_path, frames)).pitch_mm == pytest.approx((5, 4), rel=1e-4)


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
    file, told = read(tmp_path, frames_of(2, 3), cx=330, cy=238), []
    lengths = {"focal_mm": None, "pixel_mm": None, "sensor_mm": None} | film
    grid = camera_grid_of(file, find_grid(file), **lengths, note=told.append)
    assert (grid.focal_mm, grid.pixel_mm) == (focal_mm, pixel_mm)
    assert (grid.pitch_mm, grid.shape_KLHW) == ((5, 4), (2, 3, 480, 640))
    assert "10 px to the right of their middle and -2 px below" in told[-1]
    assert ("focal length and pixel size are not in transforms.json" in told[0]) == (film == {})
    with pytest.raises(InputError, match="give one of them"):
        camera_grid_of(file, find_grid(file), 50, 0.01, None, told.append)


def test_every_place_has_one_camera(tmp_path: Path) -> None:
    for numbers in ((0, 1, 2, 3, 4), (0, 4), (0, 1, 2, 3, 4, 5, 1)):
        frames = [frames_of(2, 3)[n] | {"file_path": f"{count}.png"} for count, n in enumerate(numbers)]
        file = read(tmp_path, frames)
        words = f"frames: {len(numbers)} cameras do not stand one at each place of a plane grid"
        assert words in one_sentence(lambda file=file: find_grid(file), file.path)
