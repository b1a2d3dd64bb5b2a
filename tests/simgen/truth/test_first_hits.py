"""Simulation against first principles: where things appear, and how deep they are."""

from pathlib import Path

import numpy as np
import pytest
from lit_scenes import ball, built, card, grid
from PIL import Image

from pcii.sections import reconstruct
from pcii.types import Views, project_px
from simgen.renderer import render_view
from simgen.truth import first_hits_at_centre

pytestmark = pytest.mark.renders


@pytest.mark.parametrize("point", [(0.0, 0.0, 500.0), (60.0, -25.0, 600.0)])
def test_a_dot_appears_where_geometry_says(point: tuple[float, float, float]) -> None:
    # The dot is a card parallel to the sensor: its image is a square about its centre's image, evenly
    # lit (a ball's would be shaded, and pull the centroid). Its 20 pixels of 128 samples leave noise of
    # about 1.4 px x 0.6 / sqrt(2500) = 0.02 px.
    cameras = grid(2, 3, 100, 130, pixel_mm=0.1408)
    scene = built([card("dot", point[2], 8.0, at_mm=point[:2])])
    for k, l in ((0, 0), (0, 2), (1, 1)):
        image = render_view(scene, cameras, k, l, samples_per_pixel=128, seed=11).sum(axis=2)
        i, j = np.indices(image.shape)
        found = np.array([(i * image).sum(), (j * image).sum()]) / image.sum()
        expected = np.array(project_px(cameras, point, k, l))
        np.testing.assert_allclose(found, expected, atol=0.08)
        mirrored = project_px(cameras, point, 1 - k, 2 - l)  # the fault: signs of both axes swapped
        if (k, l) != (1, 1):
            assert np.abs(found - mirrored).max() > 1


def test_a_plane_is_sharpest_at_its_depth(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    noise = rng.integers(0, 256, (64, 64, 3), dtype=np.uint8)
    Image.fromarray(noise).resize((512, 512), Image.Resampling.NEAREST).save(tmp_path / "noise.png")
    cameras = grid(3, 3, 128, 160)
    scene = built([card("card", 600.0, 160.0, texture="noise.png")], folder=tmp_path)
    views = np.stack(
        [
            [render_view(scene, cameras, k, l, samples_per_pixel=4, seed=9 * k + l) for l in range(3)]
            for k in range(3)
        ]
    )
    depths = [500.0, 550.0, 600.0, 650.0, 700.0]
    sections = reconstruct(Views(views, cameras), depths)
    middle = sections.estimate[:, 40:90, 50:110]
    assert depths[int(np.argmax(middle.var(axis=(1, 2)).sum(axis=1)))] == 600.0


def test_each_object_keeps_its_own_id_and_the_backdrop_is_none() -> None:
    # Compiled backends number shapes in no fixed order, so several shapes and a second scene matter.
    places = [(-60.0, 0.0), (-20.0, 30.0), (20.0, -30.0), (60.0, 0.0)]
    cameras = grid(1, 1, 160, 200)
    for z in (500.0, 640.0):
        objects = [ball(f"s{n}", x, z + n, radius_mm=9.0, y_mm=y) for n, (x, y) in enumerate(places)]
        hits = first_hits_at_centre(built(objects), cameras)
        for n, (x, y) in enumerate(places):
            i, j = project_px(cameras, (x, y, z + n), 0, 0)
            assert hits.object_id[round(i), round(j)] == n + 1
        assert hits.object_id[0, 0] == 0
        assert hits.z_mm[0, 0] == pytest.approx(3000.0, rel=1e-5)
