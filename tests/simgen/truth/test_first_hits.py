"""Simulation against first principles: where things appear, and how deep they are."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from plain_scenes import built, card, grid, sphere

from pcii.core.geometry import project_px
from pcii.core.images import Views
from pcii.sections.reconstruction import reconstruct
from simgen.renderer.radiance import render_view
from simgen.truth.first_hits import first_hits_at_centre, first_hits_of_view

pytestmark = pytest.mark.renders


@pytest.mark.parametrize("point", [(0.0, 0.0, 500.0), (60.0, 25.0, 600.0), (-70.0, -40.0, 720.0)])
def test_a_dot_appears_where_geometry_says(point: tuple[float, float, float], tmp_path: Path) -> None:
    # The dot is a card parallel to the sensor: its image is a square about its centre's image, evenly
    # lit (a ball's would be shaded, and pull the centroid). Its 20 pixels of 512 samples leave noise of
    # about 1.4 px x 0.6 / sqrt(10^4) = 0.01 px.
    cameras = grid(2, 3, 100, 130, pixel_mm=0.1408)
    scene = built(tmp_path, [card("dot", point[2], 8.0, {"reflectance": [1, 1, 1]}, at_mm=point[:2])])
    for k, l in ((0, 0), (0, 2), (1, 1)):
        image = render_view(scene, cameras, k, l, samples_per_pixel=512, seed=11).sum(axis=2)
        i, j = np.indices(image.shape)
        found = np.array([(i * image).sum(), (j * image).sum()]) / image.sum()
        expected = np.array(project_px(cameras, point, k, l))
        np.testing.assert_allclose(found, expected, atol=0.05)
        mirrored = project_px(cameras, point, 1 - k, 2 - l)  # the fault: signs of both axes swapped
        if (k, l) != (1, 1):
            assert np.abs(found - mirrored).max() > 1


def test_a_plane_is_sharpest_at_its_depth(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    noise = rng.integers(0, 256, (64, 64, 3), dtype=np.uint8)
    Image.fromarray(noise).resize((512, 512), Image.Resampling.NEAREST).save(tmp_path / "noise.png")
    cameras = grid(5, 4, 128, 160)
    scene = built(tmp_path, [card("card", 600.0, 160.0, {"texture": "noise.png"})])
    views = np.stack(
        [
            [render_view(scene, cameras, k, l, samples_per_pixel=8, seed=9 * k + l) for l in range(4)]
            for k in range(5)
        ]
    )
    depths = [500.0, 550.0, 600.0, 650.0, 700.0]
    sections = reconstruct(Views(views, cameras), depths)
    middle = sections.estimate[:, 40:90, 50:110]
    assert depths[int(np.argmax(middle.var(axis=(1, 2)).sum(axis=1)))] == 600.0


def test_z_is_planar_and_exact_on_a_slanted_card(tmp_path: Path) -> None:
    scene = built(tmp_path, [card("card", 700.0, 400.0, {"reflectance": [1, 1, 1]}, (0, 30, 0))])
    cameras = grid(1, 1, 96, 128)
    hits = first_hits_at_centre(scene, cameras)
    # Turned by 30 degrees about Y (right to down-handed axes: +X goes towards -Z) the card's
    # plane is (z - 700) cos 30 = -x sin 30, and x = z u along the ray of direction (u, v, 1).
    u = (np.arange(128) - 127 / 2) * 0.0704 / 50
    z = 700.0 / (1 + u * np.tan(np.radians(30)))
    assert (hits.object_id == 1).all()
    np.testing.assert_allclose(hits.z_mm, np.tile(z, (96, 1)), rtol=1e-5)


def test_z_is_exact_on_a_sphere_from_every_view(tmp_path: Path) -> None:
    centre, radius = np.array([20.0, -15.0, 650.0]), 60.0
    scene = built(tmp_path, [sphere("ball", (20.0, -15.0, 650.0), radius)], backdrop_mm=None)
    cameras = grid(2, 2, 100, 120)
    for k, l in np.ndindex(2, 2):
        hits = first_hits_of_view(scene, cameras, k, l)
        origin = np.array([(l - 0.5) * 6.0, (k - 0.5) * 4.0, 0.0])
        v, u = np.meshgrid(
            (np.arange(100) - 99 / 2) * 0.0704 / 50, (np.arange(120) - 119 / 2) * 0.0704 / 50, indexing="ij"
        )
        ray = np.stack([u, v, np.ones_like(u)], axis=-1)
        a, b = (ray**2).sum(-1), ray @ (centre - origin)
        c = ((centre - origin) ** 2).sum() - radius**2
        inside = b * b - a * c
        expected = np.where(inside > 0, (b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)
        # At the very rim float32 rays hit or miss by rounding, and depth has an infinite slope.
        sure = np.abs(inside) > 1e-4 * b * b
        np.testing.assert_allclose(hits.z_mm[sure], expected[sure], rtol=1e-5)
        assert (hits.object_id[sure] == (inside > 0)[sure]).all()
        assert np.isinf(hits.z_mm[(inside < 0) & sure]).all()


def test_each_object_keeps_its_own_id_and_the_backdrop_is_none(tmp_path: Path) -> None:
    # Compiled backends number shapes in no fixed order, so several shapes and a second scene matter.
    places = [(-60.0, 0.0), (-20.0, 30.0), (20.0, -30.0), (60.0, 0.0)]
    cameras = grid(1, 1, 160, 200)
    for z in (500.0, 640.0):
        objects = [sphere(f"s{n}", (x, y, z + n), 9.0) for n, (x, y) in enumerate(places)]
        hits = first_hits_at_centre(built(tmp_path, objects), cameras)
        for n, (x, y) in enumerate(places):
            i, j = project_px(cameras, (x, y, z + n), 0, 0)
            assert hits.object_id[round(i), round(j)] == n + 1
        assert hits.object_id[0, 0] == 0
        assert hits.z_mm[0, 0] == pytest.approx(3000.0, rel=1e-5)


def test_views_with_different_seeds_have_independent_noise(tmp_path: Path) -> None:
    scene = built(tmp_path, [card("card", 600.0, 400.0, {"reflectance": [0.5, 0.5, 0.5]})])
    cameras = grid(1, 1, 100, 100)
    one, again, other = (
        render_view(scene, cameras, 0, 0, samples_per_pixel=1, seed=seed)[..., 0] for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, again)
    if one.std() > 0:
        correlation = np.corrcoef(one.ravel(), other.ravel())[0, 1]
        assert abs(correlation) < 5 / np.sqrt(one.size)


def test_a_cards_texture_stands_upright_and_ends_at_its_borders(tmp_path: Path) -> None:
    corners = np.zeros((40, 40, 3), dtype=np.uint8)
    corners[:20, :20], corners[:20, 20:] = (255, 0, 0), (0, 255, 0)  # top: red, green
    corners[20:, :20], corners[20:, 20:] = (0, 0, 255), (255, 255, 255)  # bottom: blue, white
    Image.fromarray(corners).save(tmp_path / "corners.png")
    scene = built(tmp_path, [card("card", 600.0, 80.0, {"texture": "corners.png"})])
    image = render_view(scene, grid(1, 1, 120, 120), 0, 0, samples_per_pixel=64, seed=3)
    # The card is 95 px wide about (59.5, 59.5): its corners are 25 px from the centre, and more.
    lit = image > 0.3 * image.max()
    assert lit[35, 35].tolist() == [True, False, False]
    assert lit[35, 84].tolist() == [False, True, False]
    assert lit[84, 35].tolist() == [False, False, True]
    assert lit[84, 84].tolist() == [True, True, True]
    top_row = image[13, 20:50]  # the card's uppermost row, where the bottom's blue must not leak in
    assert top_row[:, 2].max() < 0.02 * image.max()
