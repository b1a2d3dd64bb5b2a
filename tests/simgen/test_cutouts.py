"""Opacity: holes that an image cuts are holes to rays and truth, where the image says."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import EVENLY, build_scene, card, film
from PIL import Image
from scipy.ndimage import label

from pcii.base import InputError
from simgen.assets import Triangles, box, card_triangles, cut_out, cylinder
from simgen.spec import Material
from simgen.truth import first_hits_at_centre


def area(mesh: Any) -> float:
    corner = mesh.positions.astype(np.float64)[mesh.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return float(np.linalg.norm(across, axis=1).sum() / 2)


def disc(side: int, radius: float) -> np.ndarray:
    """An opacity that is a half at `radius` (of the image's width) from the middle and falls outwards."""
    y, x = (np.mgrid[:side, :side] + 0.5) / side - 0.5
    return np.clip(0.5 + radius - np.hypot(x, y), 0, 1)


def test_a_disc_is_cut_where_its_opacity_is_a_half() -> None:
    mesh: Any = cut_out(card_triangles(200.0, 100.0), disc(64, 0.3), tiled=False)
    # Chords of 1/64 of the width, less than 1e-3; pieces overlap by a thousandth of a pixel.
    assert area(mesh) == pytest.approx(np.pi * 0.3**2 * 200 * 100, rel=2e-3)
    x, y = mesh.positions[:, 0] / 200, mesh.positions[:, 1] / 100
    assert np.hypot(x, y).max() == pytest.approx(0.3, abs=1e-4)
    np.testing.assert_allclose(mesh.texcoords, np.stack([x + 0.5, 0.5 - y], axis=-1), atol=1e-6)


@pytest.mark.parametrize("shape", [box(30.0, 20.0, 10.0), cylinder(10.0, 40.0)], ids=["box", "cylinder"])
def test_what_is_kept_and_what_is_cut_are_the_whole(shape: Triangles) -> None:
    opacity = np.random.default_rng(3).random((12, 9))
    parts = [area(cut_out(shape, one, tiled=False)) for one in (opacity, 1 - opacity)]
    assert sum(parts) == pytest.approx(area(shape), rel=6e-3)
    assert min(parts) > 0.2 * area(shape)
    assert area(cut_out(shape, np.ones((5, 5)), tiled=False)) == area(shape)
    assert cut_out(shape, np.zeros((5, 5)), tiled=False) is None


def test_beyond_its_borders_an_image_is_repeated_or_goes_on() -> None:
    top_left = np.outer([1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0])
    wide: Any = card_triangles(200.0, 100.0)
    twice = Triangles(wide.positions, wide.faces, None, 2 * wide.texcoords)
    once: Any
    once, again = (cut_out(twice, top_left, tiled=tiled) for tiled in (False, True))
    # In pixels: two columns of five rows, or two columns of one row in four places; a line across the middle
    # of a corner's cell takes an eighth of a pixel from each corner.
    pixel = 200 / 8 * 100 / 8
    assert area(once) == pytest.approx((2 * 5 - 1 / 8) * pixel, rel=3e-3)
    assert area(again) == pytest.approx(4 * (2 * 1 - 4 / 8) * pixel, rel=6e-3)
    assert np.ptp(once.positions, axis=0) == pytest.approx([50, 62.5, 0], rel=3e-3)


def leaf(**material: Any) -> dict[str, Any]:
    return card(400.0, 200.0, {"reflectance": [0.9, 0.2, 0.2], "opacity": "a.png", **material}, "leaf")


@pytest.mark.renders
def test_truth_is_what_lies_behind_a_hole(tmp_path: Path) -> None:
    """A ring: the wall is seen through it, and around it."""
    grid = film(96, 96, focal_mm=192.0)
    y, x = (np.mgrid[:256, :256] + 0.5) / 256 - 0.5
    ring = np.clip(0.5 + 0.1 - np.abs(np.hypot(x, y) - 0.3), 0, 1)
    Image.fromarray((ring * 65535).astype(np.uint16)).save(tmp_path / "a.png")
    built = build_scene([leaf(), card(600.0, 400.0, {"reflectance": [0.5] * 3})], [EVENLY], folder=tmp_path)
    hits = first_hits_at_centre(built, grid)
    row, col = (np.mgrid[:96, :96] - 47.5) / 192 * 400 / 200  # in widths of the leaf
    away = np.abs(np.hypot(row, col) - 0.3) - 0.1
    sure = np.abs(away) > 1e-4
    np.testing.assert_array_equal(hits.object_id[sure], np.where(away < 0, 1, 2)[sure])
    np.testing.assert_allclose(hits.z_mm[sure], np.where(away < 0, 400, 600)[sure], rtol=1e-6)


@pytest.mark.renders
@pytest.mark.parametrize("scale", [1, 16])
def test_no_ray_slips_between_the_pieces(tmp_path: Path, scale: int) -> None:
    """A gap would be a hole of a pixel or two beside those of the image; it would lie askew."""
    grid = film(400, 400, focal_mm=2000.0)
    opacity = np.full((256, 256), 255, np.uint8)
    for i, j in np.ndindex(3, 3):
        opacity[8 + i :: 16, 8 + j :: 16] = 0
    Image.fromarray(opacity).save(tmp_path / "a.png")
    thing = leaf() | {"rotation_deg": (20.0, 30.0, 40.0), "position_mm": (0.0, 0.0, 400.0 * scale)}
    thing["shape"] = {"type": "card", "width_mm": 200.0 * scale, "height_mm": 200.0 * scale}
    hits = first_hits_at_centre(build_scene([thing], [EVENLY], folder=tmp_path), grid)
    numbers = np.zeros(hits.object_id.shape, np.int64)
    label(hits.object_id == 0, output=numbers)
    sizes = np.bincount(numbers.ravel())
    for side in (numbers[0], numbers[-1], numbers[:, 0], numbers[:, -1]):
        sizes[side] = 0  # cut by the frame, or no hole
    sizes = sizes[sizes > 0]
    assert len(sizes) > 10
    assert sizes.min() > 0.5 * np.median(sizes)


@pytest.mark.renders
def test_what_cannot_be_cut_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(tmp_path / "a.png")
    ball = leaf() | {"shape": {"type": "sphere", "radius_mm": 9.0}}
    with pytest.raises(InputError, match=r"object 'leaf', material.opacity: it cannot be laid on a sphere"):
        build_scene([ball], [EVENLY], folder=tmp_path)
    Image.fromarray(np.full((4, 4), 100, np.uint8)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"object 'leaf', material.opacity: leaves nothing of the surface"):
        build_scene([leaf()], [EVENLY], folder=tmp_path)
    with pytest.raises(ValueError, match="opacity: a surface that light passes through"):
        Material.model_validate({"finish": {"type": "glass"}, "opacity": "a.png"})
