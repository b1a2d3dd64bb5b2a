"""The furnace: in light that is the same from everywhere, what absorbs nothing cannot be seen.

Whatever a surface sends back it was sent, so that a scene of reflectance 1 has the radiance of its
surroundings everywhere; what absorbs is darker, and nothing is brighter.
"""

from typing import Any

import numpy as np
import pytest
from lit_views import SCALAR, card, film, made, seen, thing, thinned, white

from pcii.types import colour_index

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
EVERYWHERE = {"type": "uniform", "luminance_cd_m2": 1.0}
TELLS_NOTHING = {"wavelength_nm": (400, 700), "value": (1, 1)}
DEPTH = 12
"""Convex things throw some tenth of their light at each other: of 1e-10 the path is too long."""
GRID = film()


def things(material: dict[str, Any]) -> list[dict[str, Any]]:
    """A ball and a turned box before a card that fills the view."""
    ball = thing("ball", -60.0, 20.0, 400.0, material, type="sphere", radius_mm=55.0)
    box = thing("box", 60.0, -30.0, 420.0, material, type="box", width_mm=70, height_mm=90, depth_mm=60)
    return [ball, box | {"rotation_deg": (20.0, 35.0, 0.0)}, card(600.0, 600.0, material)]


def matt(reflectance: Any) -> dict[str, Any]:
    return {"reflectance": reflectance}


@pytest.mark.parametrize(
    ("reflectance", "spectral"),
    [([1, 1, 1], False), (TELLS_NOTHING, True), ([1, 1, 1], True)],
    ids=["colours", "spectra", "colours made spectra"],
)
def test_what_absorbs_nothing_is_as_bright_as_its_surroundings(reflectance: Any, spectral: bool) -> None:
    built = made(things(matt(reflectance)), [EVERYWHERE], spectral=spectral, max_depth=DEPTH)
    view = seen(built, GRID, 512)
    # A path varies by 0.3, so that the mean of half a million is known to 4e-4.
    np.testing.assert_allclose(view.mean(axis=(0, 1)), 1, atol=1e-3)
    # Each corner of the view has one thing in it, or the card alone.
    quarters = view.reshape(2, 16, 2, 16, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(quarters, 1, atol=2 * 1e-3)


def test_thinned_photons_see_nothing_in_the_furnace() -> None:
    # A ball alone, so that short paths leave nothing out.
    built = made(things(matt(TELLS_NOTHING))[:1], [EVERYWHERE], spectral=True)
    gain = (5_000 if SCALAR else 200_000) / GRID.height / GRID.width / white(built).mean()
    photons, _ = thinned(built, GRID, gain)
    colours = colour_index(GRID.height, GRID.width, "GRBG")
    found = np.bincount(colours[photons.i, photons.j], minlength=3)
    expected = gain * white(built) * np.bincount(colours.ravel())
    assert (np.abs(found - expected) < 4 * np.sqrt(expected)).all(), found / expected


@pytest.mark.parametrize(("roughness", "spectral"), [(0.01, False), (0.1, True), (0.5, False)])
def test_plastic_gives_no_more_than_it_gets(roughness: float, spectral: bool) -> None:
    finish = {"finish": {"type": "plastic", "roughness": roughness}}
    ball = things(matt([1, 1, 1]) | finish)[0] | {"position_mm": (0.0, 0.0, 300.0)}
    view = seen(made([ball], [EVERYWHERE], spectral=spectral, max_depth=DEPTH), GRID, 256)
    middle = view[8:24, 8:24].mean(axis=(0, 1))
    # 65 000 paths that vary by some 0.5. The renderer's model leaves out what bounces twice between the
    # facets of a rough coat, so that it is darker than white.
    assert (middle < 1 + 5 * 0.5 / np.sqrt(65_536)).all(), middle
    assert (middle > 0.97 if roughness == 0.01 else middle > 0.5).all(), middle
    # No place, not even the rim, gathers light: 4 x 4 pixels of 256 paths.
    assert view.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3)).max() < 1 + 5 * 0.5 / np.sqrt(4096)


@pytest.mark.parametrize(("pane", "spectral"), [(False, False), (True, False), (False, True)])
def test_glass_in_the_furnace_cannot_be_seen(pane: bool, spectral: bool) -> None:
    material = {"finish": {"type": "glass"}}
    ball = thing("ball", 0.0, 0.0, 300.0, material, type="sphere", radius_mm=80.0)
    glass = (card(300.0, 150.0, material) if pane else ball) | {"rotation_deg": (0.0, 30.0, 0.0)}
    view = seen(made([glass], [EVERYWHERE], spectral=spectral, max_depth=DEPTH), GRID, 256)
    # Every path brings 1 but those that are given up or still inside after 12 segments, one in 100 000.
    # The wavelengths that are drawn vary by 0.3 (half a million paths in all, and 256 in a pixel).
    np.testing.assert_allclose(view.mean(axis=(0, 1)), 1, atol=3e-3 if spectral else 5e-4)
    assert view.max() < (1 + 6 * 0.3 / 16 if spectral else 1.03)
    if not pane:  # the fault: paths that end within the glass bring nothing
        short = seen(made([glass], [EVERYWHERE], spectral=spectral), GRID, 64)
        assert (short.mean(axis=(0, 1)) < 0.9).all()
