"""Scenes that Python draws: the same for all time, those of other packages, and those to train on."""

import hashlib
import random
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from random import Random

import numpy as np
import pytest
from other_packages import install_package

import simgen
from pcii.base import InputError
from simgen.assets import read_mesh
from simgen.dataset import prepare
from simgen.drawn import FIRST_UNSEEN, GAP_PX, TOTAL_PX_MM, blob, head, mesh_folder, mesh_of, spindle, tube
from simgen.spec import drawn_scenes, is_drawn, load_scene, load_sweep

ROOT = Path(__file__).resolve().parents[3]
TRAINING = "simgen.drawn.training_kinds"
NUMBERS = (0, 1, 7, 17, 99, 100, 101, 102, 103, 250)
# SHA-256 of the scenes of these numbers. A change of one makes figures that were reported of other scenes.
# Kinds with meshes to train on are left out: their names follow from sines, which differ between machines.
HASHES = {
    "drawn_plain": "e1327003e27e13c7735abd2b0b2ce572",
    "drawn_textured": "df561420077a12ae81bd7ae2381d2837",
    "drawn_cards": "838220b19adbf195f9cb36703fdb0dca",
    "drawn_room": "2538a536d366bb2b470073c8fb150108",
    "drawn_crossing": "d37f5a8f5ab1400a3719daff8d0193f0",
    "drawn_leaves": "091ba255c93371ea31cda949488578cc",
    "drawn_checks": "ccff8426f25849be1992bf448e0b9ca3",
    "drawn_shiny": "cd50ce5de37f33e5dbef11628fa3c386",
    f"{TRAINING}:assorted": "a4576bbba94f7b4c",
    f"{TRAINING}:screens": "9656bb6c91284567",
    f"{TRAINING}:furnished": "63431fcc8ce4411f",
    f"{TRAINING}:plain_pair": "a9e1fe574dc14fde",
    f"{TRAINING}:leaning": "74a445979c3ed09a",
    f"{TRAINING}:glazed": "4f98a32ad1a24019",
    f"{TRAINING}:empty_wall": "344c5521f28376c0",
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


@pytest.fixture(autouse=True)
def meshes_apart(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


@pytest.mark.parametrize("kind", HASHES)
def test_a_number_gives_the_same_scene_for_all_time(kind: str) -> None:
    numbers = range(5) if kind.startswith(TRAINING) else NUMBERS
    texts = [load_scene(kind, number=number).model_dump_json(exclude={"folder"}) for number in numbers]
    assert len(set(texts)) == len(numbers)
    assert hashlib.sha256("".join(texts).encode()).hexdigest().startswith(HASHES[kind])


@pytest.mark.parametrize("name", ["drawn_solids", "drawn_foliage"])
def test_a_scene_is_the_same_whatever_was_drawn_before(name: str) -> None:
    scene = load_scene(name, number=3)
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


FILES = {"strange_scenes.py": CODE, "label.png": "not looked at"}


def test_scenes_of_another_package_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = {name: f"strange_scenes:{name}" for name in ("good", "failing", "text")}
    install_package(tmp_path, monkeypatch, {"simgen.scenes": points}, FILES)
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
    points = {"simgen.scenes": {"drawn_room": "strange_scenes:good"}}
    install_package(tmp_path, monkeypatch, points, FILES)
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


KINDS = "furnished", "heap", "pickets", "plain_pair", "leaning", "glazed", "meshes", "empty_wall"


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_the_same_each_time_and_its_planes_are_apart(kind: str) -> None:
    for number in range(3):
        scene = simgen.load_scene(f"{TRAINING}:{kind}", number)
        assert scene == simgen.load_scene(f"{TRAINING}:{kind}", number)
        assert scene.objects
        assert scene.planes_mm
        assert all(440 <= plane <= 800 for plane in scene.planes_mm)
        totals = [TOTAL_PX_MM / plane for plane in scene.planes_mm]
        # Depths are whole millimetres, up to 0.17 px; the back wall of a room may be nearer to what stands.
        gaps = [near - far for near, far in pairwise(totals)]
        assert all(gap >= (2.0 if kind == "furnished" else GAP_PX[0] - 0.2) for gap in gaps)


@pytest.mark.parametrize("make", [blob, head, spindle, tube])
def test_faces_of_meshes_are_turned_outwards(make: Callable[[Random], np.ndarray]) -> None:
    for number in range(6):
        shape = mesh_of(make(Random(number)), 30.0)
        mesh = read_mesh(mesh_folder() / shape["file"])
        a, b, c = np.moveaxis(mesh.positions[mesh.faces], 1, 0)
        # Six times the volume of a closed surface whose corners run as those of a box do.
        assert np.einsum("nc,nc->n", a, np.cross(b, c)).sum() > 0


def read_tables(*patterns: str) -> list[dict]:
    files = [file for pattern in patterns for file in ROOT.glob(pattern)]
    assert files
    return [tomllib.loads(file.read_text()) for file in files]


def test_training_has_other_scenes_than_what_methods_are_judged_on() -> None:
    (project,) = read_tables("pyproject.toml")
    points = project["project"]["entry-points"]["simgen.scenes"]
    for recipe in read_tables("training/recipes/*.toml"):
        first, end = recipe["scene_number"]["range"]
        for name in recipe["scene"]:
            assert name in points
            # Of the kinds that judge, training has numbers that are for tuning alone.
            assert 0 <= first < end <= FIRST_UNSEEN or points[name].startswith(f"{TRAINING}:")
    for recipe in read_tables("data_recipes/*.toml"):
        assert not str(recipe["scene"]).startswith("training_")
    for scene in [each for table in read_tables("data_recipes/benchmarks/*.toml") for each in table["scene"]]:
        values = dict(field.split("=") for field in scene.get("set", ()))
        assert not values.get("scene", "").startswith("training_")
        assert int(values.get("scene_number", FIRST_UNSEEN)) >= FIRST_UNSEEN
