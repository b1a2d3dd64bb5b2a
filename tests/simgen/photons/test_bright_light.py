"""Bright light that few paths meet: measured from the lamp's side, drawn at its images, or refused."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twins import project_px

import pcii
import simgen
from pcii.base import InputError
from simgen.renderer import RenderScene, backend, build, render_view

pytestmark = pytest.mark.renders

GRID = pcii.Optics(pitch_mm=(20.0, 20.0), focal_mm=50.0, pixel_mm=0.375).grid((1, 2, 48, 48))
PIXELS, FOCAL_PX = GRID.height * GRID.width, GRID.focal_mm / GRID.pixel_mm
GREY = simgen.Material(reflectance=(0.8, 0.8, 0.8))
REFLECTANCE = ((0.8 + 0.055) / 1.055) ** 2.4
SURROUNDINGS = simgen.UniformLight(luminance_cd_m2=1.0)
LAMP_Z_MM, LAMP_LIGHT = 600.0, 5 * PIXELS
"""A lamp that gives a film five times what surroundings of radiance 1 give it, whatever its size."""


def wall(z_mm: float) -> simgen.SceneObject:
    card = simgen.Card(width_mm=900, height_mm=900)
    return simgen.SceneObject(name="wall", position_mm=(0, 0, z_mm), shape=card, material=GREY)


def lamp(size_mm: float = 0.2) -> simgen.SceneObject:
    emission = simgen.Emission(luminance_cd_m2=LAMP_LIGHT / (size_mm / LAMP_Z_MM * FOCAL_PX) ** 2)
    card = simgen.Card(width_mm=size_mm, height_mm=size_mm)
    black = simgen.Material(reflectance=(0, 0, 0), emission=emission)
    return simgen.SceneObject(name="lamp", position_mm=(6, 4, LAMP_Z_MM), shape=card, material=black)


def glass(shape: Any, z_mm: float) -> simgen.SceneObject:
    clear = simgen.Material(finish=simgen.Glass(refractive_index=1.5))
    return simgen.SceneObject(name="glass", position_mm=(0, 0, z_mm), shape=shape, material=clear)


def scene_of(things: Sequence[simgen.SceneObject], *lights: Any) -> simgen.Scene:
    return simgen.Scene(title="a bright lamp", objects=tuple(things), lights=(SURROUNDINGS, *lights))


def built(scene: simgen.Scene, folder: Path = Path(), max_depth: int = 8) -> RenderScene:
    return build(backend.load(), scene, folder, max_depth)


def transmittance(angle_deg: float, index: float = 1.5) -> float:
    """Of a slab in unpolarised light, with all reflections inside it (Born and Wolf, 1.6.4)."""
    cosine = np.cos(np.radians(angle_deg))
    inside = np.sqrt(1 - (np.sin(np.radians(angle_deg)) / index) ** 2)
    across = ((cosine - index * inside) / (cosine + index * inside)) ** 2
    along = ((index * cosine - inside) / (index * cosine + inside)) ** 2
    return float(np.mean([(1 - part) / (1 + part) for part in (across, along)]))


@pytest.mark.parametrize("size_mm", [0.2, 3.0])
def test_a_small_lamp_behind_a_tilted_slab_gives_its_light(size_mm: float) -> None:
    """No path through the film meets an image of 0.002 px; paths that meet one of 0.5 px count once."""
    slab = glass(simgen.Box(width_mm=90, height_mm=90, depth_mm=20), 450).change(rotation_deg=(0, 40, 0))
    scene = scene_of([wall(620), slab, lamp(size_mm)])
    counts, truth = simgen.draw_photons(scene, GRID, budget=4000.0, seed=1, cfa=None, max_depth=8)
    assert truth.photons is not None
    # Towards the lamp the slab stands at 40 degrees less the angle of sight.
    expected, dark = LAMP_LIGHT * transmittance(39), built(scene_of([wall(620), slab]))
    for l in range(GRID.cols):
        view = counts.dense[0, l]
        i, j = np.unravel_index(view.argmax(), view.shape)
        photons = view[i - 1 : i + 2, j - 1 : j + 2].sum()
        others = render_view(dark, GRID, 0, l, samples_per_pixel=16, seed=l).mean() * PIXELS
        assert photons / view.sum() == pytest.approx(expected / (expected + others), abs=0.02)


def test_glass_in_the_light_of_points_alone_has_photons() -> None:
    """No path from a camera meets a lamp without a surface, so that none is followed to mirrors and glass."""
    point = simgen.PointLight(position_mm=(0, -200, 100), intensity_cd=5.0)
    things = (wall(700.0), glass(simgen.Sphere(radius_mm=20), 500.0))
    scene = simgen.Scene(title="glass", objects=things, lights=(point,))
    assert simgen.draw_photons(scene, GRID, budget=200, max_depth=6)[0].total > 0
    alone, pixel = scene.change(objects=things[1:]), replace(GRID, height=1, width=1, cols=1)
    assert simgen.draw_photons(alone, pixel, budget=200, max_depth=6)[0].total == 0


@pytest.mark.parametrize("cutoff_deg", [0.1, 3.0])
def test_the_dot_of_a_spot_lamp_has_its_light(cutoff_deg: float) -> None:
    radius_mm = 300 * np.tan(np.radians(cutoff_deg))
    dot_px = np.pi * (radius_mm / 500 * FOCAL_PX) ** 2
    intensity = PIXELS / dot_px * np.pi / REFLECTANCE * 0.3**2
    cone: Any = {"beam_deg": cutoff_deg * 0.999, "cutoff_deg": cutoff_deg, "intensity_cd": float(intensity)}
    spot = simgen.SpotLight(position_mm=(10, 5, 200), target_mm=(10, 5, 500), **cone)
    scene = scene_of([wall(500)], spot)
    counts, _ = simgen.draw_photons(scene, GRID, budget=4000, seed=1, cfa=None, max_depth=2)
    i, j = np.indices((GRID.height, GRID.width))
    for l in range(GRID.cols):
        row, col = project_px(GRID, (10, 5, 500), 0, l)
        near, view = np.hypot(i - row, j - col) < radius_mm / 500 * FOCAL_PX + 1.5, counts.dense[0, l]
        # The dot gives a film `PIXELS`, the surroundings give each of its pixels the wall's reflectance.
        expected = (1 + REFLECTANCE * near.mean()) / (1 + REFLECTANCE)
        assert view[near].sum() / view.sum() == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(4000))


def test_images_in_curved_glass_are_refused_by_name() -> None:
    """Those by inner reflections are too faint and wide to be found."""
    scene = scene_of([wall(620), glass(simgen.Sphere(radius_mm=25), 400), lamp()])
    with pytest.raises(InputError, match=r"'lamp' through 'glass' gives \d+% of the light from .* px of a"):
        simgen.draw_photons(scene, replace(GRID, cols=1), budget=3000, seed=0, cfa=None, max_depth=8)


FOG = """
<medium type="homogeneous" id="fog">
  <float name="sigma_t" value="0.002"/><rgb name="albedo" value="0.8"/>
