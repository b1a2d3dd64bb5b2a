"""Draws of distributions by command: as scenes of their own, and looked at."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import simgen
from pcii.base import command_line
from simgen.app import commands as cli
from simgen.spec.scene import load_scene

SCENE = """title = "Labels"
[[lights]]
type = "uniform"
luminance_cd_m2 = 100.0
[[objects]]
name = "label"
count = 3
position_mm = [{ uniform = [-50, 50] }, 0, 500]
shape = { type = "card", width_mm = 20, height_mm = 20 }
material = { texture = { choice = ["red.png", "art/green.png"] } }
"""


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert command_line.run(cli.app, arguments) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("name", ["drawn_solids", "drawn_foliage", "drawn_shiny"])
def test_a_draw_as_a_scene_of_its_own_is_that_draw(name: str, tmp_path: Path) -> None:
    out = tmp_path / "new" / "mine"
    assert command_line.run(cli.app, ["draw", name, "--scene", "17", "-o", str(out)]) == 0
    assert load_scene(str(out))[0] == load_scene(name, number=17)[0] == simgen.load_scene(name, 17)
    assert [file.name for file in out.iterdir()] == ["scene.toml"]


def test_files_that_a_draw_names_are_copied_beside_it(tmp_path: Path) -> None:
    folder, out = tmp_path / "labels", tmp_path / "out"
    (folder / "art").mkdir(parents=True)
    (folder / "scene.toml").write_text(SCENE)
    for colour, name in (((255, 0, 0), "red.png"), ((0, 255, 0), "art/green.png")):
        Image.new("RGB", (4, 4), colour).save(folder / name)
    assert command_line.run(cli.app, ["draw", str(folder), "--scene", "2", "-o", str(out)]) == 0
    scene, _ = load_scene(str(out))
    named = {str(thing.material.texture) for thing in scene.objects}
    copied = {file.relative_to(out).as_posix() for file in out.rglob("*") if file.is_file()}
    assert copied == named | {"scene.toml"}
    for name in named:
        assert (out / name).read_bytes() == (folder / name).read_bytes()


def test_a_draw_goes_into_a_new_or_empty_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("mine")
    for out, words in ((tmp_path, "holds something else"), (tmp_path / "file", "this is a file")):
        said = refusal(["draw", "drawn_room", "--scene", "1", "-o", str(out)], capsys)
        assert words in said
    assert (tmp_path / "file").read_text() == "mine"
    said = refusal(["draw", "desk", "--scene", "1", "-o", str(tmp_path / "desk")], capsys)
    assert "is one scene" in said
    assert "whole number" in refusal(["draw", "drawn_room", "--scene", "x", "-o", "x"], capsys)


def test_scenes_are_listed_with_their_kind(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.run(cli.app, ["scenes"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    for name in ("drawn_room", "drawn_solids"):
        assert lines[name].endswith("(a distribution)")
    assert not lines["desk"].endswith("(a distribution)")


@pytest.mark.renders
def test_preview_and_check_ask_for_a_number_or_take_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pictures = []
    for number in ("1", "2"):
        out = tmp_path / f"{number}.png"
        command = ["preview", "drawn_solids", "--scene", number, "-o", str(out), "--samples-per-pixel", "1"]
        assert command_line.run(cli.app, command) == 0
        pictures.append(np.asarray(Image.open(out)))
    assert pictures[0].shape != pictures[1].shape or (pictures[0] != pictures[1]).any()
    assert "--scene 0" in refusal(["preview", "drawn_solids", "-o", str(tmp_path / "x.png")], capsys)
    assert command_line.run(cli.app, ["check", "drawn_plain", "--scene", "3", "--json"]) in (0, 1)
    found = json.loads(capsys.readouterr().out)
    assert any("solid-0" in finding["text"] for finding in found)
    assert command_line.run(cli.app, ["check", "drawn_plain"]) == 0
    assert "draws 0 to 19" in capsys.readouterr().out
    assert "is one scene" in refusal(["check", "desk", "--scene", "3"], capsys)
    recipe = tmp_path / "recipe.toml"
    recipe.write_text('scene = "drawn_plain"\n')
    assert command_line.run(cli.app, ["check", str(recipe)]) == 0
    assert "draws 0 to 19" in capsys.readouterr().out
    assert "scene_number = 0" in refusal(["generate", str(recipe), "-o", str(tmp_path / "data")], capsys)
    assert not (tmp_path / "data").exists()
