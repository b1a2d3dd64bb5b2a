"""Cameras as they really are: sheared, off their place, turned, with a lens; in every way of making data."""

from dataclasses import replace

import numpy as np
import pytest
from lit_scenes import EVENLY_30, build_scene, card, mosaics, two_balls
from photon_statistics import counted, p_value
from scipy import stats
from scipy.spatial.transform import Rotation

from pcii.types import CameraGrid
from simgen.cameras import Cameras, Rig, as_rig, rig_of
from simgen.photons import Capture, thin_photons
from simgen.renderer import RenderScene, backend, film_rays, render_view
from simgen.sensor import PhotonTable
from simgen.spec import Lens, Photons, Recipe
from simgen.truth import first_hits_at_centre, first_hits_of_view

pytestmark = pytest.mark.renders
COMPILED = backend.choose().kind != "scalar"
GRID = CameraGrid(rows=3, cols=2, pitch_mm=(6.0, 4.0), focal_mm=50.0, pixel_mm=0.1408, height=81, width=90)
SCALE_PX = 50.0 / 0.1408
SIDE_MM = 8.0
LENS = Lens(aperture_mm=20.0, focus_mm=600.0)


def dot(point_mm: tuple[float, float, float], side_mm: float = SIDE_MM) -> RenderScene:
    """A small white card, evenly lit, before a black wall."""
    thing = card(point_mm[2], side_mm, at_mm=point_mm[:2])
    return build_scene([thing], [EVENLY_30], backdrop={"z_mm": 3000.0, "reflectance": (0, 0, 0)})


def photons(scene: RenderScene, cameras: Cameras, budget: float, seed: int = 1) -> PhotonTable:
    return thin_photons(Capture(scene, cameras, None, Photons(budget=budget), seed=seed))[0]


def off_places(grid: CameraGrid, seed: int = 3) -> Rig:
    """Cameras some millimetres and degrees off."""
    rng, perfect = np.random.default_rng(seed), as_rig(grid)
    angles = rng.normal(0, 1.0, (grid.rows, grid.cols, 3))
    rotation = Rotation.from_euler("xyz", angles.reshape(-1, 3), degrees=True).as_matrix()
    off_mm = rng.normal(0, 3, perfect.position_mm.shape)
    return replace(
        perfect, position_mm=perfect.position_mm + off_mm, rotation=rotation.reshape(perfect.rotation.shape)
    )


def seen_by(rig: Rig, point_mm: tuple[float, float, float], k: int, l: int) -> np.ndarray:
    """(row, column) of a point, by the formulas of docs/cameras.md."""
    x, y, z = rig.rotation[k, l].T @ (np.array(point_mm) - rig.position_mm[k, l])
    grid = rig.grid
    row = (grid.height - 1) / 2 + (k - (grid.rows - 1) / 2) * grid.shear_px[1] + SCALE_PX * y / z
    col = (grid.width - 1) / 2 + (l - (grid.cols - 1) / 2) * grid.shear_px[0] + SCALE_PX * x / z
    return np.array([row, col])


def centres(scene: RenderScene, cameras: Cameras, k: int, l: int) -> dict[str, np.ndarray]:
    """(row, column) of the dot's centre as each way of making data shows it."""
    image = render_view(scene, cameras, k, l, samples_per_pixel=256, seed=11).sum(axis=2)
    i, j = np.indices(image.shape)
    drawn = photons(scene, cameras, 1500)
    here = (drawn.k == k) & (drawn.l == l)
    true = np.argwhere(first_hits_of_view(scene, cameras, k, l).object_id == 1)
    return {
        "dense": np.array([(i * image).sum(), (j * image).sum()]) / image.sum(),
        "thinned": np.array([drawn.i[here].mean(), drawn.j[here].mean()]),
        "truth": true.mean(axis=0),
    }


# Noise of the dense centre: 20 pixels x 256 samples leave about 1.4 px x 0.6 / sqrt(5000) = 0.01 px; that of
# 1500 photons on 4.7 px is 0.035 px. The truth's centre is that of whole pixels, half a pixel off at most.
TOLERANCE_PX = {"dense": 0.05, "thinned": 0.15, "truth": 0.5}


