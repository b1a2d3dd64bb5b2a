"""Scenes and recipes to start from work as they are written."""

import tomllib
from pathlib import Path

import pytest

from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.io.verification import verify
from simgen.app import commands as simgen_cli
from simgen.app.starting_points import write_new_recipe, write_new_scene
from simgen.check.targets import lint
from simgen.spec.recipe import load_recipe
from simgen.spec.scene_lookup import load_scene


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def typed(command: str, *, code: int = 0) -> None:
    assert command_line.run(simgen_cli.app, command.split()) == code, command


@pytest.mark.renders
def test_a_scene_and_a_recipe_work_as_they_are_written() -> None:
    typed("new-scene mine")
    typed("new-recipe mine")
    for target in ("mine", "data_recipes/mine.toml"):
        _, findings = lint(target)
        assert not [finding.line() for finding in findings if finding.verdict in ("bad", "warn")]
    typed("preview mine -o mine.png --samples-per-pixel 1")
    smaller = "--set grid.rows=2 --set grid.cols=2 --set grid.height=32 --set grid.width=32"
    typed(f"generate data_recipes/mine.toml -o out/mine {smaller} --set render.samples_per_pixel=1")
    assert verify(Path("out/mine")) > 0


def test_a_recipe_is_of_the_scene_of_its_name_or_of_the_one_that_is_told() -> None:
    write_new_scene("mine")
    Path("elsewhere").mkdir()
    Path("scenes/mine").rename("elsewhere/other")
    write_new_recipe("by-path", "elsewhere/other")
    recipe, near = load_recipe("data_recipes/by-path.toml")
    assert recipe.scene == "../elsewhere/other"
    assert load_scene(recipe.scene, near)[1].resolve() == Path("elsewhere/other").resolve()
    write_new_recipe("drawn", "drawn_solids")
    assert load_recipe("data_recipes/drawn.toml")[0].scene_number == 0


@pytest.mark.renders
def test_of_a_scene_that_names_no_planes_the_depths_of_its_objects_are_looked_at() -> None:
    path = write_new_scene("mine", "two_objects")
    path.write_text(path.read_text().replace("planes_mm", "# planes_mm"))
    write_new_recipe("mine")
    recipe, _ = load_recipe("data_recipes/mine.toml")
    assert recipe.scene == "mine"
    near, far = recipe.analysis.z_mm
    assert abs(near - 540) < 5
    assert abs(far - 620) < 5


def test_a_copy_has_the_files_and_the_comments_of_the_scene() -> None:
    path = write_new_scene("copy", "two_objects")
    assert path == Path("scenes/copy/scene.toml")
    assert path.read_text().startswith("# copy: begun as a copy of the scene two_objects.\n")
    assert "# A large lamp up to the left" in path.read_text()
    scene, folder = load_scene("copy")
    assert [thing.name for thing in scene.objects] == ["ball", "bird"]
    assert (folder / "bird.ply").is_file()


@pytest.mark.parametrize("name", ["3d", "a/b", "../a", "", "a b", "scene.toml"])
def test_what_is_no_name_is_refused(name: str) -> None:
    for write in (write_new_scene, write_new_recipe):
        with pytest.raises(InputError, match="NAME: expected a letter"):
            write(name)
    assert not list(Path().iterdir())


def test_nothing_is_written_over_and_nothing_that_ships_is_hidden() -> None:
    write_new_scene("mine")
    before = Path("scenes/mine/scene.toml").read_bytes()
    with pytest.raises(InputError, match="scenes/mine: is there already"):
        write_new_scene("mine", "desk")
    assert Path("scenes/mine/scene.toml").read_bytes() == before
    for write, name in ((write_new_scene, "two_objects"), (write_new_recipe, "paper")):
        with pytest.raises(InputError, match="that ships; choose another"):
            write(name)
    write_new_recipe("mine")
    with pytest.raises(InputError, match="is there already"):
        write_new_recipe("mine")


def test_scenes_that_cannot_be_copied_are_refused_with_the_way_on() -> None:
    with pytest.raises(InputError, match="did you mean 'desk'"):
        write_new_scene("mine", "dezk")
    with pytest.raises(InputError, match=r"load_scene\('drawn_room', 0\)"):
        write_new_scene("mine", "drawn_room")
    with pytest.raises(InputError, match="--from: there is no scene"):
        write_new_scene("mine", "..")
    assert not list(Path().iterdir())


def test_names_are_put_in_where_they_belong() -> None:
    write_new_scene("FILE_SCENE_NAME")
    write_new_recipe("FILE_SCENE_NAME")
    text = Path("data_recipes/FILE_SCENE_NAME.toml").read_text()
    assert tomllib.loads(text)["scene"] == "FILE_SCENE_NAME"
    assert "generate data_recipes/FILE_SCENE_NAME.toml -o out/FILE_SCENE_NAME" in text
