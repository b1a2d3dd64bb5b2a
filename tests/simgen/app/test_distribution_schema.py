"""The schema of scene files takes scenes and distributions of scenes, and nothing else."""

import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from simgen.app.distribution_schema import scene_schema

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def schema() -> Draft202012Validator:
    return Draft202012Validator(scene_schema())


@pytest.mark.parametrize("name", sorted(file.parent.name for file in ROOT.glob("scenes/*/scene.toml")))
def test_the_schema_fits_every_scene_that_ships(name: str, schema: Draft202012Validator) -> None:
    values = tomllib.loads((ROOT / "scenes" / name / "scene.toml").read_text())
    assert schema.is_valid(values)
    values["objects"] = [*values.get("objects", []), {"name": "thing", "colour": 3}]
    assert not schema.is_valid(values)


def test_the_schema_refuses_distributions_that_are_none(schema: Draft202012Validator) -> None:
    for value, right in (
        ("{ uniform = [1, 2] }", True),
        ("[{ uniform = [1, 2] }]", False),
        ("{ uniform = [1, 2, 3] }", False),
        ("{ unifrom = [1, 2] }", False),
        ('{ variable = "near", plus = { normal = [0, 1] } }', True),
        ('{ variable = "near", add = 3 }', False),
        ("{ choice = [1, { integer = [1, 2] }], weights = [1, 2] }", True),
    ):
        scene = tomllib.loads(f'title = "a"\n[[lights]]\ntype = "uniform"\nluminance_cd_m2 = {value}\n')
        assert schema.is_valid(scene) is right, value


def test_names_of_objects_are_not_drawn_and_those_of_metals_are(schema: Draft202012Validator) -> None:
    name = '{ choice = ["Ag", "Au"] }'
    for metal, thing, right in ((name, '"coin"', True), ('"Ag"', name, False)):
        scene = tomllib.loads(
            'title = "a"\nlights = [{ type = "uniform", luminance_cd_m2 = 1 }]\n[[objects]]\n'
            f"name = {thing}\nposition_mm = [0, 0, 500]\nshape = {{ type = 'sphere', radius_mm = 9 }}\n"
            f"material = {{ finish = {{ type = 'metal', name = {metal} }} }}\n"
        )
        assert schema.is_valid(scene) is right, metal
