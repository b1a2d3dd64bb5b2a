"""Lengths of the film, which poses do not tell: stated by the file, by an option, or of no matter."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from posed_frames import frames_of, read
from stored_datasets import one_sentence

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from pcii.transforms.film_sizes import FilmSize, camera_grid_of
from pcii.transforms.grid_of_poses import find_grid

STATED = CameraGrid(
    rows=2, cols=3, pitch_mm=(5, 4), focal_mm=35.2, pixel_mm=0.0352, height=480, width=640, shear_px=(0, 0)
)


def grid_of(folder: Path, film: FilmSize | None = None, **top: Any) -> tuple[CameraGrid, list[str]]:
    file = read(folder, frames_of(2, 3), **top)
    return camera_grid_of(file, find_grid(file), film)


@pytest.mark.parametrize(
    ("film", "focal_mm", "pixel_mm"),
    [
        (FilmSize(focal_mm=50), 50, 0.05),
        (FilmSize(pixel_mm=0.01), 10, 0.01),
        (FilmSize(sensor_mm=36), 56.25, 0.05625),
        (None, 5, 0.005),
    ],
)
def test_one_length_tells_the_others(tmp_path: Path, film, focal_mm, pixel_mm) -> None:
    grid, notes = grid_of(tmp_path, film)
    assert (grid.focal_mm, grid.pixel_mm) == (focal_mm, pixel_mm)
    assert (grid.pitch_mm, grid.shape_KLHW) == ((5, 4), (2, 3, 480, 640))
    said = ["focal length and pixel size are not in transforms.json" in note for note in notes]
    assert said == [True] * (film is None)


def test_a_common_principal_point_is_said(tmp_path: Path) -> None:
    _, notes = grid_of(tmp_path, FilmSize(focal_mm=50), cx=330, cy=238)
    assert len(notes) == 1
    assert "10 px to the right of their middle and -2 px below" in notes[0]


def test_a_stated_grid_is_taken_as_it_is(tmp_path: Path) -> None:
    assert grid_of(tmp_path, camera_grid=asdict(STATED)) == (STATED, [])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"rows": 3, "cols": 2}, "rows is 3, where poses and pixels say 2"),
        ({"pitch_mm": (5, 4.0001)}, "pitch_mm y is 4.0001, where poses and pixels say 4"),
        ({"focal_mm": 35.3}, "focal_mm / pixel_mm is"),
        ({"shear_px": (0.5, 0)}, "shear_px x is"),
        ({"width": 641}, "width is 641"),
        ({"pixel_mm": -1}, "pixel_mm: expected a finite length"),
        ({"aperture": 1}, "expected an object with cols, "),
    ],
)
def test_a_stated_grid_that_disagrees_is_refused(tmp_path: Path, changes, told) -> None:
    file = read(tmp_path, frames_of(2, 3), camera_grid=asdict(STATED) | changes)
    message = one_sentence(lambda: camera_grid_of(file, find_grid(file)), file.path)
    assert message.startswith(f"{file.path}: camera_grid: {told}")


def test_lengths_are_said_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="give one of them"):
        FilmSize(focal_mm=50, pixel_mm=0.01)
    with pytest.raises(InputError, match="sensor_mm: expected a finite length"):
        FilmSize(sensor_mm=-36)
    file = read(tmp_path, frames_of(2, 3), camera_grid=asdict(STATED))
    told = one_sentence(lambda: camera_grid_of(file, find_grid(file), FilmSize(focal_mm=50)), file.path)
    assert "leave out their options" in told
