"""Scenes as objects: faults read as those of files, changes give checked copies, the folder is no value."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from two_things import BALL, CARD, SCENE, SKY

from pcii.base import InputError
from simgen import (
    AreaLight,
    Backdrop,
    Box,
    Checks,
    Glass,
    Level,
    Material,
    PointLight,
    Scene,
    SceneObject,
    Spectrum,
    Sphere,
)
from simgen.base import validate

CHECKS = Checks(rows=1, columns=2)
BOX: Any = Box(width_mm=1, height_mm=1, depth_mm=1)
LAMP = AreaLight(position_mm=(0, 0, 0), target_mm=(0, 0, 1), width_mm=1, height_mm=1, luminance_cd_m2=1)


def fault_of(make: Callable[[], Any]) -> str:
    with pytest.raises(InputError) as caught:
        make()
    assert caught.value.__cause__ is None
    assert caught.value.__context__ is None or caught.value.__suppress_context__  # nothing of pydantic's
    return str(caught.value)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: Sphere(radius_mm=-1), "Sphere: 'radius_mm': input should be greater than"),
        (lambda: Material(finish=Glass(), texture=CHECKS), "Material: texture: the colour of glass"),
        (lambda: Spectrum(wavelength_nm=(400, 500), value=(0.5,)), "Spectrum: give as many values"),
        (lambda: Level(illuminance_lux=float("nan"), z_mm=500), "Level: 'illuminance_lux': input should be"),
        (lambda: Scene(title="x", lights=()), "Scene: 'lights': nothing shines"),
        (lambda: setattr(BALL, "name", "b"), "SceneObject: 'name': instance is frozen"),
        (lambda: LAMP.change(target_mm=LAMP.position_mm), "AreaLight: target_mm: a lamp must face"),
        (lambda: SCENE.add(BALL), "Scene: 'objects': two objects are named 'ball'"),
        (lambda: SCENE.add(BOX), "Scene: 'lights[1].type': there is no 'box'; known are area"),
        (lambda: SCENE.replace("ball", radius_mm=3), "SceneObject: unknown key 'radius_mm'"),
        (lambda: SCENE.move("ball", by_mm=(1, 1)), "move: 'by_mm[2]' is missing"),
        (lambda: SCENE.move("bell"), "scene: there is no object 'bell'; did you mean 'ball'?"),
        (lambda: SCENE.remove("x"), "scene: there is no object 'x'; known are ball, card"),
    ],
)
def test_a_fault_in_python_is_one_sentence(make: Callable[[], Any], expected: str) -> None:
    assert fault_of(make).startswith(expected)


def test_unknown_and_missing_arguments_are_told_with_the_nearest_known_one() -> None:
    values: dict[str, Any] = {"titel": "x", "lights": [SKY]}
    assert fault_of(lambda: Scene(**values)) == "Scene: unknown key 'titel'; did you mean 'title'?"
    values = {"name": "x", "position_mm": (0, 0), "shape": {"type": "spere"}, "material": {"colour": 1}}
    with pytest.raises(InputError) as caught:
        SceneObject(**values)
    assert str(caught.value).startswith("SceneObject: unknown key 'material.colour'; known are ")
    assert caught.value.__notes__ == [
        "  'position_mm[2]' is missing",
        "  'shape.type': there is no 'spere'; did you mean 'sphere'?",
    ]


def test_a_fault_deep_in_a_table_keeps_its_place() -> None:
    """Constructors of models in a table are not called, or the fault would be told of them alone."""
    thing = {"name": "a", "position_mm": [0, 0, 1], "material": {"reflectance": [0, 0, 0]}}
    values = {
        "title": "x",
        "lights": [SKY],
        "objects": [thing | {"shape": {"type": "sphere", "radius_mm": 0}}],
    }
    told = "'objects[0].shape.radius_mm': input should be greater than or equal to 0.000001, got 0"
    assert fault_of(lambda: validate(Scene, values, "scene.toml")) == f"scene.toml: {told}"
    assert fault_of(lambda: Scene(**values)) == f"Scene: {told}"


def test_each_change_is_a_new_checked_scene() -> None:
    lamp = PointLight(position_mm=(0, -300, 300), intensity_cd=5)
    more = SCENE.add(BALL.change(name="other"), lamp)
    assert [thing.name for thing in more.objects] == ["ball", "card", "other"]
    assert more.lights == (SKY, lamp)
    assert [thing.name for thing in SCENE.remove("ball").objects] == ["card"]
    swapped = SCENE.replace("ball", CARD.change(name="second"))
    assert [thing.name for thing in swapped.objects] == ["second", "card"]
    assert SCENE.replace("ball", name="marble").object("marble") == BALL.change(name="marble")
    lit = SCENE.change(lights=(lamp,), backdrop=Backdrop(z_mm=900))
    assert (lit.lights, lit.objects) == ((lamp,), SCENE.objects)
    assert Scene(title="Two things", objects=(BALL, CARD), lights=(SKY,), planes_mm=(540,)) == SCENE


def test_an_object_is_moved_along_each_axis_and_turned() -> None:
    assert SCENE.move("ball", by_mm=(1, -2, 3)).object("ball").position_mm == (11, -2, 543)
    assert SCENE.move("ball", to_mm=(0, 0, 500)).object("ball").position_mm == (0, 0, 500)
    turned = SCENE.move("card", rotation_deg=(0, 15, 0)).move("card", rotation_deg=(0, 20, 0))
    assert turned == SCENE.replace("card", rotation_deg=(0, 20, 0))
    assert SCENE.move("card", rotation_deg=(0, 0, 9)).move("card", rotation_deg=(0, 0, 0)) == SCENE


def test_the_folder_goes_with_a_scene_and_is_no_part_of_its_value(tmp_path: Path) -> None:
    here = SCENE.change(folder=str(tmp_path))
    assert SCENE.folder is None
    for same in (here, copy.deepcopy(here), here.model_copy(), pickle.loads(pickle.dumps(here))):
        assert same.folder == tmp_path
        assert same == SCENE
        assert hash(same) == hash(SCENE)
        assert same.model_dump() == SCENE.model_dump()
        assert same.model_dump_json() == SCENE.model_dump_json()
    assert here.add(BALL.change(name="b")).move("b", by_mm=(1, 1, 1)).remove("b").folder == tmp_path
    assert here.change(folder=None).folder is None
    assert here.change(title="Other") != SCENE
    assert "folder" not in Scene.model_json_schema()["properties"]
    with pytest.raises(InputError, match=r"unknown key 'folder'"):
        validate(Scene, {"folder": "x", "title": "x", "lights": [SKY]}, "scene.toml")
