"""Photons that come straight from something that shines: as many as geometry says, whatever its size."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import simgen
from pcii.base import InputError, silent
from pcii.types import CameraGrid
from simgen.cameras import Rig, as_rig
from simgen.dataset import capture_of, draw_from_views
from simgen.photons import (
    Capture,
    EmissionSampler,
    Plan,
    explore,
    probe,
    scalar_sampler,
    thin_photons,
    wavefront_sampler,
)
from simgen.renderer import RenderScene, ShiningSurface, backend, build
from simgen.sensor import PhotonTable
from simgen.spec import Photons, Recipe

COMPILED = backend.choose().kind != "scalar"
BUDGET = 4000.0 if COMPILED else 400.0
GRID = CameraGrid(rows=2, cols=2, pitch_mm=(20.0, 20.0), focal_mm=50.0, pixel_mm=0.5632, height=64, width=64)
EVENLY = simgen.UniformLight(luminance_cd_m2=1.0)
GREY = simgen.Material(reflectance=(0.8, 0.8, 0.8))
DEPTH = 2


def shining(shape: Any, luminance: float, z_mm: float = 500.0, name: str = "lamp") -> simgen.SceneObject:
    emission = simgen.Emission(luminance_cd_m2=luminance)
    material = simgen.Material(reflectance=(0.0, 0.0, 0.0), emission=emission)
    return simgen.SceneObject(name=name, position_mm=(7.0, 3.0, z_mm), shape=shape, material=material)


def wall(*others: simgen.SceneObject) -> simgen.Scene:
    """Things before a wall that is lit evenly, of `WALL_RADIANCE` everywhere."""
    behind = simgen.SceneObject(name="wall", position_mm=(0, 0, 620), shape=LARGE, material=GREY)
    return simgen.Scene(title="lamp", objects=(*others, behind), lights=(EVENLY,))


def built(scene: simgen.Scene) -> RenderScene:
    return build(backend.load(), scene, Path(), DEPTH)


def drawn(capture: Capture, draws: int) -> list[PhotonTable]:
    """Photons of as many seeds, whose light is explored once."""
    explored = explore(capture)
    return [thin_photons(replace(capture, seed=seed), explored)[0] for seed in range(draws)]


LARGE = simgen.Card(width_mm=900.0, height_mm=900.0)
WALL_RADIANCE = ((0.8 + 0.055) / 1.055) ** 2.4
PX_PER_MM = 50.0 / 0.5632 / 500.0
SHAPES = {
    "card": lambda size: simgen.Card(width_mm=size, height_mm=size),
    "ball": lambda size: simgen.Sphere(radius_mm=size / np.sqrt(np.pi)),
    "wire": lambda size: simgen.Box(width_mm=size / 30, height_mm=30 * size, depth_mm=size / 30),
}


@pytest.mark.renders
@pytest.mark.parametrize(
    ("shape", "size_mm"), [("card", 1.0), *((name, 0.05 if COMPILED else 1.0) for name in ("ball", "wire"))]
)
def test_a_lamp_in_view_sends_its_share_of_the_photons(shape: str, size_mm: float) -> None:
    """It gives half of all light; of the box a little more than its front is seen."""
    film_px = (size_mm * PX_PER_MM) ** 2
    lamp = shining(SHAPES[shape](size_mm), 64 * 64 * WALL_RADIANCE / film_px)
    scene = wall(lamp)
    if shape != "card":  # which, unlike it, would light the wall
        black = shining(LARGE, WALL_RADIANCE, 620.0, "screen")
        scene = simgen.Scene(title="lamp", objects=(lamp, black))
    settings = Photons(budget=BUDGET, statistics="multinomial")
    photons = drawn(Capture(built(scene), GRID, "GRBG", settings), draws=4)
    of_lamp = [int((one.object_id == 1).sum()) for one in photons]
    total = 4 * BUDGET
    # The front of a box fills its share; its sides, seen by cameras 10 mm aside, 1 / 50 of that more.
    share = 0.5 if shape != "wire" else (1 + 0.02 + 0.018) / (2 + 0.02 + 0.018)
    expected = share * 4 * total
    assert abs(sum(of_lamp) - expected) < 4 * np.sqrt(expected * (1 - share)) + (0.01 * expected)
    # The fault of a search through the film: it meets the lamp now and then, and all of it at once.
    spread = np.var(of_lamp, ddof=1) / (total * share * (1 - share))
    assert stats.chi2.sf(3 * spread, 3) > 1e-4


@pytest.mark.renders
@pytest.mark.skipif(not COMPILED, reason="scalar mode does not look for openings")
def test_a_hole_in_a_dark_room_shows_the_sky_in_every_view() -> None:
    """A closed room with a lamp, and a hole of half a pixel to a sky that is 10 000 times as bright."""
    side_mm, width_mm = 0.5 / PX_PER_MM, 600.0
    across, along = (width_mm + side_mm) / 2, 2 * width_mm + side_mm
    walls: list[Any] = [((0, 0, -200), (0, 0, 0), (700, 700))]
    for sign in (-1, 1):
        walls += [((0, sign * across, 500), (0, 0, 0), (along, width_mm))]
        walls += [((sign * across, 0, 500), (0, 0, 0), (width_mm, side_mm))]
        walls += [((0, sign * 300, 150), (90, 0, 0), (700, 900))]
        walls += [((sign * 300, 0, 150), (0, 90, 0), (900, 700))]
    parts = []
    for number, (place, turn, (width, height)) in enumerate(walls):
        part = simgen.Card(width_mm=width, height_mm=height)
        thing = simgen.SceneObject(name=f"wall-{number}", position_mm=place, shape=part, material=GREY)
        parts.append(thing.change(rotation_deg=turn))
    lamp = simgen.PointLight(position_mm=(0.0, -200.0, 200.0), intensity_cd=1.0)
    dark = simgen.Scene(title="room", objects=tuple(parts), lights=(lamp,))
    view = simgen.render(dark, GRID, samples_per_pixel=64, max_depth=DEPTH).view(0, 0)[..., 1]
    sky = 1e4 * float(view.mean())
    lit = dark.change(lights=(lamp, EVENLY.change(luminance_cd_m2=sky)))
    photons = drawn(Capture(built(lit), GRID, None, Photons(budget=2000, statistics="multinomial")), draws=3)
    views = np.concatenate([2 * one.k + one.l for one in photons])
    beyond_room = np.concatenate([one.z_mm == np.inf for one in photons])
    beyond = np.bincount(views, beyond_room, minlength=4)
    expected = 6000 * 0.25 * sky / (0.25 * sky + 64 * 64 * sky / 1e4)
    assert (np.abs(beyond - expected) < 5 * np.sqrt(6000 / 4)).all()


def area_of(rig: Rig, surface: ShiningSurface, cfa: str | None = None) -> tuple[float, float]:
    """Light of a surface on all films by the sampler, and the largest share of a bound that is used."""
    scene = built(simgen.Scene(title="empty", lights=(EVENLY,)))
    sampler = EmissionSampler(Capture(replace(scene, shining=(surface,)), rig, cfa))
    if not sampler.mass:
        return 0.0, 0.0
    view = np.arange(4096) % rig.grid.view_count
    found = sampler.film_points(view, np.random.default_rng(1))
    highest = max(float(one.radiance.max()) for one in sampler.surfaces)
    inside = (found.row > 0) & (found.row < rig.grid.height) & (found.col > 0) & (found.col < rig.grid.width)
    used = inside * found.sent * highest / found.bound
    kept, *_ = sampler.arriving(view, np.random.default_rng(2))
    return sampler.mass * kept.size / view.size, float(used.max())


@pytest.mark.renders
def test_a_window_that_fills_all_films_has_their_area() -> None:
    corners = np.array([(-900.0, -900, 400), (-900, 900, 400), (900, 900, 400), (900, -900, 400)])
    # They turn so that the normal faces the cameras.
    window = ShiningSurface(1, corners[[[0, 1, 2], [0, 2, 3]]], np.ones(3))
    light, used = area_of(as_rig(GRID), window)
    assert light == pytest.approx(64 * 64, rel=0.03)
    assert used <= 1
    away = replace(window, corners_mm=window.corners_mm[:, ::-1])
    assert area_of(as_rig(GRID), away) == (0.0, 0.0)


@pytest.mark.renders
@pytest.mark.parametrize("radius_mm", [3.0, 0.3])
def test_small_balls_shine_as_they_should(radius_mm: float) -> None:
    """Mitsuba's own sphere would be 1.5 times as bright at the smaller radius."""
    distance_mm, luminance = 1000.0, 1e3 * (10 / radius_mm) ** 2
    ball = shining(simgen.Sphere(radius_mm=radius_mm), luminance).change(position_mm=(0.0, -300.0, 600.0))
    card = simgen.Card(width_mm=5000.0, height_mm=5000.0)
    behind = simgen.SceneObject(name="wall", position_mm=(0, 0, 1600), shape=card, material=GREY)
    grid = CameraGrid(rows=1, cols=1, pitch_mm=(1, 1), focal_mm=50, pixel_mm=1.2, height=16, width=16)
    scene = simgen.Scene(title="bulb", objects=(ball, behind))
    view = simgen.render(scene, grid, samples_per_pixel=256, max_depth=2).view(0, 0)[..., 1]
    row, col = np.indices(view.shape)
    x, y = ((place - 7.5) * 1.2 / 50 * 1600 for place in (col, row))
    squared = x**2 + (y + 300) ** 2 + distance_mm**2
    expected = WALL_RADIANCE / np.pi * luminance * np.pi * radius_mm**2 * distance_mm / squared**1.5
    assert view.mean() == pytest.approx(expected.mean(), rel=0.01)


