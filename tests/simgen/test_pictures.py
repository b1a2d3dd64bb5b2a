"""`simgen preview` and `simgen sheet`: pictures that show something, names that can be read, refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tiny import TINY_RECIPE

from pcii.base import command_line
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import Truth
from pcii.io.dataset import open_dataset
from pcii.io.dataset_writer import save_dataset
from simgen.app import commands as cli
from simgen.dataset.generation import generate
from simgen.figures.contact_sheet import write_sheet
from simgen.figures.picture_parts import draw_depth, draw_objects, new_figure, part_of_interest, spread_out
from simgen.figures.thumbnails import count_tiles, evenly_chosen, joined, radiance_tiles
from simgen.spec.recipe import Recipe


def picture(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(float)


def assert_shows_something(path: Path) -> None:
    pixels = picture(path)
    assert min(pixels.shape[:2]) > 300
    assert pixels.std() > 10
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200  # an empty frame has a few dozen
    assert not list(path.parent.glob(".*"))  # nothing half written is left


def grid(**changes: Any) -> CameraGrid:
    whole = CameraGrid(rows=2, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=60, width=40)
    return replace(whole, **changes)


@pytest.mark.renders
def test_a_preview_of_a_recipe(tmp_path: Path) -> None:
    out = tmp_path / "recipe.jpg"
    title = ["--set", r"title=between 5 $ and \6 $"]  # no formula
    command = ["preview", "small", "-o", str(out), "--samples-per-pixel", "2"]
    assert command_line.run(cli.app, [*command, *title]) == 0
    assert_shows_something(out)


@pytest.mark.renders
def test_a_sheet_of_a_dataset(small_dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "sheet.png"
    assert command_line.run(cli.app, ["sheet", str(small_dataset), "-o", str(out)]) == 0
    assert_shows_something(out)


@pytest.mark.parametrize(
    "shape",
    [(6, 6, 64, 64), (6, 8, 48, 80), (1, 12, 32, 32), (12, 1, 32, 32), (2, 2, 160, 20), (2, 3, 12, 200)],
)
def test_a_sheets_panels_have_room_and_do_not_overlap(
    shape: tuple[int, int, int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    films = grid(rows=shape[0], cols=shape[1], height=shape[2], width=shape[3])
    ids = np.zeros(shape[2:], np.int16)
    ids[2:-2, 2:-2] = 1
    truth = Truth(np.where(ids > 0, np.linspace(500.0, 600, shape[3]), np.inf), ids, {1: "a long name of it"})
    counts = PhotonCounts.from_dense(np.random.default_rng(0).poisson(0.3, shape), films, cfa="GRBG")
    light = Views(np.random.default_rng(0).random((*shape, 3)).astype(np.float32), films)
    save_dataset(tmp_path / "d", (counts, light), truth, z_mm=[540], title="Of any shape")
    drawn: list[Any] = []
    monkeypatch.setattr("simgen.figures.contact_sheet.save_figure", lambda figure, _: drawn.append(figure))
    write_sheet(tmp_path / "d", tmp_path / "sheet.png")
    (figure,) = drawn
    figure.canvas.draw()
    assert max(figure.get_size_inches()) < 35
    for axes in figure.axes:
        box = axes.get_window_extent()
        assert max(box.width, box.height) > 1.5 * figure.dpi
    boxes = [axes.get_tightbbox() for axes in figure.axes]  # with titles and scales
    boxes.append(figure.texts[0].get_window_extent())
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[number + 1 :])


@pytest.mark.renders
def test_a_sheet_of_a_dataset_without_products(tmp_path: Path) -> None:
    recipe = TINY_RECIPE | {"products": {"counts": False, "truth": False}, "title": r"5 $ and \6 $"}
    generate(Recipe.model_validate(recipe), Path(), tmp_path / "bare")
    out = tmp_path / "bare.png"
    assert command_line.run(cli.app, ["sheet", str(tmp_path / "bare"), "-o", str(out)]) == 0
    assert min(picture(out).shape[:2]) > 300


@pytest.mark.renders
def test_pictures_are_refused_in_one_sentence(
    nested_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder.png").mkdir()
    cases = {
        "no/x.png": "there is no folder",
        "x.gif": "name a .png or .jpg",
        "folder.png": "this is a folder",
    }
    for command in (["preview", "two_objects"], ["sheet", str(nested_dataset)]):
        for name, words in cases.items():
            assert command_line.run(cli.app, [*command, "-o", str(tmp_path / name)]) == 2
            said = capsys.readouterr().err
            assert words in said
            assert said.count("\n") == 1
    assert not (tmp_path / "no").exists()
    assert command_line.run(cli.app, ["sheet", str(tmp_path), "-o", str(tmp_path / "x.png")]) == 2
    assert "not a finished dataset" in capsys.readouterr().err


@pytest.mark.renders
def test_a_folder_that_may_not_be_written_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("simgen.figures.picture_parts.write_bytes_safely", refuse)
    out = str(tmp_path / "x.png")
    assert command_line.run(cli.app, ["preview", "two_objects", "-o", out, "--samples-per-pixel", "1"]) == 2
    assert "cannot be written here (Permission denied)" in capsys.readouterr().err


def test_names_of_two_dozen_objects_do_not_overlap() -> None:
    names = {number: f"specimen_{number}" for number in range(1, 25)}
    object_id = np.zeros((240, 240), dtype=np.int16)
    rng = np.random.default_rng(2)
    for number in names:  # half of them in one corner
        i, j = rng.integers(0, 60 if number % 2 else 230, 2)
        object_id[i : i + 9, j : j + 9] = number
    figure = new_figure(9, 5)
    axes = figure.subplots()
    draw_objects(axes, object_id, names)
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) == len(np.unique(object_id)) - 1
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[number + 1 :])


def test_the_depth_of_a_flat_card_shows_no_rounding_errors() -> None:
    figure = new_figure(5, 5)
    flat, deep = figure.subplots(1, 2)
    draw_depth(flat, np.array([[540.0, 540.0001]]), np.array([[True, True]]))
    assert flat.images[0].get_clim() == pytest.approx((539.5, 540.5), abs=1e-3)
    draw_depth(deep, np.array([[540.0, 620.0, 3000.0]]), np.array([[True, True, False]]))
    assert deep.images[0].get_clim() == (540, 620)


def test_places_are_moved_apart_and_no_further_than_needed() -> None:
    np.testing.assert_allclose(spread_out(np.array([20.0, 50.0, 90.0]), 100), [20, 50, 90])
    np.testing.assert_allclose(spread_out(np.array([50.0, 50.0]), 100), [47.5, 52.5])  # 5 apart
    crowded = spread_out(np.full(30, 99.0), 100)
    np.testing.assert_allclose(np.diff(crowded), 100 / 30)
    assert crowded[0] > 0
    assert crowded[-1] < 100
    assert spread_out(np.zeros(0), 100).size == 0


def test_the_part_of_interest_keeps_the_films_aspect() -> None:
    mask = np.zeros((100, 200), dtype=bool)
    mask[40:50, 100:110] = True
    rows, cols = part_of_interest(mask, margin_px=5)
    assert (rows.start, rows.stop, cols.start, cols.stop) == (35, 55, 85, 125)
    mask[0, 0] = True
    rows, cols = part_of_interest(mask, margin_px=5)
    assert rows.start == 0
    assert rows.stop >= 50
    assert cols.start == 0
    assert cols.stop == 2 * rows.stop
    empty = part_of_interest(np.zeros((7, 9), dtype=bool), 3)
    assert empty == (slice(0, 7), slice(0, 9))


@pytest.mark.parametrize("cfa", ["GRBG", "BGGR", None])
def test_tiles_of_even_counts_are_even(cfa: str | None) -> None:
    dense = np.full(grid().shape_KLHW, 3)
    counts = PhotonCounts.from_dense(dense, grid(), cfa=cfa)
    tiles = count_tiles(counts, (slice(3, 59), slice(1, 40)))
    assert tiles.shape[:2] == (2, 3)
    np.testing.assert_allclose(tiles, 3)


def test_a_photon_lights_its_own_bin_and_colour() -> None:
    where = {"k": [1], "l": [2], "i": [10], "j": [21], "n": [4]}
    counts = PhotonCounts.from_events(**{k: np.array(v) for k, v in where.items()}, grid=grid(), cfa="GRBG")
    tiles = count_tiles(counts, (slice(0, 60), slice(0, 40)))
    assert np.argwhere(tiles).tolist() == [[1, 2, 10 * tiles.shape[2] // 60, 21 * tiles.shape[3] // 40, 0]]
    beside = count_tiles(counts, (slice(11, 60), slice(0, 40)))
    assert not beside.any()


def test_large_grids_are_told_by_some_views() -> None:
    assert evenly_chosen(5, 12).tolist() == [0, 1, 2, 3, 4]
    assert evenly_chosen(100, 3).tolist() == [0, 50, 99]
    dense = np.ones(grid(rows=30, cols=1).shape_KLHW, dtype=int)
    tiles = count_tiles(PhotonCounts.from_dense(dense, grid(rows=30, cols=1)), (slice(0, 60), slice(0, 40)))
    assert tiles.shape[:2] == (12, 1)


def test_full_light_tiles_are_means_of_each_colour() -> None:
    colours = np.array([0.2, 0.5, 0.9])
    whole = np.broadcast_to(colours, (*grid().shape_KLHW, 3)).copy()
    box = (slice(0, 60), slice(1, 40))
    tiles = radiance_tiles(Views(whole, grid()), 2, 10, box)
    assert tiles.shape == (2, 2, 10, 6, 3)  # 39 of 60 in 10
    np.testing.assert_allclose(tiles, np.broadcast_to(colours, tiles.shape))
    raw = np.empty((*grid().shape_KLHW, 1))
    for a, b, colour in ((0, 0, 1), (0, 1, 0), (1, 0, 2), (1, 1, 1)):  # GRBG
        raw[:, :, a::2, b::2] = colours[colour]
    mosaic = radiance_tiles(Views(raw, grid(), cfa="GRBG"), 2, 10, box)
    np.testing.assert_allclose(mosaic, tiles)
    fine = radiance_tiles(Views(raw, grid(), cfa="GRBG"), 2, 60, box)
    assert fine.shape[2:] == (30, 19, 3)  # a bin holds each colour, so it has two pixels to a side
    np.testing.assert_allclose(fine, np.broadcast_to(colours, fine.shape))


def test_joined_tiles_stand_in_the_cameras_order() -> None:
    tiles = np.zeros((2, 2, 3, 4, 3))
    tiles[0, 1] = 1.0
    sheet = joined(tiles)
    assert sheet.shape == (3 + 2 + 3, 4 + 2 + 4, 3)
    assert sheet[:3, 6:].min() == pytest.approx(1, abs=1e-15)  # 1.055 - 0.055 is rounded
    assert sheet[:3, :4].max() == 0
    assert joined(np.zeros((1, 1, 2, 2, 3))).max() == 0


def test_a_sheet_names_its_cameras_and_photons(nested_dataset: Path) -> None:
    from simgen.figures.contact_sheet import facts

    dataset = open_dataset(nested_dataset)
    cameras, light = facts(dataset, dataset.counts)
    assert "2 x 3 views of 64 x 60 pixels" in cameras
    assert "pitch 18 x 18 mm" in cameras
    assert "budget 400 per view" in light
    assert f"{dataset.counts.total:,} photons" in light
