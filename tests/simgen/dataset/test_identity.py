"""What identifies a dataset: all that may change its bytes, and nothing else."""

import tomllib
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest
import tomli_w
from pydantic import BaseModel

from pcii.base.errors import InputError
from pcii.store import software
from simgen.base.file_lookup import AssetName, recipe_roots
from simgen.dataset.prepared import prepare
from simgen.spec.recipe import Recipe, load_recipe
from simgen.spec.scene import Scene

Table = dict[str, Any]
Field = tuple[type[BaseModel], str]

PLASTIC, METAL = {"type": "plastic", "roughness": 0.2}, {"type": "metal", "name": "Au", "roughness": 0.2}
TEXTURES = [
    {"type": "checks", "rows": 4, "columns": 6},
    {"type": "stripes", "periods": 5.0, "angle_deg": 10.0},
    {"type": "star"},
    {"type": "edge"},
    {"type": "text", "text": "far"},
    {"type": "noise", "chroma": 0.1},
    "a.png",
]
MATERIALS = [
    *({"texture": texture} for texture in TEXTURES),
    {"reflectance": [0.2, 0.5, 0.8]},
    {"reflectance": "dark skin", "finish": PLASTIC},
    {"reflectance": {"wavelength_nm": [400.0, 700.0], "value": [0.2, 0.8]}},
    {"finish": METAL},
    {"finish": {"type": "glass"}},
    {"reflectance": "dark skin", "finish": {"type": "principled", "metallic": 0.5}},
    {"reflectance": "dark skin", "normal_map": "a.png"},
    {"reflectance": "dark skin", "opacity": "a.png", "tiled": True},
    {"reflectance": "dark skin", "emission": {"luminance_cd_m2": 9.0}},
    {"reflectance": "dark skin", "emission": {"luminance_cd_m2": 9.0, "texture": "a.png"}},
]
SHAPES = [
    {"type": "sphere", "radius_mm": 20.0},
    {"type": "card", "width_mm": 20.0, "height_mm": 30.0},
    {"type": "box", "width_mm": 20.0, "height_mm": 30.0, "depth_mm": 10.0},
    {"type": "cylinder", "radius_mm": 20.0, "length_mm": 30.0},
    {"type": "mesh", "file": "a.ply"},
]
AREA = {"type": "area", "position_mm": [0.0, -900.0, 0.0], "target_mm": [0.0, 0.0, 500.0]}
SCENE = {
    "title": "one of each",
    "objects": [
        {
            "name": f"thing-{number}",
            "position_mm": [10.0 * number, 0.0, 500.0 + number],
            "shape": SHAPES[number % len(SHAPES)],
            "material": material,
        }
        for number, material in enumerate(MATERIALS)
    ],
    "lights": [
        AREA | {"width_mm": 100.0, "height_mm": 90.0, "luminance_cd_m2": 1000.0},
        {"type": "point", "position_mm": [0.0, -500.0, 0.0], "intensity_cd": 10.0},
        {"type": "environment", "file": "a.exr", "luminance_cd_m2": 100.0},
        {"type": "spot", "position_mm": [0.0, -9.0, 0.0], "target_mm": [0.0, 0.0, 9.0], "intensity_cd": 1.0},
        {"type": "directional", "direction": [0.0, 1.0, 1.0], "illuminance_lux": 10.0},
    ],
    "level": {"illuminance_lux": 500.0, "z_mm": 540.0},
    "backdrop": {"z_mm": 2000.0},
    "planes_mm": [540.0, 620.0],
    "mitsuba": {"file": "a.xml", "unit_mm": 2.0, "camera": "front", "fit_mm": 9.0},
}
PLAIN = {"title": "even light", "lights": [{"type": "uniform", "luminance_cd_m2": 100.0}]}
PLACED = PLAIN | {"mitsuba": {"file": "a.xml", "place_at_mm": [0.0, 0.0, 500.0]}}
RECIPE = {
    "scene": "here",
    "grid": {"rows": 2, "cols": 3, "errors": {}},
    "sensor": {"camera": "a.csv", "bits": 8},
    "photons": {"budget": 500.0, "nested": [100.0, 200.0]},
    "analysis": {"z_mm": [500.0], "z_range_mm": [400.0, 700.0]},
    "products": {"view_truth": ["z_mm"]},
    "render": {"background_samples_per_pixel": 4},
}
EXPOSED = {
    "scene": "here",
    "grid": {"lens": {"aperture_mm": 6.25, "focus_mm": 600.0}},
    "sensor": {"full_light": {}},
    "photons": {"scope": "exposure"},
    "exposure": {"f_number": 8.0, "time_s": 0.01},
}
BASES = [(RECIPE, SCENE), (EXPOSED, PLACED), ({"scene": "drawn_room", "scene_number": 17}, PLAIN)]
OTHER = {
    "here": "there",
    "drawn_room": "drawn_plain",
    "a.csv": "b.csv",
    "D65": "A",
    "dark skin": "blue sky",
}
"""Other names for those that must be known."""
NOT_DATA = ("publication",)
"""Terms under which data are published; other terms make no other data."""


