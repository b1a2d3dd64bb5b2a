"""Scenes that Python draws: the same for all time, and those of other packages."""

import hashlib
import json
import random
import tomllib
from pathlib import Path

import pytest

from pcii.base.errors import InputError
from simgen.dataset.prepared import prepare
from simgen.drawn import GENERATORS
from simgen.spec.recipe import Recipe
from simgen.spec.scene import is_scene_distribution, load_scene
from simgen.spec.scene_generators import GROUP, generators

ROOT = Path(__file__).resolve().parents[3]
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
def good(number):
    light = {"type": "uniform", "luminance_cd_m2": 1.0 + number}
    card = {"type": "card", "width_mm": 9.0, "height_mm": 9.0}
    material = {"texture": "label.png"}
    thing = {"name": "thing", "position_mm": [0.0, 0.0, 500.0], "shape": card, "material": material}
    return {"title": "Strange", "lights": [light], "objects": [thing]}

def failing(number):
    return good(1 // 0)

def text(number):
    return "a scene"

def wrong(number):
    return {"title": "Strange", "lights": []}
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


@pytest.mark.parametrize("name", GENERATORS)
def test_a_generator_gives_plain_values_whatever_was_drawn_before(name: str) -> None:
    values = GENERATORS[name](3)
    assert json.loads(json.dumps(values)) == values  # as TOML holds them: no tuples
    random.seed(1)
    random.random()
    assert GENERATORS[name](3) == values
    assert is_scene_distribution(name)


def test_the_package_offers_the_generators_that_it_finds_by_itself() -> None:
    offered = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"][GROUP]
    assert offered == {name: f"{own.__module__}:{own.__name__}" for name, own in GENERATORS.items()}


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, points: dict[str, str]) -> None:
    """Put a package `strange` with these entry points on the path."""
    about = folder / "strange-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.0\n")
    lines = [f"{name} = {value}\n" for name, value in points.items()]
    (about / "entry_points.txt").write_text(f"[{GROUP}]\n" + "".join(lines))
    (folder / "strange_scenes.py").write_text(CODE)
    (folder / "label.png").write_bytes(b"not looked at")
    monkeypatch.syspath_prepend(str(folder))


def test_scenes_of_another_package_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = {"drawn_room": "simgen.drawn.clutter:drawn_room"}  # what the project itself registers
    points = {name: f"strange_scenes:{name}" for name in ("good", "failing", "text", "wrong")}
    install(tmp_path, monkeypatch, points | {"missing": "strange_scenes:nothing"} | own)
    assert generators()["good"] == "Made by the package strange."
    scene, folder = load_scene("good", number=4)
    assert scene.lights[0].luminance_cd_m2 == 5  # type: ignore[union-attr]
    assert folder == tmp_path  # where the files are that the scene names
    with pytest.raises(InputError, match=r"^scene: 'failing' of the package strange .*ZeroDivisionError"):
        load_scene("failing", number=4)
    with pytest.raises(InputError, match=r"^scene: 'text' of the package strange must return .* not str$"):
        load_scene("text", number=4)
    with pytest.raises(InputError, match=r"^scene: 'missing' of the package strange .*AttributeError"):
        load_scene("missing", number=4)
    with pytest.raises(InputError, match=r"^wrong, draw 4: 'lights'"):
        load_scene("wrong", number=4)


@pytest.mark.parametrize(
    ("points", "complaint"),
    [
        ({"drawn_room": "strange_scenes:good"}, "takes the name of the built-in 'drawn_room'"),
        ({"a/b": "strange_scenes:good"}, "use letters"),
    ],
)
def test_names_that_cannot_be_used_are_refused(
    points: dict[str, str], complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, monkeypatch, points)
    with pytest.raises(InputError, match=complaint):
        generators()


def test_a_number_is_asked_for_and_refused_where_there_is_nothing_to_draw() -> None:
    for name in ("drawn_room", "drawn_solids"):
        with pytest.raises(InputError, match=r"^scene_number: .* say which draw, such as scene_number = 0"):
            load_scene(name)
        for number in (-1, 1 << 63, True):
            with pytest.raises(InputError, match="from 0 to"):
                load_scene(name, number=number)
    with pytest.raises(InputError, match=r"^scene_number: .*desk.* leave it out$"):
        load_scene("desk", number=0)
