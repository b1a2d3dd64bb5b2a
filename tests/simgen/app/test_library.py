"""The functions of `import simgen`, with or without files, and commands that list and start scenes."""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run_simgen
from tiny import GRID_2_X_3, TINY_RECIPE

import pcii
import simgen
from pcii.base import InputError
from pcii.store import verify
from pcii.types import Readout
from simgen.app import new_recipe, new_scene
from simgen.check import lint
from simgen.spec import Recipe, load_recipe, load_scene

GRID = Recipe.model_validate(TINY_RECIPE).grid.camera_grid()
BALL, GLASS = simgen.Sphere(radius_mm=60), simgen.Material(finish=simgen.Glass())
CARD = simgen.Card(width_mm=400, height_mm=300)
CHECKS = simgen.Material(texture=simgen.Checks(rows=6, columns=8))
SCENE = simgen.Scene(
    title="A glass ball before a card",
    objects=(
        simgen.SceneObject(name="ball", position_mm=(0, 0, 500), shape=BALL, material=GLASS),
        simgen.SceneObject(name="card", position_mm=(0, 0, 620), shape=CARD, material=CHECKS, scored=False),
    ),
    lights=(simgen.UniformLight(luminance_cd_m2=100),),
)
LENS = simgen.Lens(aperture_mm=6, focus_mm=560)
ERRORS = {"position_sd_mm": [0.5, 0.5, 0.1], "rotation_sd_deg": [0.1, 0.1, 0.2], "pitch_error": 0.01}
FRAMES = {"frames": 3, "bits": 1}
SENSOR = {"cfa": "RGGB", "dark_counts": 0.01, "hot_pixels": "map.npy", "dead_pixel_share": 0.1, **FRAMES}


def dataset_of(out: Path, **tables: Any) -> pcii.Dataset:
    """The dataset of `SCENE` on disk, seen by `GRID`."""
    folder = SCENE.save(out / "scene").parent
    grid = TINY_RECIPE["grid"] | tables.pop("grid", {})
    recipe = Recipe.model_validate({"scene": str(folder), "grid": grid, **tables})
    simgen.generate(simgen.RecipeFile(recipe, out), out / "made")
    return pcii.open_dataset(out / "made")


def assert_same(counts: pcii.PhotonCounts, truth: pcii.Truth, dataset: Any) -> None:
    """Photons, their frames and origins, and the truth, are those of the dataset."""
    assert (counts.grid, counts.cfa, counts.readout) == (dataset.grid, dataset.cfa, dataset.counts.readout)
    for name in "klijn":
        np.testing.assert_array_equal(getattr(counts.events, name), getattr(dataset.counts.events, name))
    if dataset.counts.frame is not None:
        np.testing.assert_array_equal(counts.frame, dataset.counts.frame)
    assert truth.names == dataset.truth.names
    assert truth.unscored == dataset.truth.unscored == {2}
    for name in ("z_mm", "object_id", "normal", "coverage"):
        np.testing.assert_array_equal(getattr(truth, name), getattr(dataset.truth, name))
    for name in ("k", "l", "i", "j", "object_id", "z_mm"):
        known = getattr(dataset.truth.photons, name)
        np.testing.assert_array_equal(getattr(truth.photons, name), known)


@pytest.mark.renders
def test_photons_by_lens_errors_and_sensor_are_those_of_the_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("map.npy", np.where(np.arange(60) == 7, 0.5, np.zeros((64, 60))))
    made: Any = {"photons": {"budget": 300}, "render": {"max_depth": 6}, "products": {"frames": True}}
    dataset = dataset_of(tmp_path, seed=3, grid={"lens": LENS, "errors": ERRORS}, sensor=SENSOR, **made)
    assert dataset.counts.readout == Readout(3, 1)
    assert dataset.counts.frame is not None
    hot, beside = (dataset.counts.dense[..., column].mean() for column in (7, 8))
    # Of a mean of 0.5 counts a tenth is dead, and frames of one bit hold less.
    assert 0.3 < hot - beside < 0.5
    options: dict[str, Any] = {"budget": 300, "seed": 3, "lens": LENS.model_dump(), "max_depth": 6}
    errors, sensor = simgen.CalibrationErrors.model_validate(ERRORS), simgen.Sensor.model_validate(SENSOR)
    tables: Any
    for tables in ({"errors": ERRORS, "sensor": SENSOR}, {"errors": errors, "sensor": sensor}):
        counts, truth = simgen.draw_photons(SCENE, GRID, **tables, **options)
        assert_same(counts, truth, dataset)


