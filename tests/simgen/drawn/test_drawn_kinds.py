"""Scenes that Python draws: the same for all time, and those of other packages."""

import hashlib
import json
import random
from pathlib import Path

import pytest

import simgen
from pcii.base import InputError
from simgen.dataset import prepare
from simgen.spec import Recipe, drawn_scenes, is_drawn, load_scene, load_sweep

NUMBERS = (0, 1, 7, 17, 99, 100, 101, 102, 103, 250)
# SHA-256 of the scenes of these numbers. A change of one makes figures that were reported of other scenes.
HASHES = {
    "plain": "9168331b9adbcb66474b55887aa9ac7e3f28caf03fce3d6ef1e10e87006a5cc6",
    "textured": "17e254992471c9c6ee779b3473bcc98415e442b955521afd7ec47977d7b04dd6",
    "cards": "baffea38a94ab7fc9da02cc734fd5fc9e2cac96c4887940056f3e9d891575994",
    "room": "18b4ed00723127f8b20155095abb18d9b4b73453448d720067eb97d2eef25524",
    "crossing": "6c3659fb2ec512ebded584988934a84f598613d396c16ec8825df8585bfb5709",
    "leaves": "89a261e515dc5307acd05463a3b1c544123f68383ed826a95165d530b2f1a90f",
    "checks": "2790e52bb4469cf7ce2bc4eaf9aedcf2f074af071aefb0459c746a22a9f7c147",
    "shiny": "b1122c93065538cf10d4331faa16acb367f2a5dcbca230a5a4332f2b8d44eb8b",
}
CODE = """
import simgen

def good(random):
    light = simgen.UniformLight(luminance_cd_m2=1.0 + random.randrange(100))
    card = simgen.Card(width_mm=9.0, height_mm=9.0)
    thing = simgen.SceneObject(
        name="thing", position_mm=(0, 0, 500), shape=card, material=simgen.Material(texture="label.png")
    )
    return simgen.Scene(title="Strange", lights=(light,), objects=(thing,))

def failing(random):
    return good(1 // 0)

def text(random):
    return "a scene"
"""


def content_hash(kind: str, number: int) -> str:
    prepared = prepare(Recipe(scene=f"drawn_{kind}", scene_number=number), None)
    analysis = prepared.recipe.analysis
    # What scenes could not hold when the hashes were made, and these do not.
    later = {"normal_map", "tiled", "opacity", "emission"}
    assert not any(later & thing.material.model_fields_set for thing in prepared.scene.objects)
    newer = {"planes_mm": True, "objects": {"__all__": {"material": later}}}
    text = prepared.scene.model_dump_json(exclude=newer)
    return hashlib.sha256((text + json.dumps([analysis.z_mm, analysis.z_range_mm])).encode()).hexdigest()


@pytest.mark.parametrize("kind", HASHES)
def test_a_number_gives_the_same_scene_for_all_time(kind: str) -> None:
    hashes = [content_hash(kind, number) for number in NUMBERS]
    assert len(set(hashes)) == len(NUMBERS)
    assert hashlib.sha256("".join(hashes).encode()).hexdigest() == HASHES[kind]


@pytest.mark.parametrize("name", ["drawn_solids", "drawn_foliage"])
def test_a_scene_is_the_same_whatever_was_drawn_before(name: str) -> None:
    scene = load_scene(name, number=3)
    random.seed(1)
    random.random()
    assert load_scene(name, number=3) == scene
    assert load_scene(name, number=4) != scene
    assert is_drawn(name)


def test_solids_on_the_desk_stand_and_do_not_touch() -> None:
    for number in range(20):
        scene = load_scene("drawn_solids", number=number)
        standing = [thing for thing in scene.objects if thing.name not in ("desk", "wall")]
        assert {"ball", "tin", "block-1"} <= {thing.name for thing in standing}
        for thing in standing:
            match thing.shape:
                case simgen.Sphere(radius_mm=radius):
                    height = 2 * radius
                case simgen.Cylinder(length_mm=height) | simgen.Box(height_mm=height):
                    pass
                case _:
                    pytest.fail(f"{thing.name} is a {thing.shape.type}")
            assert thing.position_mm[1] + height / 2 == pytest.approx(65, abs=0.2)


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, points: dict[str, str]) -> None:
    """Put a package `strange` with these entry points on the path."""
    about = folder / "strange-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.0\n")
    lines = [f"{name} = {value}\n" for name, value in points.items()]
    (about / "entry_points.txt").write_text("[simgen.scenes]\n" + "".join(lines))
    (folder / "strange_scenes.py").write_text(CODE)
    (folder / "label.png").write_bytes(b"not looked at")
    monkeypatch.syspath_prepend(str(folder))


def test_scenes_of_another_package_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = {name: f"strange_scenes:{name}" for name in ("good", "failing", "text")}
    install(tmp_path, monkeypatch, points)
    assert drawn_scenes()["good"] == "the package strange"
    scene = load_scene("good", number=4)
    drawn = random.Random("good 4").randrange(100)
    assert scene.lights[0].luminance_cd_m2 == 1 + drawn  # type: ignore[union-attr]
    assert scene.title == "Strange 4"
    assert scene.folder == tmp_path  # where the files are that the scene names
    with pytest.raises(InputError, match=r"^scene: 'failing' cannot be drawn: ZeroDivisionError"):
        load_scene("failing", number=4)
    with pytest.raises(InputError, match=r"^scene: 'text' must return a simgen.Scene, not str$"):
        load_scene("text", number=4)


def test_a_name_that_two_packages_register_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, monkeypatch, {"drawn_room": "strange_scenes:good"})
    with pytest.raises(InputError, match="needs another name than 'drawn_room'"):
        drawn_scenes()


def test_a_number_is_required_for_drawn_scenes_and_refused_for_others() -> None:
    for number in (None, -1, 1 << 63, True):
        with pytest.raises(InputError, match="from 0 to"):
            load_scene("drawn_room", number=number)
    with pytest.raises(InputError, match=r"^scene_number: .*desk.* leave it out$"):
        load_scene("desk", number=0)


def test_python_named_in_a_recipe_file_runs_only_if_its_author_is_trusted(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CODE)
    (tmp_path / "label.png").write_bytes(b"not looked at")
    recipe = tmp_path / "recipe.toml"
    for named in ('"mine.py:good"', '["desk", "mine.py:good"]'):
        recipe.write_text(f"scene = {named}\nscene_number = 2\n")
        with pytest.raises(InputError, match="--trust-python"):
            load_sweep(str(recipe))
    recipe.write_text('scene = "mine.py:good"\nscene_number = 2\n')
    trusted = load_sweep(str(recipe), trust_python=True)
    assert prepare(trusted.recipe(0), trusted.recipe_folder).scene.title == "Strange 2"
    # What the person types is trusted, as any command is.
    assert load_scene(f"{tmp_path / 'mine.py'}:good", number=2).title == "Strange 2"
