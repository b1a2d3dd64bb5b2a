"""Bodies of shapes, against points of their surface turned by another library."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from surface_points import SHAPES, surface_points

from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.spec.bodies import body_of
from simgen.spec.scene import load_scene
from simgen.spec.shapes import Mesh


@pytest.mark.parametrize("kind", SHAPES)
def test_a_body_reaches_as_far_as_its_surface(kind: str) -> None:
    shape, points = SHAPES[kind], surface_points(SHAPES[kind])
    for turned in ((0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (25.0, -70.0, 130.0), (-160.0, 33.0, 8.0)):
        body = body_of(shape, (1.0, 2.0, 500.0), turned)
        assert body is not None
        placed = Rotation.from_euler("xyz", turned, degrees=True).apply(points)
        assert body.reach_mm == pytest.approx(placed.max(axis=0), rel=1e-4, abs=1e-4)
        assert body.radius_mm == pytest.approx(np.linalg.norm(points, axis=1).max(), rel=1e-6)
    assert body_of(Mesh(file="a.ply"), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) is None  # type: ignore[arg-type]


@pytest.mark.renders
@pytest.mark.parametrize("name", ["drawn_solids", "drawn_shiny"])
def test_a_body_has_the_renderers_bounding_box(name: str) -> None:
    scene, folder = load_scene(name, number=3)
    built = build(backend.load(), scene, folder, 2)
    numbers = backend.shape_numbers(built.scene)
    for number, shape in zip(numbers, built.scene.shapes(), strict=True):
        position = int(built.object_of_shape[number]) - 1
        if position >= 0:
            thing = scene.objects[position]
            body = body_of(thing.shape, thing.position_mm, thing.rotation_deg)
            assert body is not None
            box = np.array([np.ravel(shape.bbox().min), np.ravel(shape.bbox().max)])
            # float32 keeps 1000 mm to 6e-5 mm; the chords of a cylinder come within 5e-6 of its radius.
            assert box[0] == pytest.approx(np.subtract(body.centre_mm, body.reach_mm), abs=1e-3), thing.name
            assert box[1] == pytest.approx(np.add(body.centre_mm, body.reach_mm), abs=1e-3), thing.name
