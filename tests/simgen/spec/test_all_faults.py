"""Every fault of a file is told at once, each in a line with its field."""

from pathlib import Path

import pytest

from pcii.base import command_line
from pcii.base.errors import InputError
from simgen.app import commands as simgen_cli
from simgen.base.strict_models import MOST_FAULTS, validate
from simgen.spec.recipe import Recipe
from simgen.spec.scene_lookup import load_scene

SCENE = """
titel = "Faults"
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
    "titel",
    "objects[0].shape.radius",
    "planes_mm[1]",
    "objects[0].name",
    "objects[0].material.reflectance",
    "objects[1].position_mm[2]",
    "objects[1].shape.type",
    "objects[1].material.texture.contrast",
    "lights[0].luminance_cd_m2",
)


def faults_of(fault: InputError) -> list[str]:
    return [str(fault), *fault.__notes__]


def test_every_fault_of_a_scene_names_its_field(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    with pytest.raises(InputError) as caught:
        load_scene(str(tmp_path))
    told = faults_of(caught.value)
    assert len(told) == len(FIELDS)
    assert f"(and {len(FIELDS) - 1} more)" in told[0]
    for field in FIELDS:
        assert len([line for line in told if f"'{field}'" in line]) == 1, field
    assert not [line for line in told if "\n" in line]


def test_a_command_prints_each_fault_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "r.toml"
    recipe.write_text('scen = "two_objects"\nseed = -1\n[photons]\nbudgt = 3\n')
    assert command_line.run(simgen_cli.app, ["check", str(recipe)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"error: {recipe}: unknown key 'photons.budgt'; did you mean 'budget'?")
    # That scene is missing follows from its misspelling, and is not told too.
    assert lines[1:] == [
        "  unknown key 'scen'; did you mean 'scene'?",
        "  'seed': input should be greater than or equal to 0, got -1",
    ]


def test_very_many_faults_are_told_in_part() -> None:
    with pytest.raises(InputError) as caught:
        validate(Recipe, {f"key{n}": 0 for n in range(1000)}, "r.toml")
    assert len(faults_of(caught.value)) == MOST_FAULTS
    assert "(and 1000 more)" in str(caught.value)  # a scene is missing too
