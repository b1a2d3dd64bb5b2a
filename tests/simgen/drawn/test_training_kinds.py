"""Scenes to train on: the same each time, their meshes turned outwards, and apart from scenes that judge."""

import hashlib
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from random import Random

import numpy as np
import pytest

import simgen
from simgen.assets import read_mesh
from simgen.drawn import FIRST_UNSEEN, GAP_PX, TOTAL_PX_MM, blob, head, mesh_folder, mesh_of, spindle, tube

ROOT = Path(__file__).resolve().parents[3]
MODULE = "simgen.drawn.training_kinds"
KINDS = "furnished", "heap", "pickets", "plain_pair", "leaning", "glazed", "meshes", "empty_wall"
# Of the scenes 0 to 4 of kinds without meshes, whose names follow from sines, which differ between machines.
HASHES = {
    "assorted": "a4576bbba94f7b4c",
    "screens": "9656bb6c91284567",
    "furnished": "63431fcc8ce4411f",
    "plain_pair": "a9e1fe574dc14fde",
    "leaning": "74a445979c3ed09a",
    "glazed": "4f98a32ad1a24019",
    "empty_wall": "344c5521f28376c0",
}


@pytest.fixture(autouse=True)
def meshes_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_the_same_each_time_and_its_planes_are_apart(kind: str) -> None:
    for number in range(3):
        scene = simgen.load_scene(f"{MODULE}:{kind}", number)
        assert scene == simgen.load_scene(f"{MODULE}:{kind}", number)
        assert scene.objects
        assert scene.planes_mm
        assert all(440 <= plane <= 800 for plane in scene.planes_mm)
        totals = [TOTAL_PX_MM / plane for plane in scene.planes_mm]
        # Depths are whole millimetres, up to 0.17 px; the back wall of a room may be nearer to what stands.
        gaps = [near - far for near, far in pairwise(totals)]
        assert all(gap >= (2.0 if kind == "furnished" else GAP_PX[0] - 0.2) for gap in gaps)


@pytest.mark.parametrize("kind", HASHES)
def test_a_number_gives_the_same_scene_for_all_time(kind: str) -> None:
    scenes = [simgen.load_scene(f"{MODULE}:{kind}", number) for number in range(5)]
    text = "".join(scene.model_dump_json(exclude={"folder"}) for scene in scenes)
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == HASHES[kind]


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
            assert 0 <= first < end <= FIRST_UNSEEN or points[name].startswith(f"{MODULE}:")
    for recipe in read_tables("data_recipes/*.toml"):
        assert not str(recipe["scene"]).startswith("training_")
    for scene in [each for table in read_tables("data_recipes/benchmarks/*.toml") for each in table["scene"]]:
        values = dict(field.split("=") for field in scene.get("set", ()))
        assert not values.get("scene", "").startswith("training_")
        assert int(values.get("scene_number", FIRST_UNSEEN)) >= FIRST_UNSEEN
