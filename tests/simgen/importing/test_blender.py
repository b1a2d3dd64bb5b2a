"""A scene that Blender exported, against the rays that Blender itself cast."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from pcii.types import CameraGrid
from simgen.importing import import_scene
from simgen.renderer import backend, build
from simgen.spec import load_scene
from simgen.truth import first_hits_at_centre

BY_BLENDER = Path(__file__).parent / "by_blender"
LARGEST_MM = 0.05


@pytest.mark.renders
def test_depth_and_objects_are_those_that_blender_sees(tmp_path: Path) -> None:
    said = import_scene(BY_BLENDER / "scene.glb", tmp_path / "scene")
    assert (said.objects, said.lights, said.camera, said.left_out) == (6, 2, "Cam", ())
    scene = load_scene(str(tmp_path / "scene"))
    casts = np.load(BY_BLENDER / "casts.npz")
    size = len(casts["z_mm"])
    grid = CameraGrid(
        rows=1, cols=1, pitch_mm=(1, 1), focal_mm=50, pixel_mm=36 / size, height=size, width=size
    )
    hits = first_hits_at_centre(build(backend.load(), scene, tmp_path / "scene", 2), grid)
    names = np.array(["", *(thing.name for thing in scene.objects)])
    theirs = np.char.replace(casts["name"], ".", "-")
    assert set(theirs.ravel()) == set(names)
    numbers = np.unique(theirs, return_inverse=True)[1].reshape(theirs.shape)
    inside = maximum_filter(numbers, 3) == minimum_filter(numbers, 3)
    assert inside.mean() > 0.8
    np.testing.assert_array_equal(names[hits.object_id][inside], theirs[inside])
    there = inside & np.isfinite(casts["z_mm"])
    assert np.abs(hits.z_mm[there] - casts["z_mm"][there]).max() < LARGEST_MM
    # The mirrored one has the mesh of the others.
    shapes = {thing.name: thing.shape for thing in scene.objects}
    files = {shapes[name].file for name in ("wedge", "turned", "mirrored")}  # type: ignore[union-attr]
    assert len(files) == 1
