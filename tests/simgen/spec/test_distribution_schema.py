"""The schema of scene files takes scenes and distributions of scenes, and nothing else."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from simgen.spec.distribution_schema import scene_schema

ROOT = Path(__file__).resolve().parents[3]
TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "integer": (int,),
    "number": (int, float),
    "null": (type(None),),
}


def resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    return schema["$defs"][node["$ref"].split("/")[-1]] if "$ref" in node else node


def has_type(kind: str | None, value: Any) -> bool:
    return kind is None or type(value) in TYPES[kind]


def fits(schema: dict[str, Any], node: dict[str, Any], value: Any) -> bool:
    """The part of JSON Schema that scenes use."""
    node = resolve(schema, node)
    if "anyOf" in node and not any(fits(schema, part, value) for part in node["anyOf"]):
        return False
    if "oneOf" in node and sum(fits(schema, part, value) for part in node["oneOf"]) != 1:
        return False
    if "const" in node and value != node["const"]:
        return False
    if "enum" in node and value not in node["enum"]:
        return False
    kind = node.get("type")
    if not has_type(kind, value):
        return False
    if kind == "object":
        known = node.get("properties", {})
        if node.get("additionalProperties") is False and not value.keys() <= known.keys():
            return False
        if not set(node.get("required", ())) <= value.keys():
            return False
        return all(fits(schema, known[key], item) for key, item in value.items() if key in known)
    if kind == "array":
        first = node.get("prefixItems", [])
        rest = [node.get("items", {})] * max(0, len(value) - len(first))
        enough = node.get("minItems", 0) <= len(value) <= node.get("maxItems", len(value))
        return enough and all(
            fits(schema, part, item) for part, item in zip([*first, *rest], value, strict=False)
        )
    return True


@pytest.mark.parametrize("name", sorted(file.parent.name for file in ROOT.glob("scenes/*/scene.toml")))
def test_the_schema_fits_every_scene_that_ships(name: str) -> None:
    schema = scene_schema()
    values = tomllib.loads((ROOT / "scenes" / name / "scene.toml").read_text())
    assert fits(schema, schema, values)
    values["objects"] = [*values.get("objects", []), {"name": "thing", "colour": 3}]
    assert not fits(schema, schema, values)


def test_the_schema_refuses_distributions_that_are_none() -> None:
    schema = scene_schema()
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
        assert fits(schema, schema, scene) is right, value


def test_names_of_objects_are_not_drawn_and_those_of_metals_are() -> None:
    schema = scene_schema()
    name = '{ choice = ["Ag", "Au"] }'
    for metal, thing, right in ((name, '"coin"', True), ('"Ag"', name, False)):
        scene = tomllib.loads(
            'title = "a"\nlights = [{ type = "uniform", luminance_cd_m2 = 1 }]\n[[objects]]\n'
            f"name = {thing}\nposition_mm = [0, 0, 500]\nshape = {{ type = 'sphere', radius_mm = 9 }}\n"
            f"material = {{ finish = {{ type = 'metal', name = {metal} }} }}\n"
        )
        assert fits(schema, schema, scene) is right, metal
