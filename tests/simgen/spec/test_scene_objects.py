"""Scenes as objects and as folders: faults read as those of files, changes give checked copies, and what is
saved and loaded is the same."""

import copy
import pickle
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import simgen
from pcii.base import InputError
from simgen import Material, Scene, SceneObject, Spectrum, Sphere, load_scene
from simgen.base import LARGEST_TOML_BYTES, toml_text, validate
from simgen.spec import MitsubaFile, scene_names

RED = Material(reflectance=(0.8, 0.1, 0.1))
BALL = SceneObject(name="ball", position_mm=(10, 0, 540), shape=Sphere(radius_mm=30), material=RED)
PANE = simgen.Card(width_mm=9, height_mm=8)
CARD = SceneObject(name="card", position_mm=(0, 5, 620), shape=PANE, material=RED)
SKY = simgen.UniformLight(luminance_cd_m2=100)
SCENE = Scene(title="Two things", objects=(BALL, CARD), lights=(SKY,), planes_mm=(540,))
WITH_FILE = SCENE.replace("ball", material=Material(texture="a.png"))
BOX: Any = simgen.Box(width_mm=1, height_mm=1, depth_mm=1)


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
        (lambda: Material(finish=simgen.Glass(), texture="a.png"), "Material: texture: the colour of glass"),
        (lambda: Spectrum(wavelength_nm=(400, 500), value=(0.5,)), "Spectrum: give as many values"),
        (lambda: Scene(title="x", lights=()), "Scene: 'lights': nothing shines"),
        (lambda: setattr(BALL, "name", "b"), "SceneObject: 'name': instance is frozen"),
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


def test_unknown_and_missing_arguments_are_named_with_the_nearest_known_one() -> None:
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
    """Constructors of models in a table are not called, or the fault would name them alone."""
    thing = BALL.model_dump() | {"shape": {"type": "sphere", "radius_mm": 0}}
    values = {"title": "x", "lights": [SKY], "objects": [thing]}
    fault = "'objects[0].shape.radius_mm': input should be greater than or equal to 0.000001, got 0"
    assert fault_of(lambda: validate(Scene, values, "scene.toml")) == f"scene.toml: {fault}"
    assert fault_of(lambda: Scene(**values)) == f"Scene: {fault}"


def test_each_change_is_a_new_checked_scene() -> None:
    lamp = simgen.PointLight(position_mm=(0, -300, 300), intensity_cd=5)
    more = SCENE.add(BALL.change(name="other"), lamp)
    assert [thing.name for thing in more.objects] == ["ball", "card", "other"]
    assert more.lights == (SKY, lamp)
    assert [thing.name for thing in SCENE.remove("ball").objects] == ["card"]
    swapped = SCENE.replace("ball", CARD.change(name="second"))
    assert [thing.name for thing in swapped.objects] == ["second", "card"]
    assert SCENE.replace("ball", name="marble").object("marble") == BALL.change(name="marble")
    lit = SCENE.change(lights=(lamp,), backdrop=simgen.Backdrop(z_mm=900))
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


def same(loaded: Scene, scene: Scene) -> bool:
    """To the digit: 0.0 and -0.0 are equal, and not the same."""
    return loaded == scene and loaded.model_dump_json() == scene.model_dump_json()


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_that_ships_is_the_same_once_saved_and_loaded(name: str, tmp_path: Path) -> None:
    scene = load_scene(name)
    file = scene.save(tmp_path / "new" / name)
    loaded = load_scene(file)
    assert same(loaded, scene)
    assert loaded.folder == file.parent
    assert same(Scene.model_validate(tomllib.loads(toml_text(scene, ["a", "b"]))), scene)


@pytest.mark.parametrize("words", ['"""', "\\", "a\r\nb", "\n\n", '\\"\n"', "\x7f\x00\t", "''' é\n"])
def test_words_are_the_same_once_saved_and_loaded(words: str, tmp_path: Path) -> None:
    scene = SCENE.change(description=words)
    assert same(load_scene(scene.save(tmp_path)), scene)
    within = Scene(title="x", mitsuba=MitsubaFile(file="x.xml", unscored=(words,)))
    assert same(Scene.model_validate(tomllib.loads(toml_text(within))), within)


def test_files_go_along_and_saving_again_changes_nothing(tmp_path: Path) -> None:
    source, out = tmp_path / "source", tmp_path / "out"
    (source / "art").mkdir(parents=True)
    (source / "a.png").write_bytes(b"first")
    (source / "art" / "b.png").write_bytes(b"second")
    scene = WITH_FILE.replace("card", material=Material(texture="art/b.png")).change(folder=source)
    (out / "mine").mkdir(parents=True)
    scene.save(out)
    files = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
    assert {file.relative_to(out).as_posix() for file in files} == {"a.png", "art/b.png", "scene.toml"}
    assert (out / "art" / "b.png").read_bytes() == b"second"
    scene.save(out)
    assert {file: file.read_bytes() for file in files} == files
    assert (out / "mine").is_dir()


@pytest.mark.parametrize("name", ["scene.toml", "a.png"])
def test_what_is_there_is_kept_unless_it_may_be_overwritten(name: str, tmp_path: Path) -> None:
    source, out = tmp_path / "source", tmp_path / "out"
    source.mkdir()
    out.mkdir()
    (source / "a.png").write_bytes(b"new")
    (out / name).write_bytes(b"mine")
    scene = WITH_FILE.change(folder=source)
    with pytest.raises(InputError, match=rf"^{out / name}: is there with other content; .* overwrite=True$"):
        scene.save(out)
    assert [(file.name, file.read_bytes()) for file in out.iterdir()] == [(name, b"mine")]
    scene.save(out, overwrite=True)
    assert load_scene(out) == scene
    assert (out / "a.png").read_bytes() == b"new"


def test_a_scene_that_cannot_be_saved_writes_nothing(tmp_path: Path) -> None:
    file, out = tmp_path / "file", tmp_path / "out"
    file.write_text("mine")
    with pytest.raises(InputError, match=r"file: this is a file; name a folder for the scene"):
        SCENE.save(file)
    with pytest.raises(InputError, match=r"^scene: object 'ball', material.texture: there is no file 'a.p"):
        WITH_FILE.change(folder=tmp_path).save(out)
    wavelength_nm = tuple(380 + 0.1234567 * n for n in range(2000))
    spectrum = Spectrum(wavelength_nm=wavelength_nm, value=(1 / 3,) * 2000)
    rainbow = BALL.change(material=Material(reflectance=spectrum))
    with pytest.raises(InputError, match=rf"a scene.toml may have {LARGEST_TOML_BYTES} bytes, and this"):
        SCENE.add(*(rainbow.change(name=f"a{n}") for n in range(10))).save(out)
    assert not out.exists()
