"""`simgen preview` and `simgen sheet`: pictures that show something, names that can be read, refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tiny import TINY_RECIPE

import simgen
from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.core.bayer import mosaic
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import Truth
from pcii.figures.pictures import to_srgb8
from pcii.io.dataset import open_dataset
from pcii.io.dataset_writer import save_dataset
from simgen.app import commands as cli
from simgen.app.contact_sheet import photon_block_px, photon_tiles, radiance_tiles, write_sheet
from simgen.app.picture_parts import part_of_interest
from simgen.dataset.generation import generate
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
    [(6, 6, 32, 32), (1, 12, 32, 32), (2, 2, 160, 20), (2, 3, 12, 200)],
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
    monkeypatch.setattr("simgen.app.contact_sheet.save_figure", lambda figure, _: drawn.append(figure))
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
def test_a_folder_that_may_not_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    simgen.preview("two_objects", tmp_path / "x.png", samples_per_pixel=1)
    assert_shows_something(tmp_path / "x.png")
    monkeypatch.setattr("simgen.app.picture_parts.write_bytes_safely", refuse)
    with pytest.raises(InputError, match=r"x.png: cannot be written here \(Permission denied\)$"):
        simgen.preview("two_objects", tmp_path / "x.png", samples_per_pixel=1)


def test_the_part_of_interest_keeps_the_films_aspect() -> None:
    mask = np.zeros((100, 200), dtype=bool)
    mask[40:50, 100:110] = True
    rows, cols = part_of_interest(mask, away_px=4)  # and a margin of 6
    assert (rows.start, rows.stop, cols.start, cols.stop) == (30, 60, 75, 135)
    mask[0, 0] = True
    rows, cols = part_of_interest(mask)
    assert (rows.start, cols.start) == (0, 0)
    assert rows.stop >= 50
    assert cols.stop == 2 * rows.stop
    empty = part_of_interest(np.zeros((7, 9), dtype=bool), 3)
    assert empty == (slice(0, 7), slice(0, 9))


def test_a_photon_lights_its_own_block_and_colour_in_its_view() -> None:
    where = {"k": [1], "l": [1], "i": [10], "j": [21], "n": [4]}
    counts = PhotonCounts.from_events(*map(np.array, where.values()), grid=grid(), cfa="GRBG")
    tiles = photon_tiles(counts, (slice(1, 60), slice(0, 40)), 2)
    tiles[30:32], tiles[:, 20:22], tiles[:, 42:44] = 0, 0, 0  # the gaps
    assert np.argwhere(tiles).tolist() == [[32 + 5, 22 + 10, 0]]
    beside = photon_tiles(counts, (slice(12, 60), slice(0, 40)), 2)
    assert not beside[26:, 22:42].any()


@pytest.mark.parametrize(("photons", "side_px"), [(0, 3), (500, 2), (10**6, 1)])
def test_photons_are_shown_in_blocks_that_hold_some(photons: int, side_px: int) -> None:
    """24 blocks along 60 pixels at the fewest; 45 x 30 of which a quarter is lit hold 1.5 of 500 photons."""
    dense = np.random.default_rng(0).poisson(photons / 2400, grid().shape_KLHW)
    counts = PhotonCounts.from_dense(dense, grid())
    assert photon_block_px(counts, (slice(0, 60), slice(0, 40))) == side_px


def test_large_grids_are_told_by_some_views() -> None:
    dense = np.ones(grid(rows=30, cols=1).shape_KLHW, dtype=int)
    counts = PhotonCounts.from_dense(dense, grid(rows=30, cols=1))
    assert photon_tiles(counts, (slice(0, 60), slice(0, 40)), 2).shape == (12 * 32 - 2, 20, 3)


@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_full_light_is_shown_in_its_colours_whatever_the_part(cfa: str | None) -> None:
    colours = np.array([0.2, 0.5, 0.9])
    light = np.broadcast_to(colours, (*grid().shape_KLHW, 3)).copy()
    if cfa is not None:
        light = mosaic(light, cfa)[..., None]
    tiles = radiance_tiles(Views(light, grid(), cfa=cfa), 2, 10, (slice(1, 60), slice(1, 40)))
    assert tiles.shape == (2 * (10 + 2) - 2, 2 * (7 + 2) - 2, 3)
    shown = to_srgb8(colours[None, None], 0.9)[0, 0]
    tiles[10:12], tiles[:, 7:9] = shown, shown  # the gaps
    assert (tiles == shown).all()


def test_a_sheet_names_its_cameras_and_photons(nested_dataset: Path) -> None:
    from simgen.app.contact_sheet import facts

    dataset = open_dataset(nested_dataset)
    cameras, light = facts(dataset, dataset.counts)
    assert "2 x 3 views of 64 x 60 pixels" in cameras
    assert "pitch 18 x 18 mm" in cameras
    assert "budget 400 per view" in light
    assert f"{dataset.counts.total:,} photons" in light
