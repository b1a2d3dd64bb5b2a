"""`simgen preview` and `simgen sheet`: pictures that show something, names that can be read, refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run_simgen
from PIL import Image

from pcii.store import open_dataset, save_dataset
from pcii.types import CameraGrid, PhotonCounts, Truth, Views
from simgen.app.pictures import draw_sheet


def assert_shows_something(path: Path) -> None:
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).astype(float)
    assert min(pixels.shape[:2]) > 300
    assert pixels.std() > 10
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200  # an empty frame has a few dozen
    assert not list(path.parent.glob(".*"))  # nothing half written is left


def grid(**changes: Any) -> CameraGrid:
    whole = CameraGrid(rows=2, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=60, width=40)
    return replace(whole, **changes)


@pytest.mark.renders
def test_a_preview_and_a_sheet_show_something(nested_dataset: Path, tmp_path: Path) -> None:
    look, sheet = tmp_path / "look.jpg", tmp_path / "sheet.png"
    title = r"title=between 5 $ and \6 $"  # no formula
    assert run_simgen("preview", "small", "-o", look, "--samples-per-pixel", 1, "--set", title) == 0
    assert run_simgen("sheet", nested_dataset, "-o", sheet) == 0
    assert_shows_something(look)
    assert_shows_something(sheet)
    counts = PhotonCounts.from_dense(np.ones(grid().shape_KLHW, dtype=int), grid())
    save_dataset(tmp_path / "bare", counts, z_mm=[540], title=r"5 $ and \6 $")  # neither truth nor radiance
    assert run_simgen("sheet", tmp_path / "bare", "-o", tmp_path / "x.png") == 0


@pytest.mark.parametrize("shape", [(1, 12, 32, 32), (2, 3, 12, 200)])
def test_a_sheets_panels_have_room_and_do_not_overlap(
    shape: tuple[int, int, int, int], tmp_path: Path
) -> None:
    films = grid(rows=shape[0], cols=shape[1], height=shape[2], width=shape[3])
    ids = np.zeros(shape[2:], np.int16)
    ids[2:-2, 2:-2] = 1
    truth = Truth(np.where(ids > 0, np.linspace(500.0, 600, shape[3]), np.inf), ids, {1: "a long name of it"})
    counts = PhotonCounts.from_dense(np.random.default_rng(0).poisson(0.3, shape), films, cfa="GRBG")
    light = Views(np.random.default_rng(0).random((*shape, 3)).astype(np.float32), films)
    save_dataset(tmp_path / "d", (counts, light), truth, z_mm=[540], title="Of any shape")
    figure: Any = draw_sheet(open_dataset(tmp_path / "d"))
    figure.canvas.draw()
    assert max(figure.get_size_inches()) < 40
    for axes in figure.axes:
        box = axes.get_window_extent()
        assert max(box.width, box.height) > 1.5 * figure.dpi
    boxes = [axes.get_tightbbox() for axes in figure.axes]  # with titles and scales
    boxes.append(figure.texts[0].get_window_extent())
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[number + 1 :])
    assert f"{shape[0]} x {shape[1]} views of {shape[2]} x {shape[3]} pixels" in figure.texts[0].get_text()
    assert f"{counts.total:,} photons" in figure.texts[0].get_text()


@pytest.mark.parametrize(
    ("name", "words"), [("no/x.png", "there is no folder"), ("x.gif", "name a .png or .jpg")]
)
def test_pictures_are_refused_in_one_sentence(
    name: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in (["preview", "two_objects"], ["sheet", str(tmp_path)]):
        assert run_simgen(*command, "-o", tmp_path / name) == 2
        sentence = capsys.readouterr().err
        assert words in sentence
        assert sentence.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    assert run_simgen("sheet", tmp_path, "-o", tmp_path / "x.png") == 2
    assert "not a finished dataset" in capsys.readouterr().err