@pytest.fixture
def near(tmp_path: Path) -> Path:
    """Folder of a recipe, with two folders for scenes that have the same files."""
    for folder in ("here", "there"):
        (tmp_path / folder).mkdir()
        for name in ("a.png", "b.png", "a.ply", "b.ply", "a.exr", "b.exr"):
            (tmp_path / folder / name).write_bytes(b"nobody decodes this, and every byte counts")
        for name in ("a.xml", "b.xml"):
            (tmp_path / folder / name).write_text('<scene version="3.0.0"/>')
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("wavelength_nm,R,G,B\n400,0,0,1\n550,0,1,0\n700,1,0,0\n")
    return tmp_path


def identity(near: Path, recipe: Table, scene: Table) -> str:
    for folder in ("here", "there"):
        (near / folder / "scene.toml").write_text(tomli_w.dumps(without_none(scene)))
    return prepare(Recipe.model_validate(recipe), near).identity


def without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    return [without_none(item) for item in value] if isinstance(value, list | tuple) else value


def models_of(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from models_of(part)


def all_fields(model: type[BaseModel], known: set[Field]) -> set[Field]:
    """Every field of a model and of the models in it, but for tags: another tag is another table."""
    for name, field in model.model_fields.items():
        is_tag = get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
        if (model, name) not in known and not is_tag:
            known.add((model, name))
            for inner in models_of(field.annotation):
                all_fields(inner, known)
    return known


def values_in(value: Any, path: tuple[Any, ...], owners: tuple[Field, ...]) -> Iterator[tuple[Any, ...]]:
    """Path, fields and value of all that a model holds; the fields are those that the value lies in."""
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from values_in(getattr(value, name), (*path, name), (*owners, (type(value), name)))
    else:
        yield path, owners, value
        if isinstance(value, tuple):
            for number, item in enumerate(value):
                yield from values_in(item, (*path, number), owners)


def others(value: Any, owner: Field) -> Iterator[Any]:
    """Other values that the field may take."""
    model, name = owner
    annotation = model.model_fields[name].annotation
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, AssetName):
        yield f"b{Path(value).suffix}"
    elif isinstance(value, str):
        if value in OTHER:
            yield OTHER[value]
        yield from (choice for part in (annotation, *get_args(annotation)) for choice in get_args(part))
        yield f"{value}x"
    elif isinstance(value, int):
        yield from (value + 1, value - 1)
    elif isinstance(value, float):
        yield from (value * 1.001, value + 0.001, value - 0.001, value / 2)
    elif isinstance(value, tuple):
        yield from (value[:-1], value[1:])


def with_value(values: Table, path: tuple[Any, ...], value: Any) -> Table:
    copy = deepcopy(values)
    target: Any = copy
    for step in path[:-1]:
        target = target[step]
    target[path[-1]] = value
    return copy


def changed(model: type[BaseModel], values: Table, path: tuple[Any, ...], other: Any) -> Table | None:
    """The values with another one at this path, None if that is not valid or means the same."""
    try:
        new = model.model_validate(with_value(values, path, other))
    except (ValueError, InputError):
        return None
    dumped = new.model_dump(mode="json")
    return None if dumped == values else dumped


