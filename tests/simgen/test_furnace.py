"""The furnace: in light that is the same from everywhere, what absorbs nothing cannot be seen."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import EVENLY, SCALAR, ball, build_scene, card, film, seen, sky, surprise, thinned, white

from simgen.renderer import RenderScene

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
TELLS_NOTHING = {"wavelength_nm": (400, 700), "value": (1, 1)}
DEPTH = 12
"""Convex things throw some tenth of their light at each other: of 1e-10 the path is too long."""
GRID = film()


def things(material: dict[str, Any]) -> list[dict[str, Any]]:
    """A ball and a turned box before a card that fills the view."""
    box = card(420.0, 0.0, material, "box", (20.0, 35.0, 0.0), (60.0, -30.0))
    box["shape"] = {"type": "box", "width_mm": 70, "height_mm": 90, "depth_mm": 60}
    return [ball("ball", -60, 400, radius_mm=55, y_mm=20, **material), box, card(600, 600, material)]


@pytest.mark.parametrize(
    ("reflectance", "spectral"), [([1, 1, 1], False), (TELLS_NOTHING, True), ([1, 1, 1], True)]
)
def test_what_absorbs_nothing_is_as_bright_as_its_surroundings(reflectance: Any, spectral: bool) -> None:
    built = build_scene(things({"reflectance": reflectance}), [EVENLY], spectral=spectral, max_depth=DEPTH)
    view = seen(built, GRID, 512)
    # A path varies by 0.3, so that the mean of half a million is known to 4e-4.
    np.testing.assert_allclose(view.mean(axis=(0, 1)), 1, atol=1e-3)
    # Each corner of the view has one thing in it, or the card alone.
    quarters = view.reshape(2, 16, 2, 16, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(quarters, 1, atol=2 * 1e-3)


def test_thinned_photons_see_nothing_in_the_furnace() -> None:
    # A ball alone, so that short paths leave nothing out.
    built = build_scene(things({"reflectance": TELLS_NOTHING})[:1], [EVENLY], spectral=True)
    gain = (5_000 if SCALAR else 200_000) / GRID.height / GRID.width / white(built).mean()
    photons, _ = thinned(built, GRID, gain)
    assert abs(surprise(photons, np.ones((32, 32, 3)) * white(built), GRID, gain, block_px=32)) < 5


@pytest.mark.parametrize(("roughness", "spectral"), [(0.01, False), (0.1, True), (0.5, False)])
def test_plastic_gives_no_more_than_it_gets(roughness: float, spectral: bool) -> None:
    finish: dict[str, Any] = {"finish": {"type": "plastic", "roughness": roughness}}
    coated = ball("ball", 0, 300, radius_mm=55, reflectance=[1, 1, 1], **finish)
    view = seen(build_scene([coated], [EVENLY], spectral=spectral, max_depth=DEPTH), GRID, 256)
    middle = view[8:24, 8:24].mean(axis=(0, 1))
    # 65 000 paths that vary by some 0.5. The renderer's model leaves out what bounces twice between the
    # facets of a rough coat, so that it is darker than white.
    assert (middle < 1 + 5 * 0.5 / np.sqrt(65_536)).all(), middle
    assert (middle > 0.97 if roughness == 0.01 else middle > 0.5).all(), middle
    # No place, not even the rim, gathers light: 4 x 4 pixels of 256 paths.
    assert view.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3)).max() < 1 + 5 * 0.5 / np.sqrt(4096)


@pytest.mark.parametrize(("pane", "spectral"), [(False, False), (True, False), (False, True)])
def test_glass_in_the_furnace_cannot_be_seen(pane: bool, spectral: bool) -> None:
    material: dict[str, Any] = {"finish": {"type": "glass"}}
    glass = ball("ball", 0, 300, radius_mm=80, **material)
    if pane:
        glass = card(300, 150, material, turn_deg=(0.0, 30.0, 0.0))
    view = seen(build_scene([glass], [EVENLY], spectral=spectral, max_depth=DEPTH), GRID, 256)
    # Every path brings 1 but those that are given up or still inside after 12 segments, one in 100 000.
    # The wavelengths that are drawn vary by 0.3 (half a million paths in all, and 256 in a pixel).
    np.testing.assert_allclose(view.mean(axis=(0, 1)), 1, atol=3e-3 if spectral else 5e-4)
    assert view.max() < (1 + 6 * 0.3 / 16 if spectral else 1.03)
    if not pane:  # the fault: paths that end within the glass bring nothing
        short = seen(build_scene([glass], [EVENLY], spectral=spectral), GRID, 64)
        assert (short.mean(axis=(0, 1)) < 0.9).all()


TILES = {"type": "checks", "rows": 7, "columns": 5, "colours": [[0.9, 0.9, 0.9], [0.1, 0.2, 0.6]]}
BEHIND = card(600.0, 500.0, {"texture": TILES})
GLASS: dict[str, Any] = {"finish": {"type": "glass"}}
BALL = ball("ball", -70, 400, radius_mm=55, y_mm=20, **GLASS)
PANE = card(450, 120, GLASS, "pane", (0, 40, 0), (70, 0))
PANE["shape"]["height_mm"] = 180.0


@pytest.mark.parametrize(("thing", "index"), [(BALL, 1.5), (PANE, 2.0)], ids=["ball", "pane"])
def test_glass_reflects_what_fresnel_says(thing: dict[str, Any], index: float) -> None:
    glass = thing | {"position_mm": (0.0, 0.0, 400.0), "rotation_deg": (0.0, 0.0, 0.0)}
    glass["material"] = {"finish": {"type": "glass", "refractive_index": index}}
    black = card(600.0, 5000.0, {"reflectance": [0, 0, 0]})
    # Right in the middle, where both surfaces are met at right angles: R and, from inside, again and again.
    view = seen(build_scene([black, glass], [EVENLY], max_depth=8), film(4, 4, focal_mm=5000.0), 16384)
    once = ((index - 1) / (index + 1)) ** 2
    # A quarter of a million paths, each of which brings 0 or 1.
    both = 2 * once / (1 + once)
    assert abs(view.mean() - both) < 4 * np.sqrt(both / 262_144)


@pytest.mark.parametrize(("light", "depth"), [("uniform", 8), ("an image", 4)])
def test_photons_through_glass_are_those_of_rendered_views(light: str, depth: int, tmp_path: Path) -> None:
    # Glass gathers no uniform light, and of an image as smooth as this not much: rendered views are clean.
    pixels = np.linspace(1.6, 0.4, 16)[:, None, None] * np.ones((16, 32, 3))
    lamp = EVENLY if light == "uniform" else sky(tmp_path, pixels)

    def scene_of(*glass: dict[str, Any], max_depth: int = depth) -> RenderScene:
        return build_scene([BEHIND, *glass], [lamp], max_depth=max_depth, folder=tmp_path)

    built = scene_of(BALL, PANE)
    view = seen(built, GRID, 512)
    gain = (20_000 if SCALAR else 40_000) / view.sum() * 3
    photons, log = thinned(built, GRID, gain)
    assert abs(surprise(photons, view, GRID, gain)) < 5
    assert log["paths_above_bound"] <= max(1e-3 * photons.k.size, 3)
    # The faults: what is seen through the pane, or upside down in the ball, is that without glass.
    bare = seen(scene_of(), GRID, 128)
    for half in (slice(0, 16), slice(16, 32)):
        without = view.copy()
        without[:, half] = bare[:, half]
        assert surprise(photons, without, GRID, gain) > 5
    # The fault: paths that are too short to leave the glass.
    short = seen(scene_of(BALL, PANE, max_depth=3), GRID, 128)
    assert surprise(photons, np.maximum(short, 1e-3), GRID, gain) > 5
