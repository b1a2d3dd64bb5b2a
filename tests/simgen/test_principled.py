"""Surfaces: the principled finish has the renderer's numbers and energy, and a normal map tilts its light."""

import itertools
from pathlib import Path
from typing import Any

import lit_scenes
import numpy as np
import pytest
from lit_scenes import EVENLY, build_scene, card, film, seen
from PIL import Image

from pcii.base import InputError, srgb_to_linear
from simgen.assets import card_triangles, ply_bytes
from simgen.renderer import RenderScene, backend

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
LAMP = {"type": "point", "position_mm": (150.0, -200.0, 50.0), "intensity_cd": 0.5}
COLOUR = (0.8, 0.5, 0.2)
GRID = film()
SAMPLES = 512
DEPTH = 6


def painted(finish: dict[str, Any], colour: tuple[float, ...] = COLOUR) -> dict[str, Any]:
    return {"reflectance": list(colour), "finish": {"type": "principled", **finish}}


def ball(material: dict[str, Any]) -> dict[str, Any]:
    return lit_scenes.ball("ball", 0, 400, radius_mm=90, **material)


def in_blocks(view: np.ndarray) -> np.ndarray:
    """Means of 4 x 4 pixels."""
    return view.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3))


def by_hand(parameters: dict[str, Any], *, clear: bool) -> RenderScene:
    """The ball before the card, described to the renderer directly."""
    mi = backend.load()
    surface: dict[str, Any] = {
        "type": "principled",
        "base_color": {"type": "rgb", "value": srgb_to_linear(np.array(COLOUR)).tolist()},
        **parameters,
    }
    surface = surface if clear else {"type": "twosided", "bsdf": surface}
    T = mi.ScalarTransform4f
    # A rectangle's face is towards +Z; half a turn about X shows it to the cameras.
    wall = T().translate([0, 0, 600]) @ T().rotate([1, 0, 0], 180) @ T().scale([150, 150, 1])
    grey, candela = ({"type": "rgb", "value": value} for value in (1.0, 0.5e6))
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH},
        "ball": {"type": "sphere", "center": [0, 0, 400], "radius": 90.0, "bsdf": surface},
        "card": {"type": "rectangle", "to_world": wall, "bsdf": surface},
        "around": {"type": "constant", "radiance": grey},
        "lamp": {"type": "point", "position": list(LAMP["position_mm"]), "intensity": candela},
    }
    return RenderScene(mi, mi.load_dict(scene), np.zeros(8, np.int16), {}, None, DEPTH)


NUMBERS = {"metallic": 0.8, "roughness": 0.2, "refractive_index": 2.2, "transmission": 0.7}
THEIR_NAMES = {"refractive_index": "eta", "transmission": "spec_trans"}


@pytest.mark.parametrize(
    "ours", [*({name: value} for name, value in NUMBERS.items()), {"clearcoat": 0.9, "clearcoat_gloss": 0.3}]
)
def test_each_number_does_what_it_does_to_the_renderers_own(ours: dict[str, float]) -> None:
    material, clear = painted(ours), "transmission" in ours
    built = build_scene([ball(material), card(600.0, 300.0, material)], [EVENLY, LAMP], max_depth=DEPTH)
    view = seen(built, GRID, SAMPLES)
    theirs = {"eta": 1.5, "roughness": 0.5} | {THEIR_NAMES.get(name, name): ours[name] for name in ours}
    same = seen(by_hand(theirs, clear=clear), GRID, SAMPLES, seed=2)
    # Blocks of 4 x 4 pixels of paths that vary by 1 or less of the mean, twice.
    first, second = in_blocks(view), in_blocks(same)
    np.testing.assert_allclose(first, second, rtol=5 * 2**0.5 / np.sqrt(16 * SAMPLES))
    np.testing.assert_allclose(view.mean(axis=(0, 1)), same.mean(axis=(0, 1)), rtol=3e-3)
    # The planted fault: the number does nothing.
    plain = seen(by_hand({"eta": 1.5, "roughness": 0.5}, clear=False), GRID, SAMPLES)
    assert np.abs(first / in_blocks(plain) - 1).max() > 5 * 2**0.5 / np.sqrt(16 * SAMPLES)


