"""Scenes and recipes are listed, and those to start from work as they are written."""

import itertools
from pathlib import Path
from typing import Any

import pytest

from pcii.base import InputError, command_line
from pcii.store import verify
from simgen.app import commands as simgen_cli
from simgen.app import new_recipe, new_scene
from simgen.check import lint
from simgen.spec import load_recipe, load_scene


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(command: str) -> None:
    assert command_line.run(simgen_cli.app, command.split()) == 0, command


@pytest.mark.renders
def test_a_scene_and_a_recipe_work_as_they_are_written() -> None:
    run("new-scene mine")
    run("new-recipe mine")
    for target in ("mine", "data_recipes/mine.toml"):
        _, findings = lint(target)
        assert not [finding.line() for finding in findings if finding.verdict in ("bad", "warn")]
    text = Path("data_recipes/mine.toml").read_text()
    assert "generate data_recipes/mine.toml -o out/mine" in text
    smaller = "--set grid.rows=2 --set grid.cols=2 --set grid.height=32 --set grid.width=32"
    run(f"generate data_recipes/mine.toml -o out/mine {smaller} --set render.samples_per_pixel=1")
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
    run("scenes")
    for listed, name in zip(
        capsys.readouterr().out.split("Recipes, of"), ("two_objects", "paper"), strict=True
    ):
        lines = {line.split()[0]: line for line in listed.splitlines() if line}
        assert "not valid: " in lines["mine"]
        assert "not valid: " not in lines[name]
        assert lines[name].split(maxsplit=1)[1]
        assert ("drawn_room" in lines) == (name == "two_objects")