@pytest.mark.renders
def test_views_are_those_of_the_dataset(tmp_path: Path) -> None:
    products = {"radiance": "rgb", "counts": False, "truth": False}
    render = {"samples_per_pixel": 3, "max_depth": 6}
    dataset: Any = dataset_of(tmp_path, seed=3, grid={"lens": LENS}, products=products, render=render)
    reports: list[tuple[str, int, int]] = []
    options: dict[str, Any] = {"samples_per_pixel": 3, "lens": LENS, "max_depth": 6}
    views = simgen.render(SCENE, GRID, seed=3, report=lambda *stage: reports.append(stage), **options)
    for k, l in np.ndindex(GRID.rows, GRID.cols):
        np.testing.assert_array_equal(views.view(k, l), dataset.views.view(k, l))
    assert reports[-1] == ("views", 6, 6)
    other = simgen.render(SCENE, GRID, seed=4, **options)
    assert (np.asarray(other.radiance) != np.asarray(views.radiance)).any()


@pytest.mark.renders
def test_a_preview_is_shown_by_notebooks_and_written(tmp_path: Path) -> None:
    out = tmp_path / "look.png"
    picture = simgen.preview(SCENE, out, samples_per_pixel=1)
    assert repr(picture) == "Preview(title='A glass ball before a card')"
    assert picture._repr_png_() == out.read_bytes()
    by_name = simgen.preview(SCENE.save(tmp_path / "scene"), samples_per_pixel=1)
    assert by_name._repr_png_() == picture._repr_png_()


def test_a_recipe_may_be_named_or_be_a_path(tmp_path: Path) -> None:
    path = tmp_path / "tiny.toml"
    path.write_text(f'scene = "two_objects"\nseed = [1, 2]\n{GRID_2_X_3}')
    for recipe, message in (
        ("smal", r"recipe: there is no 'smal'; did you mean 'small'\?"),
        (path, r"tiny.toml: seed: several values; use simgen.generate_collection$"),
    ):
        with pytest.raises(pcii.InputError, match=message):
            simgen.generate(recipe, tmp_path / "out")
    with pytest.raises(pcii.InputError, match=r"no field has several values; use simgen.generate "):
        simgen.generate_collection("small", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_scene_of_values_is_that_of_the_file(tmp_path: Path) -> None:
    picture = simgen.Material(texture="a.png")
    values = SCENE.replace("card", material=picture).model_dump()
    (tmp_path / "a.png").write_bytes(b"")
    scene = simgen.load_scene(values, folder=tmp_path)
    assert scene == simgen.load_scene(scene.save(tmp_path))
    with pytest.raises(pcii.InputError, match=r"object 'card', .*: 'a.png' is looked for in .*folder="):
        simgen.load_scene(values)
    with pytest.raises(pcii.InputError, match=r"scene: object 'card', .*: there is no file 'a.png' in"):
        simgen.load_scene(values, folder=tmp_path / "none")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scene": "two_objects"}, r"^scene: expected a Scene, got str$"),
        ({"grid": {}}, r"^grid: expected a CameraGrid, got dict$"),
        ({"seed": -1}, r"^(draw_photons|render): 'seed': "),
        ({"errors": {"pitch": 3}}, r"unknown key 'grid.errors.pitch'; did you mean 'pitch_error'\?$"),
    ],
)
def test_a_wrong_argument_is_named(arguments: dict[str, Any], message: str) -> None:
    for call in (simgen.draw_photons, simgen.render):
        with pytest.raises(pcii.InputError, match=message):
            call(**{"scene": SCENE, "grid": GRID, **arguments})
    large = replace(GRID, rows=1000, cols=1000, height=1000, width=1000)
    with pytest.raises(pcii.InputError, match=r"^grid: radiance of all views takes 12 TB of memory"):
        simgen.render(SCENE, large, samples_per_pixel=1)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.renders