@pytest.mark.parametrize(("metallic", "roughness"), [(0.0, 0.05), (0.5, 0.3), (1.0, 1.0)])
def test_no_more_light_is_sent_back_than_comes(metallic: float, roughness: float) -> None:
    # White of no metal gains up to 10 % by the model, as docs/scenes.md says; a metal nothing at all.
    colour = (1.0,) * 3 if metallic == 1 else (0.95,) * 3
    for more in ({}, {"clearcoat": 1.0}) if metallic < 1 else ({},):
        material = painted({"metallic": metallic, "roughness": roughness, **more}, colour)
        view = seen(build_scene([ball(material)], [EVENLY], max_depth=DEPTH), GRID, 256)
        # 4 x 4 pixels of 256 paths that vary by 0.5 or less.
        assert in_blocks(view).max() < 1 + 5 * 0.5 / np.sqrt(4096)


@pytest.mark.parametrize(("bits", "field"), [(8, "metallic"), (16, "roughness")])
def test_an_image_holds_its_numbers_as_they_are(tmp_path: Path, bits: int, field: str) -> None:
    most = 2**bits - 1
    dark, bright = round(0.2 * most), round(0.8 * most)
    pixels = np.zeros((8, 8), np.uint8 if bits == 8 else np.uint16)
    pixels[:, :4], pixels[:, 4:] = dark, bright
    Image.fromarray(pixels).save(tmp_path / "numbers.png")

    def lit(finish: dict[str, Any]) -> np.ndarray:
        wall = card(400.0, 256.0, painted(finish))
        return seen(build_scene([wall], [EVENLY, LAMP], folder=tmp_path), GRID, SAMPLES)

    both = lit({field: "numbers.png"})
    # Away from the middle, where the image's two halves mix.
    for half, value in ((np.s_[:, :12], dark / most), (np.s_[:, 20:], bright / most)):
        alone = lit({field: value})
        np.testing.assert_allclose(both[half].mean(axis=(0, 1)), alone[half].mean(axis=(0, 1)), rtol=4e-3)


def test_a_coloured_image_of_numbers_is_named(tmp_path: Path) -> None:
    Image.fromarray(np.eye(3, dtype=np.uint8)[None] * 200).save(tmp_path / "coloured.png")
    with pytest.raises(InputError, match=r"object 'ball', material\.finish\.roughness: 'coloured\.png' is"):
        build_scene([ball(painted({"roughness": "coloured.png"}))], [EVENLY], folder=tmp_path)


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


@pytest.mark.parametrize(("shape", "spectral"), [*((shape, False) for shape in SHAPES), ("card", True)])
def test_the_middle_of_a_shape_is_lit_as_if_it_were_tilted(shape: str, spectral: bool, folder: Path) -> None:
    grey = {"wavelength_nm": (400, 700), "value": (RHO, RHO)} if spectral else [GREY] * 3
    # The middle 0.5 mm, so that round things are flat there.
    grid = film(4, 4, focal_mm=4000.0)
    for direction in LIGHTS_GO[1:2] if spectral else LIGHTS_GO:
        thing, light = tilted(shape, reflectance=grey), parallel(direction)
        built = build_scene([thing], [light], folder=folder, spectral=spectral)
        view = seen(built, grid, 1024 if spectral else 64)
        # Components are stored to 1/255: of a cosine of 0.3 or more that is 2 %.
        np.testing.assert_allclose(view.mean(), expected(direction), rtol=0.02)
    radiances = [expected(direction) for direction in LIGHTS_GO]
    assert min(abs(a / b - 1) for a, b in itertools.pairwise(radiances)) > 0.05


def test_a_flat_map_changes_nothing(tmp_path: Path) -> None:
    Image.fromarray(np.tile(np.array([128, 128, 255], np.uint8), (2, 2, 1))).save(tmp_path / "flat.png")
    light = [parallel(LIGHTS_GO[3])]
    grid = film(8, 8, focal_mm=100.0)
    flat = seen(build_scene([tilted("card", normal_map="flat.png")], light, folder=tmp_path), grid, 64)
    without = seen(build_scene([tilted("card", normal_map=None)], light), grid, 64)
    # 128 of 255 is 0.004 beside the middle.
    np.testing.assert_allclose(flat.mean(), without.mean(), rtol=0.01)
