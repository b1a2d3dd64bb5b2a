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
from pcii.store import verify


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
    assert (dataset.cfa, dataset.light.photons) == ("GRBG", 50)
    assert dataset.views is not None
    first, second = numbers(1, 2)[0, :2] / 255  # a row of GRBG begins with green and red
    np.testing.assert_allclose(dataset.views.view(1, 2)[0, :2, 0], [first[1], second[0]], rtol=1e-5)


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