def test_every_field_of_recipe_and_scene_is_part_of_the_identity(near: Path) -> None:
    reached: set[Field] = set()
    for base in BASES:
        filled = [model.model_validate(values) for model, values in zip((Recipe, Scene), base, strict=True)]
        dumps = [model.model_dump(mode="json") for model in filled]
        before = identity(near, *dumps)
        is_used = [True, base[0]["scene"] == "here"]
        for which in (number for number in (0, 1) if is_used[number]):
            for path, owners, value in values_in(filled[which], (), ()):
                tried = (
                    changed(type(filled[which]), dumps[which], path, o) for o in others(value, owners[-1])
                )
                new = next((each for each in tried if each is not None), None)
                if new is not None:
                    after = identity(near, *(new if number == which else dumps[number] for number in (0, 1)))
                    assert (after == before) == (path[0] in NOT_DATA), path
                    reached.update(owners)
    missed = all_fields(Recipe, set()) | all_fields(Scene, set())
    assert {f"{model.__name__}.{name}" for model, name in missed - reached} == set()


def test_every_byte_of_a_scenes_files_is_part_of_the_identity(near: Path) -> None:
    before = identity(near, RECIPE, SCENE)
    for name in ("a.png", "a.ply", "a.exr"):
        file = near / "here" / name
        whole = file.read_bytes()
        for place in range(len(whole)):
            file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
            assert prepare(Recipe.model_validate(RECIPE), near).identity != before
        file.write_bytes(whole)
    (near / "here" / "unnamed.png").write_bytes(b"that the scene does not name")
    assert prepare(Recipe.model_validate(RECIPE), near).identity == before
    (near / "a.csv").write_text((near / "a.csv").read_text().replace("550,0,1,0", "550,0,1,0.01"))
    assert prepare(Recipe.model_validate(RECIPE), near).identity != before


@pytest.mark.parametrize("package", ["photon-integral-imaging", "mitsuba"])
def test_versions_are_part_of_the_identity(near: Path, monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    before, original = identity(near, RECIPE, SCENE), software.version
    monkeypatch.setattr(software, "version", lambda name: "0.0.1" if name == package else original(name))
    assert identity(near, RECIPE, SCENE) != before


ONE_WAY = """scene = "here"
[photons]
budget = 300
[grid]
rows = 2
cols = 3
pitch_mm = [5, 5.0]
"""
ANOTHER = """# the same,   otherwise written
title     = ""
seed=0
grid = { cols=3, rows=2, height = 1024 }

    scene = 'here'
photons.statistics = "poisson"
photons.budget     = 3.0e2 # photons
"""


def test_how_a_recipe_and_a_scene_are_written_changes_nothing(near: Path) -> None:
    scene = PLAIN | {"backdrop": {"z_mm": 900, "reflectance": "dark skin"}}
    text = (
        "# comment\n[backdrop]\nreflectance = 'dark skin'\nhalf_width_mm = 5e3\nz_mm = 900.0\n"
        "[[lights]]\nilluminant = 'D65'\nluminance_cd_m2 = 100\ntype = 'uniform'\n"
    )
    before = identity(near, tomllib.loads(ONE_WAY), scene)
    assert identity(near, tomllib.loads(ANOTHER), scene) == before
    (near / "here" / "scene.toml").write_text(f"title = 'even light'\nobjects = []\n{text}")
    assert prepare(Recipe.model_validate(tomllib.loads(ANOTHER)), near).identity == before


def test_defaults_may_be_written_out_in_every_recipe_that_ships() -> None:
    files = [file for root in recipe_roots() for file in root.glob("*.toml")]
    assert len(files) > 20
    for file in files:
        recipe, near = load_recipe(str(file))
        prepared = prepare(recipe, near)
        written = tomli_w.dumps(without_none(recipe.model_dump(mode="json")))
        assert prepare(Recipe.model_validate(tomllib.loads(written)), near).identity == prepared.identity
        scene = tomli_w.dumps(without_none(prepared.scene.model_dump(mode="json")))
        assert Scene.model_validate(tomllib.loads(scene)) == prepared.scene
