"""Normal maps: a surface whose image tilts it is lit like one that is tilted, in its own directions."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import build_scene, film, seen
from PIL import Image

from pcii.base import srgb_to_linear
from simgen.assets import card_triangles, ply_bytes

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
GREY = 0.6
RHO = float(srgb_to_linear(np.array(GREY)))
LUX = 100.0
TILTED = np.array([0.3, 0.5, 0.0])
TILTED[2] = np.sqrt(1 - TILTED @ TILTED)
"""To the right of the picture, up, and out of it."""
LIGHTS_GO = [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (0.0, 1.0, 1.0), (0.0, -1.0, 1.0)]
SHAPES: dict[str, dict[str, Any]] = {
    "card": {"type": "card", "width_mm": 100.0, "height_mm": 100.0},
    "box": {"type": "box", "width_mm": 100.0, "height_mm": 100.0, "depth_mm": 20.0},
    "sphere": {"type": "sphere", "radius_mm": 100.0},
    "cylinder": {"type": "cylinder", "radius_mm": 100.0, "length_mm": 100.0},
    "mesh": {"type": "mesh", "file": "flat.ply"},
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "flat.ply").write_bytes(ply_bytes(card_triangles(100.0, 100.0)))
    stored = np.round((TILTED + 1) / 2 * 255).astype(np.uint8)
    Image.fromarray(np.tile(stored, (4, 4, 1))).save(tmp_path / "tilted.png")
    return tmp_path


def tilted(shape: str, **material: Any) -> dict[str, Any]:
    return {
        "name": "thing",
        "position_mm": (0.0, 0.0, 500.0),
        "shape": SHAPES[shape],
        "material": {"reflectance": [GREY] * 3, "normal_map": "tilted.png", **material},
    }


def parallel(direction: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "directional", "direction": direction, "illuminance_lux": LUX}


def expected(direction: tuple[float, ...]) -> float:
    """Radiance of what faces the cameras, in light that goes so; up is -Y, out of the picture -Z."""
    normal, light = TILTED * [1, -1, -1], np.array(direction)
    return RHO / np.pi * LUX * max(float(-light @ normal / np.linalg.norm(light)), 0.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_middle_of_a_shape_is_lit_as_if_it_were_tilted(shape: str, folder: Path) -> None:
    # The middle 0.5 mm, so that round things are flat there.
    grid = film(4, 4, focal_mm=4000.0)
    for direction in LIGHTS_GO:
        view = seen(build_scene([tilted(shape)], [parallel(direction)], folder=folder), grid, 64)
        # Components are stored to 1/255: of a cosine of 0.3 or more that is 2 %.
        np.testing.assert_allclose(view.mean(), expected(direction), rtol=0.02)
    radiances = [expected(direction) for direction in LIGHTS_GO]
    assert min(abs(a / b - 1) for a, b in itertools.pairwise(radiances)) > 0.05


def test_tilts_are_the_same_in_spectra(folder: Path) -> None:
    direction = LIGHTS_GO[1]
    grey = {"reflectance": {"wavelength_nm": (400, 700), "value": (RHO, RHO)}}
    thing = tilted("card", **grey)
    built = build_scene([thing], [parallel(direction)], folder=folder, spectral=True)
    view = seen(built, film(8, 8, focal_mm=2000.0), 256)
    np.testing.assert_allclose(view.mean(), expected(direction), rtol=0.02)


def test_a_flat_map_changes_nothing(tmp_path: Path) -> None:
    Image.fromarray(np.tile(np.array([128, 128, 255], np.uint8), (2, 2, 1))).save(tmp_path / "flat.png")
    light = [parallel(LIGHTS_GO[3])]
    grid = film(8, 8, focal_mm=100.0)
    flat = seen(build_scene([tilted("card", normal_map="flat.png")], light, folder=tmp_path), grid, 64)
    without = seen(build_scene([tilted("card", normal_map=None)], light), grid, 64)
    # 128 of 255 is 0.004 beside the middle.
    np.testing.assert_allclose(flat.mean(), without.mean(), rtol=0.01)
