"""Boxes, cylinders and meshes: exact depth, and pictures upright on every shape."""

from pathlib import Path

import numpy as np
import pytest
from lit_scenes import EVENLY, MATT, build_scene, card
from PIL import Image

from pcii.base import InputError
from pcii.types import CameraGrid
from simgen.renderer import RenderScene, render_view
from simgen.truth import FirstHits, first_hits_at_centre

pytestmark = pytest.mark.renders
H, W, PIXEL, FOCAL = 90, 120, 0.0704, 50.0
GRID = CameraGrid(rows=1, cols=1, pitch_mm=(5.0, 5.0), focal_mm=FOCAL, pixel_mm=PIXEL, height=H, width=W)
QUADRANTS = {"texture": "quadrants.png"}
COLOURS = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]], np.uint8)
Vector = tuple[float, float, float]


def placed(
    folder: Path, shape: dict, material: dict = MATT, at: Vector = (0, 0, 600), turn: Vector = (0, 0, 0)
) -> RenderScene:
    """The shape alone in even light; the picture is red and green above, blue and white below."""
    Image.fromarray(COLOURS.repeat(32, axis=0).repeat(32, axis=1)).save(folder / "quadrants.png")
    thing = {"name": "thing", "position_mm": at, "rotation_deg": turn, "shape": shape, "material": material}
    return build_scene([card(9000, 1.0, name="other"), thing], [EVENLY], folder=folder)


def rays() -> np.ndarray:
    """Directions (H, W, 3) of the pixels' centres, with z = 1."""
    v, u = np.meshgrid(np.arange(H) - (H - 1) / 2, np.arange(W) - (W - 1) / 2, indexing="ij")
    return np.stack([u * PIXEL / FOCAL, v * PIXEL / FOCAL, np.ones((H, W))], axis=-1)


def hits_of(built: RenderScene) -> FirstHits:
    hits = first_hits_at_centre(built, GRID)
    assert built.names[2] == "thing"
    return hits


def same_depth(hits: FirstHits, expected: np.ndarray, sure: np.ndarray) -> None:
    """Float32 rays and vertices leave about 1e-6 of relative error."""
    np.testing.assert_allclose(hits.z_mm[sure], expected[sure], rtol=1e-5)
    np.testing.assert_array_equal(hits.object_id[sure] == 2, np.isfinite(expected[sure]))
    assert np.isfinite(expected[sure]).sum() > 500


@pytest.mark.parametrize("turn", [0.0, 35.0])
def test_a_boxs_depth_is_exact(turn: float, tmp_path: Path) -> None:
    size, centre = np.array([50.0, 30.0, 40.0]), np.array([8.0, -5.0, 600.0])
    shape = {"type": "box", "width_mm": size[0], "height_mm": size[1], "depth_mm": size[2]}
    hits = hits_of(placed(tmp_path, shape, at=(8, -5, 600), turn=(0, turn, 0)))
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    to_axes = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])  # from the world's axes to the box's
    start, along = to_axes @ -centre, rays() @ to_axes.T
    with np.errstate(divide="ignore"):
        sides = (np.array([-1, 1])[:, None, None, None] * size / 2 - start) / along
    near, far = sides.min(axis=0).max(axis=-1), sides.max(axis=0).min(axis=-1)
    # At an edge of the box a pixel's centre may fall on either side by rounding.
    same_depth(hits, np.where(near < far, near, np.inf), np.abs(far - near) > 1e-2)