</medium>"""
SENSOR = """
<sensor type="perspective" id="cam">
  <transform name="to_world"><lookat origin="0,0,0" target="0,0,1" up="0,1,0"/></transform>{}
</sensor>"""
WALL = """
<shape type="rectangle" id="wall">
  <transform name="to_world"><scale value="450"/><rotate y="1" angle="180"/><translate z="620"/></transform>
  <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>
</shape>
<emitter type="constant"><rgb name="radiance" value="1"/></emitter>"""
ASIDE = """
<shape type="cube">
  <transform name="to_world"><scale value="20"/><translate x="200" z="500"/></transform>
  <bsdf type="null"/><ref name="interior" id="fog"/>
</shape>"""
SHINING = """
<shape type="{}" id="lamp">
  <transform name="to_world">
    <scale value="0.1"/><rotate y="1" angle="180"/><translate x="-7" y="-3" z="500"/>
  </transform>
  <emitter type="area"><rgb name="radiance" value="3e5"/></emitter>
</shape>"""


def reference(folder: Path, content: str) -> simgen.Scene:
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{content}</scene>')
    return simgen.load_scene({"title": "x", "mitsuba": {"file": "scene.xml", "unit_mm": 1}}, folder=folder)


def test_cameras_stand_in_the_medium_of_the_sensor(tmp_path: Path) -> None:
    """Against Mitsuba's own rendering of the file; without the medium it would be three times as bright."""
    scene = reference(tmp_path, FOG + SENSOR.format('<ref id="fog"/>') + WALL)
    render_scene = built(scene, tmp_path, 6)
    ours = render_view(render_scene, GRID, 0, 0, samples_per_pixel=64, seed=1)
    fov = 2 * np.degrees(np.arctan(24 / FOCAL_PX))
    size = '<integer name="width" value="48"/><integer name="height" value="48"/>'
    film = f'<film type="hdrfilm">{size}<rfilter type="box"/></film>'
    film += f'<ref id="fog"/><float name="fov" value="{fov}"/>'
    integrator = '<integrator type="volpath"><integer name="max_depth" value="6"/></integrator>'
    mi = backend.load()
    theirs = mi.load_string(f'<scene version="3.0.0">{integrator}{FOG}{SENSOR.format(film)}{WALL}</scene>')
    assert ours.mean() == pytest.approx(np.array(mi.render(theirs, spp=64, seed=2)).mean(), rel=0.02)


@pytest.mark.parametrize("shape", ["disk", "sphere"])
def test_a_lamp_in_a_scene_with_a_medium_is_in_the_forecast(tmp_path: Path, shape: str) -> None:
    """Also a turned ball, of which Mitsuba mixes up places and normals."""
    scene = reference(tmp_path, FOG + SENSOR.format("") + WALL + ASIDE + SHINING.format(shape))
    with pytest.raises(InputError, match="'lamp' gives"):
        simgen.draw_photons(scene, GRID, budget=2000, seed=0, cfa=None, max_depth=4)


def test_a_spot_that_single_precision_cannot_tell_is_refused(tmp_path: Path) -> None:
    spot = '<emitter type="spot"><float name="cutoff_angle" value="0.05"/></emitter>'
    with pytest.raises(InputError, match=r"cutoff_angle of 0\.2 degrees"):
        built(reference(tmp_path, SENSOR.format("") + WALL + spot), tmp_path)