def test_a_dot_appears_where_the_true_pose_says() -> None:
    grid, point = replace(GRID, shear_px=(4.4, -3.1)), (15.0, -10.0, 620.0)
    scene, rig = dot(point), off_places(grid)
    faults = as_rig(grid), replace(rig, rotation=np.swapaxes(rig.rotation, 2, 3))
    for k, l in ((0, 1), (2, 0)):
        for way, place in centres(scene, rig, k, l).items():
            np.testing.assert_allclose(place, seen_by(rig, point, k, l), atol=TOLERANCE_PX[way], err_msg=way)
            assert all(np.abs(place - seen_by(fault, point, k, l)).max() > 1 for fault in faults)


def recipe(**grid: object) -> Recipe:
    return Recipe.model_validate({"scene": "two_objects", "seed": 5, "grid": grid})


def test_errors_have_the_deviations_of_the_recipe() -> None:
    errors = {"position_sd_mm": (0.5, 0.2, 1.0), "rotation_sd_deg": (0.1, 0.3, 0.2), "pitch_error": 0.02}
    wrong = recipe(rows=40, cols=40, errors=errors)
    rig = rig_of(wrong.grid, wrong.seed)
    off_mm = rig.position_mm - 1.02 * as_rig(rig.grid).position_mm
    # 1600 cameras: a standard deviation is known to 1.8 %, a mean to 2.5 % of one.
    np.testing.assert_allclose(off_mm.std(axis=(0, 1)), (0.5, 0.2, 1.0), rtol=0.08)
    np.testing.assert_allclose(off_mm.mean(axis=(0, 1)), 0, atol=0.1)
    angles = Rotation.from_matrix(rig.rotation.reshape(-1, 3, 3)).as_euler("xyz", degrees=True)
    np.testing.assert_allclose(angles.std(axis=0), (0.1, 0.3, 0.2), rtol=0.08)
    assert np.abs(np.corrcoef(np.column_stack([off_mm.reshape(-1, 3), angles]).T) - np.eye(6)).max() < 0.12
    np.testing.assert_array_equal(rig_of(wrong.grid, wrong.seed).position_mm, rig.position_mm)
    assert np.abs(rig.rotation - rig_of(wrong.grid, 6).rotation).max() > 0
    # Each camera has its own stream: a row fewer changes nothing about the others.
    fewer = rig_of(recipe(rows=39, cols=40, errors=errors).grid, wrong.seed)
    np.testing.assert_array_equal(fewer.rotation, rig.rotation[:39])


def test_the_virtual_centre_is_a_perfect_pinhole() -> None:
    scene = dot((0.0, 0.0, 600.0))
    grid = replace(GRID, rows=2, shear_px=(9.0, 9.0))
    hits = np.argwhere(first_hits_at_centre(scene, grid).object_id == 1)
    np.testing.assert_allclose(hits.mean(axis=0), (40.0, 44.5), atol=0.5)
    rig = rig_of(recipe(errors={"position_sd_mm": (1.0, 1.0, 1.0)}, lens=LENS.model_dump()).grid, 5)
    assert rig.lens == LENS
    assert rig.pinhole(0, 0).lens is None


@pytest.mark.skipif(not COMPILED, reason="scalar mode has no rays by the thousand")
@pytest.mark.parametrize("lens", [None, LENS])
def test_rays_are_the_same_on_both_sides(lens: Lens | None) -> None:
    rig = replace(off_places(replace(GRID, shear_px=(3.5, -2.0))), lens=lens)
    scene, mi = dot((0.0, 0.0, 600.0)), backend.load()
    rng = np.random.default_rng(2)
    k, l = rng.integers(0, 3, 500), rng.integers(0, 2, 500)
    row_px, col_px = rng.uniform(0, 80, 500), rng.uniform(0, 89, 500)
    points = np.zeros((2, 500)) if lens is None else rig.lens_points(rng.random((2, 500)))
    on_film = mi.UInt32(k), mi.UInt32(l), mi.Float(row_px), mi.Float(col_px)
    ray = film_rays(scene, rig, *on_film, None if lens is None else mi.Point2f(points))
    origin, direction = rig.rays(k, l, row_px, col_px, points)
    # Single precision: eight digits of film points up to 90 px, of places of some 10 mm.
    np.testing.assert_allclose(np.array(ray.d).T, direction, atol=1e-6)
    np.testing.assert_allclose(np.array(ray.o).T, origin, atol=1e-5)
    if lens is not None:
        radius = np.hypot(*points)
        assert 0.97 * 10 < radius.max() < 10
        assert stats.kstest((radius / 10) ** 2, "uniform").pvalue > 1e-3


BLUR = {
    "near": (400.0, 20.0 * SCALE_PX * (1 / 400 - 1 / 600)),
    "in focus": (600.0, 0.0),
    "far": (1200.0, 20.0 * SCALE_PX * (1 / 600 - 1 / 1200)),
}


