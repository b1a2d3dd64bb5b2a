"""Scenes that are drawn for training: simgen takes them, and their meshes are turned outwards."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from random import Random

import numpy as np
import pytest

import simgen
from simgen.assets import read_mesh
from training import mesh_shapes
from training.more_scenes import GAP_PX, TOTAL_PX_MM

FILE = Path(mesh_shapes.__file__).with_name("more_scenes.py")
KINDS = "furnished", "heap", "pickets", "plain_pair", "leaning", "glazed", "meshes", "empty_wall"


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_the_same_each_time_and_its_planes_are_apart(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mesh_shapes, "FOLDER", tmp_path)
    for number in range(3):
        scene = simgen.load_scene(f"{FILE}:{kind}", number)
        assert scene == simgen.load_scene(f"{FILE}:{kind}", number)
        assert scene.objects
        assert scene.planes_mm
        assert all(440 <= plane <= 800 for plane in scene.planes_mm)
        totals = [TOTAL_PX_MM / plane for plane in scene.planes_mm]
        # Depths are whole millimetres, up to 0.17 px; the back wall of a room may be nearer to what stands.
        gaps = [near - far for near, far in pairwise(totals)]
        assert all(gap >= (2.0 if kind == "furnished" else GAP_PX[0] - 0.2) for gap in gaps)


@pytest.mark.parametrize("make", [mesh_shapes.blob, mesh_shapes.head, mesh_shapes.spindle, mesh_shapes.tube])
def test_faces_of_meshes_are_turned_outwards(
    make: Callable[[Random], np.ndarray], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mesh_shapes, "FOLDER", tmp_path)
    for number in range(6):
        shape = mesh_shapes.mesh_of(make(Random(number)), 30.0)
        mesh = read_mesh(tmp_path / shape["file"])
        a, b, c = np.moveaxis(mesh.positions[mesh.faces], 1, 0)
        # Six times the volume of a closed surface whose corners run as those of a box do.
        assert np.einsum("nc,nc->n", a, np.cross(b, c)).sum() > 0