def test_a_ball_that_is_too_small_to_shine_is_refused() -> None:
    with pytest.raises(InputError, match=r"'lamp', shape.radius_mm: 1e-05 is too small to shine at 500\.1"):
        built(wall(shining(simgen.Sphere(radius_mm=1e-5), 1.0)))


@pytest.mark.renders
def test_a_lamp_that_the_probe_misses_is_in_the_forecast() -> None:
    lamp_px = 0.0003
    luminance = 64 * 64 * WALL_RADIANCE / lamp_px
    size_mm = np.sqrt(lamp_px) / PX_PER_MM
    scene = built(wall(shining(SHAPES["card"](size_mm), luminance)))
    looked = probe(Capture(scene, GRID, "GRBG"), seed=1)
    assert looked.mean == pytest.approx(2 * WALL_RADIANCE, rel=0.2)
    assert looked.variance == pytest.approx(lamp_px / 64**2 * luminance**2, rel=0.3)


def test_noise_of_views_is_measured_and_too_much_is_refused() -> None:
    """Of half-views that differ by sqrt(2) of a rate, whose mean has a variance of half of that squared."""
    grid = {"rows": 2, "cols": 2, "height": 64, "width": 64}
    made = Recipe.model_validate({"scene": "any", "grid": grid, "photons": {"budget": 500}})
    no_scene: Any = None
    capture, plan, pixels = capture_of(made, no_scene, 1), Plan(False, 4, 500.0), 64**2

    def draw(variance: float) -> dict[str, Any]:
        view = np.ones((64, 64)), np.full(3, variance)
        return draw_from_views(capture, lambda k, l: view, plan, silent)[1]

    # Added variance g^2 v beside g pixels, g = 500 / pixels.
    assert draw(0.02)["rendering_noise"] == pytest.approx(500 / pixels * 3 * 0.02 / pixels, rel=0.01)
    with pytest.raises(InputError, match=r"^photons: the noise of views rendered with 4 samples per pixel"):
        draw(0.02 * pixels**2 / 500)


@pytest.mark.renders
def test_radiance_that_is_no_number_is_refused_with_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    capture = Capture(built(wall()), GRID, "GRBG", Photons(budget=100))
    module = wavefront_sampler.WavefrontSampler if COMPILED else scalar_sampler.ScalarSampler
    follow = module._follow

    def broken(*arguments: Any) -> Any:
        light = follow(*arguments)
        return light * float("nan") if COMPILED else np.full_like(light, np.nan)

    monkeypatch.setattr(module, "_follow", broken)
    with pytest.raises(InputError, match=r"^object 'wall': its radiance in row \d+, column \d+ of view \(\d"):
        explore(capture)
