"""Objects that shine: as an area light of the same size does, by colour and image, and photon by photon."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import LAMP, SCALAR, build_scene, card, film, seen, surprise, thinned
from PIL import Image

from pcii.base import LUMINANCE, InputError, srgb_to_linear
from simgen.assets import Triangles, ply_bytes
from simgen.renderer import backend, light_spectrum
from simgen.spectral import illuminant, integral, observer

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
GRID = film()
WALL = card(500.0, 600.0, {"reflectance": [0.6] * 3})
L = 1000.0


def shining(shape: dict[str, Any], emission: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A black object above the cameras' view that shines upon the wall."""
    material = {"reflectance": [0.0, 0.0, 0.0], "emission": {"luminance_cd_m2": L, **emission}}
    thing = {"name": "panel", "position_mm": (60.0, -250.0, 380.0), "shape": shape, "material": material}
    return thing | more


# Turned about X by 120 degrees a card, which faces -Z, faces the wall from above, at 60 degrees.
PANEL = shining({"type": "card", "width_mm": 90.0, "height_mm": 50.0}, {}, rotation_deg=(120.0, 0.0, 0.0))


def test_a_card_that_shines_is_an_area_light() -> None:
    towards = np.array([0.0, np.sin(np.radians(120)), -np.cos(np.radians(120))])
    target_mm = tuple(PANEL["position_mm"] + 100 * towards)
    lamp = LAMP | {"position_mm": PANEL["position_mm"], "target_mm": target_mm, "luminance_cd_m2": L}
    lamp |= {"width_mm": 90.0, "height_mm": 50.0}
    by_lamp, by_card = (
        seen(build_scene([WALL], [lamp]), GRID, 256),
        seen(build_scene([WALL, PANEL], []), GRID, 256),
    )
    assert by_lamp.mean() > 1
    np.testing.assert_allclose(by_card, by_lamp, rtol=0.04)
    np.testing.assert_allclose(by_card.mean(), by_lamp.mean(), rtol=2e-3)


@pytest.mark.skipif(SCALAR, reason="takes minutes without a compiled backend")
@pytest.mark.parametrize("kind", ["mesh with normals", "picture"])
def test_photons_follow_the_image(kind: str, tmp_path: Path) -> None:
    write_octahedron(tmp_path / "lamp.ply")
    mesh = {"type": "mesh", "file": "lamp.ply", "scale": [40.0, 40.0, -60.0]}
    thing = shining(mesh, {"illuminant": [1.0, 0.6, 0.3]})
    if kind == "picture":
        steps = np.arange(64, dtype=np.uint8).reshape(8, 8, 1) * np.array([1, 2, 4], np.uint8)
        Image.fromarray(steps).save(tmp_path / "a.png")
        thing = shining({"type": "card", "width_mm": 90.0, "height_mm": 50.0}, {"texture": "a.png"})
    # In sight, so that its own light is among what is counted.
    thing = thing | {"position_mm": (60.0, -120.0, 450.0)}
    built = build_scene([WALL, thing], [], max_depth=3, folder=tmp_path)
    view = seen(built, GRID, 1024)
    gain = 20_000 / view.mean() / GRID.height / GRID.width
    photons, _ = thinned(built, GRID, gain)
    assert abs(surprise(photons, view, GRID, gain)) < 4


def write_octahedron(path: Path) -> None:
    corners = np.vstack([np.eye(3), -np.eye(3)])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    path.write_bytes(ply_bytes(Triangles(corners, np.array(faces), corners)))


def test_the_level_counts_what_shines() -> None:
    """A ball behind the cameras lights the wall."""
    behind = shining({"type": "sphere", "radius_mm": 50.0}, {}) | {"position_mm": (0.0, 0.0, -200.0)}
    level = {"illuminance_lux": 300.0, "z_mm": 500.0}
    view = seen(build_scene([WALL, behind], [], level=level), GRID, 256)
    reflectance = float(srgb_to_linear(np.array(0.6)))
    assert view[15:17, 15:17].mean() == pytest.approx(reflectance / np.pi * 300, rel=0.01)


def test_an_image_shines_where_it_is_bright(tmp_path: Path) -> None:
    """Left red and at half the luminance, right black, against a red card of half the width."""
    half = round(255 * 0.735357)  # sRGB of 0.5
    Image.fromarray(np.array([[[half, 0, 0]] * 8 + [[0, 0, 0]] * 8] * 8, np.uint8)).save(tmp_path / "a.png")
    shape = {"type": "card", "width_mm": 200.0, "height_mm": 100.0}
    screen = shining(
        shape, {"texture": "a.png"}, rotation_deg=(180.0, 0.0, 0.0), position_mm=(0.0, -300.0, 300.0)
    )
    luminance = 0.5 * L * LUMINANCE[0]
    alone = shining(
        shape | {"width_mm": 100.0},
        {"illuminant": [1.0, 0.0, 0.0], "luminance_cd_m2": luminance},
        rotation_deg=(180.0, 0.0, 0.0),
        position_mm=(-50.0, -300.0, 300.0),
    )
    views = [seen(build_scene([WALL, thing], [], folder=tmp_path), GRID, 256) for thing in (screen, alone)]
    assert (views[0][..., 0] > 0).all()
    assert not views[0][..., 1:].any()
    np.testing.assert_allclose(views[0], views[1], rtol=0.1)
    np.testing.assert_allclose(views[0].mean(), views[1].mean(), rtol=0.01)


@pytest.mark.parametrize("colour", [(0.9, 0.5, 0.2), (0.2, 0.3, 1.0)])
def test_the_spectrum_of_a_colour_has_it(colour: tuple[float, float, float]) -> None:
    spectrum = light_spectrum(backend.load(), colour)
    rgb = srgb_to_linear(np.array(colour))
    seen_as = integral(observer() * spectrum)
    assert seen_as[1] == pytest.approx(integral(observer()[1] * illuminant("D65")))
    # From CIE XYZ to linear sRGB, as in IEC 61966-2-1.
    found = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]] @ seen_as
    np.testing.assert_allclose(found / found.max(), rgb / rgb.max(), atol=0.02)


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        ({"type": "box", "width_mm": 9.0, "height_mm": 9.0, "depth_mm": 9.0}, "several times"),
        ({"type": "mesh", "file": "lamp.ply"}, "no texture coordinates"),
    ],
)
def test_images_that_cannot_shine_are_refused(tmp_path: Path, shape: dict[str, Any], sentence: str) -> None:
    Image.fromarray(np.full((4, 4, 3), 255, np.uint8)).save(tmp_path / "a.png")
    write_octahedron(tmp_path / "lamp.ply")
    with pytest.raises(InputError, match=rf"object 'panel', material.emission.texture: .*{sentence}"):
        build_scene([shining(shape, {"texture": "a.png"})], [], folder=tmp_path)