def test_a_scene_and_a_recipe_work_as_they_are_written() -> None:
    for command in ("new-scene", "new-recipe"):
        assert run_simgen(command, "mine") == 0
    for target in ("mine", "data_recipes/mine.toml"):
        _, findings = lint(target)
        assert not [finding.line() for finding in findings if finding.verdict in ("bad", "warn")]
    text = Path("data_recipes/mine.toml").read_text()
    assert "generate data_recipes/mine.toml -o out/mine" in text
    smaller = "grid.rows=2", "grid.cols=2", "grid.height=32", "grid.width=32", "render.samples_per_pixel=1"
    settings = [f"--set={setting}" for setting in smaller]
    assert run_simgen("generate", "data_recipes/mine.toml", "-o", "out/mine", *settings) == 0
    assert verify(Path("out/mine")) > 0


def test_a_recipe_is_of_the_scene_of_its_name_or_of_another() -> None:
    new_scene("mine")
    new_recipe("mine")
    assert load_recipe("mine")[0].scene == "mine"
    Path("elsewhere").mkdir()
    Path("scenes/mine").rename("elsewhere/other")
    new_recipe("by-path", scene="elsewhere/other")
    recipe, near = load_recipe("data_recipes/by-path.toml")
    assert recipe.scene == "../elsewhere/other"
    assert (load_scene(recipe.scene, near).folder or Path()).resolve() == Path("elsewhere/other").resolve()
    new_recipe("drawn", scene="drawn_solids")
    assert load_recipe("data_recipes/drawn.toml")[0].scene_number == 0


def test_a_copy_has_the_files_and_the_comments_of_the_scene() -> None:
    new_scene("copy", from_="two_objects")
    path = Path("scenes/copy/scene.toml")
    assert "# A large lamp up to the left" in path.read_text()
    scene: Any = load_scene("copy")
    assert [thing.name for thing in scene.objects] == ["ball", "bird"]
    assert (scene.folder / "bird.ply").is_file()


def test_names_that_are_taken_and_scenes_that_cannot_be_copied_are_refused() -> None:
    for write, name in itertools.product((new_scene, new_recipe), ("3d", "../a", "", "scene.toml")):
        with pytest.raises(InputError, match="NAME: expected a letter"):
            write(name)
    assert not list(Path().iterdir())
    new_scene("mine")
    new_recipe("mine")
    before = Path("scenes/mine/scene.toml").read_bytes()
    for name in ("mine", "two_objects", "drawn_room"):
        with pytest.raises(InputError, match=f"NAME: '{name}' is the name of a scene already"):
            new_scene(name, from_="desk")
    for name in ("mine", "paper"):
        with pytest.raises(InputError, match=f"NAME: '{name}' is the name of a recipe already"):
            new_recipe(name)
    for source, message in (("dezk", "did you mean 'desk'"), ("drawn_room", "drawn by number")):
        with pytest.raises(InputError, match=message):
            new_scene("other", from_=source)
    assert Path("scenes/mine/scene.toml").read_bytes() == before
    assert [path.name for path in Path("scenes").iterdir()] == ["mine"]


def test_lists_name_what_is_there_and_a_broken_file_does_not_hide_the_others(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for file in (Path("scenes/mine/scene.toml"), Path("data_recipes/mine.toml")):
        file.parent.mkdir(parents=True)
        file.write_text("titel = 3")
    assert run_simgen("scenes") == 0
    parts = capsys.readouterr().out.split("Recipes, of")
    for listed, name in zip(parts, ("two_objects", "paper"), strict=True):
        lines = {line.split()[0]: line for line in listed.splitlines() if line}
        assert "not valid: " in lines["mine"]
        assert "not valid: " not in lines[name]
        assert lines[name].split(maxsplit=1)[1]
        assert ("drawn_room" in lines) == (name == "two_objects")