@pytest.mark.parametrize("where", BLUR)
def test_the_circle_of_confusion_has_the_size_of_the_formula(where: str) -> None:
    # A disc of diameter D has the variance D^2 / 16 along each axis, the dot itself s^2 / 12.
    (z_mm, diameter_px), side_px = BLUR[where], 2.0
    small = replace(GRID, rows=1, cols=1, height=21, width=24)
    scene, rig = dot((0.0, 0.0, z_mm), side_px * z_mm / SCALE_PX), replace(as_rig(small), lens=LENS)
    expected = diameter_px**2 / 16 + side_px**2 / 12
    drawn = photons(scene, rig, 4000)
    down, right = drawn.i - 10.0, drawn.j - 11.5
    # Counting by whole pixels adds 1/12 to what is smooth (Sheppard); the dot in focus covers rows 9 to 11,
    # the outer ones by half, and columns 11 and 12.
    pixels = (0.5, 0.25) if diameter_px == 0 else (expected + 1 / 12,) * 2
    # 4000 photons tell the variance of such a shape to 2 %, and so do some 4000 samples.
    np.testing.assert_allclose([down.var(), right.var()], pixels, rtol=0.08)
    # A pixel's centre is up to half its diagonal away from where its photon came in.
    assert np.hypot(down, right).max() < diameter_px / 2 + (side_px + 1) / np.sqrt(2) + 1e-3
    image = render_view(scene, rig, 0, 0, samples_per_pixel=1024, seed=4).sum(axis=2)
    i, j = np.indices(image.shape)
    spread = [(offset**2 * image).sum() / image.sum() for offset in (i - 10.0, j - 11.5)]
    np.testing.assert_allclose(spread, pixels, rtol=0.08)


def test_a_lens_leaves_an_even_field_as_bright_as_a_pinhole() -> None:
    scene = build_scene([], [{"type": "uniform", "luminance_cd_m2": 100.0}])
    wide = CameraGrid(rows=1, cols=1, pitch_mm=(5.0, 5.0), focal_mm=3.0, pixel_mm=0.1, height=41, width=40)
    rig = replace(as_rig(wide), lens=Lens(aperture_mm=4.0, focus_mm=300.0))
    image = render_view(scene, rig, 0, 0, samples_per_pixel=4, seed=1)
    np.testing.assert_allclose(image, 100.0, rtol=1e-5)  # corners, 44 degrees off the axis, too
    drawn, _ = thin_photons(Capture(scene, rig, None, Photons(scope="exposure"), 0.1, seed=1))
    counts = counted(drawn, wide)
    assert abs(counts.mean() / 10 - 1) < 4 / np.sqrt(16_400)
    assert 1e-3 < p_value(counts, np.array(10.0)) < 1 - 1e-3


BALLS = CameraGrid(rows=2, cols=2, pitch_mm=(20.0, 15.0), focal_mm=50.0, pixel_mm=2.0, height=33, width=31)
WRONG = {
    "lens and poses": replace(off_places(BALLS), lens=Lens(aperture_mm=120.0, focus_mm=1500.0)),
    "shear and poses": off_places(replace(BALLS, shear_px=(6.4, -3.7))),
}


@pytest.mark.parametrize("name", WRONG)
def test_thinned_counts_fit_the_rendered_rates(name: str) -> None:
    # Odd films, too: their last row and column are half a Bayer cell.
    scene, rig, budget = two_balls(), WRONG[name], 4000
    pinholes = replace(rig, lens=None) if rig.lens else replace(rig, grid=BALLS)

    def in_blocks(pixels: np.ndarray) -> np.ndarray:
        """Of 4 x 4 pixels and what is left at the border: tens of photons at least."""
        return np.add.reduceat(np.add.reduceat(pixels, range(0, 33, 4), axis=1), range(0, 31, 4), axis=2)

    def rates(cameras: Cameras) -> np.ndarray:
        radiance = mosaics(scene, cameras, 256, seed=7)
        return in_blocks(budget * radiance / radiance.sum(axis=(1, 2), keepdims=True))

    drawn, _ = thin_photons(Capture(scene, rig, "GRBG", Photons(budget=budget), seed=3))
    counts = in_blocks(counted(drawn, BALLS).reshape(4, 33, 31))
    assert p_value(counts, rates(rig)) > 1e-3
    assert p_value(counts, rates(pinholes)) < 1e-6