@pytest.mark.parametrize("tilt", [0.0, 40.0, -40.0])
def test_a_cylinders_depth_is_exact_and_its_ends_are_closed(tilt: float, tmp_path: Path) -> None:
    radius, length, centre = 20.0, 30.0, np.array([8.0, -5.0, 600.0])
    shape = {"type": "cylinder", "radius_mm": radius, "length_mm": length}
    hits = hits_of(placed(tmp_path, shape, at=(8, -5, 600), turn=(tilt, 0, 0)))
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    to_axes = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    start, along = to_axes @ -centre, rays() @ to_axes.T
    a, b = (along[..., [0, 2]] ** 2).sum(-1), along[..., [0, 2]] @ start[[0, 2]]
    root = b**2 - a * ((start[[0, 2]] ** 2).sum() - radius**2)
    width = np.sqrt(np.maximum(root, 0))
    with np.errstate(divide="ignore"):
        ends = (np.array([-1, 1])[:, None, None] * length / 2 - start[1]) / along[..., 1]
    near = np.maximum((-b - width) / a, ends.min(axis=0))
    far = np.minimum((-b + width) / a, ends.max(axis=0))
    inside = (root > 0) & (near < far)
    # Near the outline depth has an infinite slope: chords and rounding show there.
    sure = (np.abs(root) > 1e-4 * b**2) & (np.abs(far - near) > 1e-2)
    same_depth(hits, np.where(inside, near, np.inf), sure)


def square(folder: Path) -> dict:
    """A square of 60 mm as a mesh, its texture coordinates from the lower left."""
    corners = [(-1, 1, 0, 0), (1, 1, 1, 0), (1, -1, 1, 1), (-1, -1, 0, 1)]  # Y is down
    text = "".join(f"v {x} {y} 0\nvt {u} {v}\n" for x, y, u, v in corners) + "f 1/1 2/2 3/3 4/4\n"
    (folder / "a.obj").write_text(text)
    return {"type": "mesh", "file": "a.obj", "scale": 30.0}


SHAPES: dict[str, dict] = {
    "card": {"type": "card", "width_mm": 60.0, "height_mm": 60.0},
    "sphere": {"type": "sphere", "radius_mm": 30.0},
    "cylinder": {"type": "cylinder", "radius_mm": 30.0, "length_mm": 60.0},
    "box": {"type": "box", "width_mm": 60.0, "height_mm": 60.0, "depth_mm": 60.0},
}
# Sides of a box, and ends of a cylinder: turned towards the cameras, how does their picture lie?
ABOUT_X: list[Vector] = [(90, 0, 0), (-90, 0, 0)]
ABOUT_Y: list[Vector] = [(0, 90, 0), (0, -90, 0), (0, 180, 0)]
TURNED = [*(("box", turn) for turn in ABOUT_Y + ABOUT_X), *(("cylinder", turn) for turn in ABOUT_X)]


@pytest.mark.parametrize(
    ("shape", "turn"),
    [*((name, (0, 0, 0)) for name in ("card", "sphere", "cylinder", "box", "mesh")), *TURNED],
)
def test_a_picture_is_upright_and_not_mirrored(shape: str, turn: Vector, tmp_path: Path) -> None:
    whole = SHAPES.get(shape) or square(tmp_path)
    built = placed(tmp_path, whole, QUADRANTS, turn=turn)
    image = render_view(built, GRID, 0, 0, samples_per_pixel=16, seed=3)
    lit = image > 0.3 * image.max()
    # 15 px, 12.7 mm, from the middle; the quadrants meet there.
    top, bottom, left, right = H // 2 - 15, H // 2 + 15, W // 2 - 15, W // 2 + 15
    assert lit[top, left].tolist() == [True, False, False]
    assert lit[top, right].tolist() == [False, True, False]
    assert lit[bottom, left].tolist() == [False, False, True]
    assert lit[bottom, right].tolist() == [True, True, True]
    if shape == "card":  # its uppermost row, where the bottom's blue must not leak in
        assert image[10, 30:60, 2].max() < 0.02 * image.max()


def test_a_picture_needs_texture_coordinates(tmp_path: Path) -> None:
    (tmp_path / "bare.obj").write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"object 'thing', material.texture: .* no texture coordinates"):
        placed(tmp_path, {"type": "mesh", "file": "bare.obj"}, QUADRANTS)


@pytest.mark.parametrize("scale", [1e9, 1e-9])
def test_a_meshs_size_must_make_sense(scale: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"object 'thing', shape.scale: .* mm are allowed"):
        placed(tmp_path, square(tmp_path) | {"scale": scale})
