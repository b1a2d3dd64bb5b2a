"""The faults of a file are listed together, each in a line with its field."""

from pathlib import Path

import pytest

from pcii.base import command_line
from pcii.base.errors import InputError
from simgen.app import commands as simgen_cli
from simgen.base.strict_models import MOST_FAULTS, validate
from simgen.spec.recipe import Recipe
from simgen.spec.scene_lookup import load_scene

SCENE = """
title = "Faults"
planes_mm = [540, -3]

[[objects]]
name = "3 b"
position_mm = [1, 2, 500]
shape = { type = "sphere", radius = 3 }
material = { reflectance = 7 }

[[objects]]
name = "c"
position_mm = [1, 2, "c"]
shape = { type = "ball", radius_mm = 3 }
material = { texture = { type = "noise", contrast = -1 } }

[[lights]]
type = "uniform"
luminance_cd_m2 = "bright"
"""
FIELDS = (
    "objects[0].shape.radius",
    "planes_mm[1]",
    "objects[0].name",
    "objects[0].material.reflectance",
    "objects[1].position_mm[2]",
    "objects[1].shape.type",
    "objects[1].material.texture.contrast",
    "lights[0].luminance_cd_m2",
)
FILES = """
title = "t"
[[objects]]
name = "a"
position_mm = [0, 0, 500]
shape = { type = "mesh", file = "a.ply" }
material = { texture = "a.png" }
[[lights]]
type = "uniform"
luminance_cd_m2 = 1
"""


def lines_of(scene: str, folder: Path) -> list[str]:
    (folder / "scene.toml").write_text(scene)
    with pytest.raises(InputError) as caught:
        load_scene(str(folder))
    return [str(caught.value), *caught.value.__notes__]


def test_every_fault_of_a_scene_names_its_field(tmp_path: Path) -> None:
    lines = lines_of(SCENE, tmp_path)
    assert len(lines) == len(FIELDS)
    assert f"unknown key '{FIELDS[0]}'; did you mean 'radius_mm'? (and {len(FIELDS) - 1} more)" in lines[0]
    for field in FIELDS:
        assert len([line for line in lines if f"'{field}'" in line]) == 1, field


def test_every_missing_file_is_listed(tmp_path: Path) -> None:
    first, second = lines_of(FILES, tmp_path)
    assert "object 'a', shape.file: there is no file 'a.ply'" in first
    assert "object 'a', material.texture: there is no file 'a.png'" in second


def test_a_command_prints_each_fault_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "r.toml"
    recipe.write_text('scene = "two_objects"\nseed = -1\n[photons]\nbudgt = 3\n')
    assert command_line.run(simgen_cli.app, ["check", str(recipe)]) == 2
    unknown = "unknown key 'photons.budgt'; did you mean 'budget'?"
    assert capsys.readouterr().err.splitlines() == [
        f"error: {recipe}: {unknown} (and 1 more)",
        "  'seed': input should be greater than or equal to 0, got -1",
    ]


def test_very_many_faults_are_listed_in_part() -> None:
    with pytest.raises(InputError) as caught:
        validate(Recipe, {f"key{n}": 0 for n in range(1000)}, "r.toml")
    assert len(caught.value.__notes__) == MOST_FAULTS - 1
    assert "(and 999 more)" in str(caught.value)
