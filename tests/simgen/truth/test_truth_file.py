"""Truth: depth, normals, coverage, visibility and focus by hand, and what of it is on disk."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
import zarr
from lit_scenes import MATT, ball, card, evenly_lit, grid
from tiny import TINY_RECIPE
from twins import project_px

import simgen
from pcii.metrics import TrueFocus
from pcii.store import TRUTH, open_dataset
from pcii.types import CameraGrid, FocalPlanes, Truth
from simgen.cameras import as_rig
from simgen.dataset import generate
from simgen.renderer import RenderScene, backend, build, render_view
from simgen.spec import Recipe
from simgen.truth import (
    FirstHits,
    coverage,
    first_hits_at_centre,
    first_hits_of_view,
    in_focus,
    visible_views,
)

pytestmark = pytest.mark.renders
PLANES = {"z_mm": [540, 620]}


def make(out: Path, **products: object) -> zarr.Group:
    recipe = TINY_RECIPE | {"products": {"counts": False} | products, "analysis": PLANES}
    generate(Recipe.model_validate(recipe), Path(), out)
    return zarr.open_group(out / TRUTH, mode="r")


def array(group: zarr.Group, name: str) -> np.ndarray:
    return np.asarray(group[name][...])  # type: ignore[index]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("truth") / "whole"
    make(out, visibility=True, view_truth=True)
    return out


def test_every_pass_is_there_and_opens(whole: Path) -> None:
    dataset = open_dataset(whole)
    truth: Any = dataset.truth
    assert (truth.normal.shape, truth.normal.dtype) == ((64, 60, 3), np.float32)
    assert not truth.normal.flags.writeable
    assert truth.visible_views.max() == 6
    assert (truth.visible_views > 0).mean() > 0.99
    assert (truth.coverage[truth.object_id > 0] < 1).any()
    group = zarr.open_group(whole / TRUTH, mode="r")
    assert group.attrs["in_focus_z_mm"] == [540.0, 620.0]
    masks = TrueFocus(FocalPlanes.at_depths(dataset.grid, [540.0, 620.0]), truth).by_pixel
    np.testing.assert_array_equal(array(group, "in_focus"), masks)
    assert masks.any()
    work = {entry["what"]: entry["saved"] for entry in dataset.manifest["skipped"]}
    assert 0 < work["visibility of some points"] < 6 * 64 * 60


def test_passes_of_views_are_each_views_own(whole: Path) -> None:
    group = zarr.open_group(whole / TRUTH, mode="r")
    names = ("view_z_mm", "view_normal", "view_object_id", "view_coverage")
    depth, normal, ids, coverage = (array(group, name) for name in names)
    assert depth.shape == ids.shape == coverage.shape == (2, 3, 64, 60)
    assert normal.shape == (2, 3, 64, 60, 3)
    hit = np.isfinite(depth)
    np.testing.assert_allclose(np.linalg.norm(normal[hit], axis=-1), 1, atol=1e-5)
    # A camera further right sees the same object further LEFT.
    middle = [np.argwhere(ids[0, l] == 1)[:, 1].mean() for l in range(3)]
    assert middle[0] > middle[1] > middle[2]


@pytest.mark.parametrize(
    ("products", "arrays"),
    [
        ({}, {"z_mm", "object_id", "normal", "coverage", "in_focus"}),
        ({"truth": False, "view_truth": ["normal", "z_mm"]}, {"view_normal", "view_z_mm"}),
        ({"truth": False, "view_truth": ["coverage"]}, {"view_coverage"}),
    ],
)
def test_only_what_is_asked_for_is_kept(products: dict, arrays: set[str], tmp_path: Path) -> None:
    assert set(make(tmp_path / "out", **products).array_keys()) == arrays


def test_true_and_false_are_all_passes_and_none() -> None:
    every = ("z_mm", "object_id", "normal", "coverage")
    for value, passes in ((True, every), (False, ()), (["normal"], ("normal",))):
        recipe = Recipe.model_validate(TINY_RECIPE | {"products": {"view_truth": value}})
        assert recipe.products.view_truth == passes


def test_xarray_opens_the_truth_with_named_axes_and_units(whole: Path) -> None:
    truth = xarray.open_zarr(whole / TRUTH, consolidated=False)
    assert set(truth.sizes) == {"row", "col", "axis", "plane", "camera_row", "camera_col"}
    assert all(set(array.attrs) == {"unit", "meaning", "units", "long_name"} for array in truth.values())
    assert truth.z_mm.attrs["unit"] == "mm"
    np.testing.assert_array_equal(truth.z_mm.values, open_dataset(whole).truth.z_mm)  # type: ignore[union-attr]
    assert truth.view_z_mm.isel(camera_row=0, camera_col=1).sizes == {"row": 64, "col": 60}


CENTRE, RADIUS = np.array([20.0, -15.0, 650.0]), 60.0
ROUND = ball("ball", 20.0, 650.0, radius_mm=RADIUS, y_mm=-15.0)


def directions(of: CameraGrid, fine: int = 1) -> np.ndarray:
    """Rays (H, W, 3) of length 1 along Z through pixel centres, or of `fine` x `fine` cells of each pixel."""
    i = (np.arange(of.height * fine) + 0.5) / fine - of.height / 2
    j = (np.arange(of.width * fine) + 0.5) / fine - of.width / 2
    v, u = np.meshgrid(i * of.pixel_mm / of.focal_mm, j * of.pixel_mm / of.focal_mm, indexing="ij")
    return np.stack([u, v, np.ones_like(u)], axis=-1)


def on_sphere(rays: np.ndarray, centre: np.ndarray = CENTRE, radius: float = RADIUS) -> np.ndarray:
    """Depth of the first hit, inf for none, from the origin."""
    a, b, c = (rays**2).sum(-1), rays @ centre, centre @ centre - radius**2
    root = b * b - a * c
    return np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, np.inf)


def at_rim(rays: np.ndarray, centre: np.ndarray = CENTRE) -> np.ndarray:
    """Rays that float32 may or may not take past the sphere; there depth has an infinite slope."""
    a, b, c = (rays**2).sum(-1), rays @ centre, centre @ centre - RADIUS**2
    return np.abs(b * b - a * c) <= 1e-4 * b * b


@pytest.mark.parametrize("point", [(0.0, 0.0, 500.0), (60.0, -25.0, 600.0)])
def test_a_dot_appears_where_geometry_says(point: tuple[float, float, float]) -> None:
    # The dot is a card parallel to the sensor: its image is a square about its centre's image, evenly
    # lit (a ball's would be shaded, and pull the centroid). Its 20 pixels of 128 samples leave noise of
    # about 1.4 px x 0.6 / sqrt(2500) = 0.02 px.
    cameras = grid(2, 3, 100, 130, pixel_mm=0.1408)
    scene = evenly_lit([card(point[2], 8.0, at_mm=point[:2])])
    for k, l in ((0, 0), (0, 2), (1, 1)):
        image = render_view(scene, cameras, k, l, samples_per_pixel=128, seed=11).sum(axis=2)
        i, j = np.indices(image.shape)
        found = np.array([(i * image).sum(), (j * image).sum()]) / image.sum()
        np.testing.assert_allclose(found, project_px(cameras, point, k, l), atol=0.08)
        mirrored = project_px(cameras, point, 1 - k, 2 - l)  # the fault: signs of both axes swapped
        if (k, l) != (1, 1):
            assert np.abs(found - mirrored).max() > 1


def test_depth_is_planar_in_every_view() -> None:
    # The renderer's own depth counts from the near clip plane at 0.01 mm, 1.6e-5 of this one.
    of = grid(2, 2, 96, 120)
    rays = directions(of)
    scene = evenly_lit([ROUND], backdrop_mm=None)
    for k, l in np.ndindex(2, 2):
        hits = first_hits_of_view(scene, of, k, l)
        centre = CENTRE - [(l - 0.5) * 6.0, (k - 0.5) * 4.0, 0.0]
        expected, sure = on_sphere(rays, centre), ~at_rim(rays, centre)
        np.testing.assert_allclose(hits.z_mm[sure], expected[sure], rtol=1e-5)
        assert (hits.object_id[sure] == np.isfinite(expected)[sure]).all()
    # Turned by 25 degrees about X (down- to forward axis) the normal (0, 0, -1) becomes (0, sin, -cos).
    turn = np.radians(25)
    normal = np.array([0, np.sin(turn), -np.cos(turn)])
    slanted = first_hits_at_centre(evenly_lit([card(500.0, 900.0, turn_deg=(25, 0, 0))]), of)
    np.testing.assert_allclose(slanted.z_mm, 500.0 * normal[2] / (rays @ normal), rtol=1e-5)


def test_normals_are_the_surfaces_own_and_face_the_camera() -> None:
    of = grid(2, 2, 96, 120)
    rays = directions(of)
    hits = first_hits_at_centre(evenly_lit([ROUND], backdrop_mm=None), of)
    here = (hits.object_id == 1) & ~at_rim(rays)
    expected = (rays * on_sphere(rays)[..., None])[here] - CENTRE
    np.testing.assert_allclose(hits.normal[here], expected / RADIUS, atol=1e-4)
    assert (hits.normal[hits.object_id == 0] == 0).all()
    # A card from its front, and from behind (turned by 205 degrees): the same plane, the same normal.
    turn = np.radians(25)
    for degrees in (25.0, 205.0):
        slanted = first_hits_at_centre(evenly_lit([card(500.0, 900.0, turn_deg=(degrees, 0, 0))]), of)
        flat = slanted.normal.reshape(-1, 3)
        np.testing.assert_allclose(flat, np.tile([0, np.sin(turn), -np.cos(turn)], (len(flat), 1)), atol=1e-4)
    assert slanted.normal.dtype == np.float32


def test_no_ray_passes_where_triangles_meet(tmp_path: Path) -> None:
    """The four edges of a pyramid lie exactly on pixels' centres, in front of its base 60 mm behind."""
    corners = ["v -60 -60 60", "v 60 -60 60", "v 60 60 60", "v -60 60 60", "v 0 0 0"]
    faces = ["f 1 3 2", "f 1 4 3", *(f"f {one} {one % 4 + 1} 5" for one in range(1, 5))]
    (tmp_path / "pyramid.obj").write_text("\n".join(corners + faces))
    pyramid = {"name": "pyramid", "position_mm": (0, 0, 570), "material": {"reflectance": (1, 1, 1)}}
    of = grid(2, 2, 200, 200)
    pyramid |= {"shape": {"type": "mesh", "file": "pyramid.obj"}}
    hits = first_hits_at_centre(evenly_lit([pyramid], folder=tmp_path), of)
    slope = np.abs(directions(of)[..., :2]).max(axis=-1)
    expected = 570 / (1 - slope)  # |x| or |y| deep
    here = expected < 629
    np.testing.assert_allclose(hits.z_mm[here], expected[here], rtol=1e-5)
    assert (hits.object_id[here] == 1).all()
    towards = (hits.normal * directions(of)).sum(axis=-1)
    assert (towards[here] < 0).all()


def test_coverage_of_a_card_from_a_camera_off_the_centre() -> None:
    of = grid(2, 2, 60, 80)
    scene = evenly_lit([card(500.0, 33.0)])
    ids = first_hits_of_view(scene, of, 0, 1).object_id
    found = coverage(scene, as_rig(of).camera(0, 1), ids)
    spans = []
    for size, corner in ((60, -16.5 + 2.0), (80, -16.5 - 3.0)):
        low, high = (size - 1) / 2 + np.array([corner, corner + 33.0]) * 50 / (500 * 0.0704)
        at = np.arange(size)
        spans.append(np.clip(np.minimum(high, at + 0.5) - np.maximum(low, at - 0.5), 0, 1))
    expected = np.outer(*spans)
    np.testing.assert_allclose(found, np.where(ids == 1, expected, 1 - expected), atol=8 / 233)


def test_focus_is_what_the_score_takes_it_for() -> None:
    rng = np.random.default_rng(8)
    z = rng.uniform(400, 900, (30, 40)).astype(np.float32)
    z[0, :5] = np.inf
    planes = (450.0, 540.0, 620.0, 1e6)
    for rows, cols in ((10, 10), (2, 7), (9, 3), (1, 1)):
        of, truth = grid(rows, cols, 30, 40), Truth(z, np.zeros(z.shape, np.int16), {})
        expected = TrueFocus(FocalPlanes.at_depths(of, planes), truth).by_pixel
        np.testing.assert_array_equal(in_focus(of, z, planes), expected)
    assert in_focus(of, z, ()).shape == (0, 30, 40)


# Visibility: a small card before a smaller one, which the centre cannot see but which stands in the way of
# others; a ball; and a large slanted card behind everything.
CARDS = {
    "front": ((-10.0, 5.0, 300.0), 16.0, 0.0),
    "hidden": ((-11.0, 6.0, 330.0), 15.0, 0.0),
    "rear": ((0.0, 0.0, 600.0), 220.0, 20.0),
}
BALL, BALL_RADIUS = np.array([25.0, -8.0, 420.0]), 14.0


def occluders() -> RenderScene:
    cards = [
        card(z, size, MATT, name, (0, turn, 0), (x, y)) for name, ((x, y, z), size, turn) in CARDS.items()
    ]
    return evenly_lit([*cards, ball("ball", 25.0, 420.0, radius_mm=BALL_RADIUS, y_mm=-8.0)], backdrop_mm=None)


def slow_count(of: CameraGrid, point: np.ndarray, object_id: int) -> tuple[int, float]:
    """How many cameras see a point, shape by shape; and by how many mm the nearest decision was taken."""
    count, closest = 0, np.inf
    for k, l in np.ndindex(of.rows, of.cols):
        camera = np.array([(l - (of.cols - 1) / 2) * 6.0, (k - (of.rows - 1) / 2) * 4.0, 0.0])
        i, j = project_px(of, (point[0], point[1], point[2]), k, l)
        seen = -0.5 < i < of.height - 0.5 and -0.5 < j < of.width - 0.5
        away = camera - point
        for number, (at, size, turn) in enumerate(CARDS.values(), start=1):
            if number == object_id:
                continue
            c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
            normal, right = np.array([-s, 0, -c]), np.array([c, 0, -s])
            share = (normal @ (np.array(at) - point)) / (normal @ away)
            if 0 < share < 1:
                x, y = right @ (point + share * away - at), point[1] + share * away[1] - at[1]
                room = max(abs(x), abs(y)) - size / 2
                closest = min(closest, abs(room))
                seen &= room > 0
        if object_id == 4:
            facing = (point - BALL) @ away / np.linalg.norm(away)
            closest, seen = min(closest, abs(facing)), seen and facing > 0
        else:
            share = np.clip((BALL - point) @ away / (away @ away), 0, 1)
            room = np.linalg.norm(point + share * away - BALL) - BALL_RADIUS
            closest, seen = min(closest, abs(room)), seen and room > 0
        count += bool(seen)
    return count, float(closest)


def test_visibility_is_what_a_loop_over_cameras_and_shapes_counts() -> None:
    of = grid(5, 4, 22, 28, pixel_mm=0.36)
    scene = occluders()
    hits = first_hits_at_centre(scene, of)
    found, _ = visible_views(scene, of, hits)
    assert found.dtype == np.uint16
    assert 2 not in hits.object_id  # "hidden" is
    rays, compared = directions(of), 0
    for i, j in np.argwhere(np.isfinite(hits.z_mm)):
        expected, closest = slow_count(of, rays[i, j] * float(hits.z_mm[i, j]), int(hits.object_id[i, j]))
        if closest > 0.02:  # rays start 0.006 mm off the surface, and are rounded to float32
            assert found[i, j] == expected, (i, j)
            compared += 1
    assert compared > 0.9 * found.size
    assert set(np.unique(found)) >= {*range(8, 21)}  # from seen by few to seen by all
    assert (found[np.isinf(hits.z_mm)] == 0).all()


REFERENCE = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0,0,-1" target="0,0,-2" up="0,1,0"/></transform></sensor>
<shape type="sphere"><point name="center" x="-.03" y="-.02" z="-1.4"/>
<float name="radius" value=".03"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value=".3"/>
<translate z="-1.6"/></transform></shape>
<emitter type="constant"/></scene>"""


@pytest.mark.parametrize("is_reference", [False, True])
def test_no_ray_is_skipped_that_could_be_blocked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_reference: bool
) -> None:
    # Before a flat wall, whose own box stands in no way, and with cameras so wide apart that the edges of
    # the pyramids matter: a thin slanted card deep in Z, and a ball at the frame. Or a file of Mitsuba's,
    # whose axes and unit are not those of the world.
    of = replace(grid(3, 4, 44, 56, pixel_mm=0.18), pitch_mm=(15.0, 40.0))
    card_in_depth = card(450.0, 60.0, turn_deg=(75, 0, 0), at_mm=(-25.0, 20.0))
    at_the_frame = ball("ball", 40.0, 500.0, radius_mm=8.0, y_mm=-20.0)
    scene = evenly_lit([card_in_depth, at_the_frame], backdrop_mm=700.0)
    if is_reference:
        (tmp_path / "scene.xml").write_text(REFERENCE)
        world = simgen.load_scene({"title": "by reference", "mitsuba": "scene.xml"}, folder=tmp_path)
        scene = build(backend.load(), world, tmp_path, 2)
    hits = first_hits_at_centre(scene, of)
    views, traced = visible_views(scene, of, hits)
    of_all = "simgen.truth.truth_file._can_be_blocked"
    monkeypatch.setattr(of_all, lambda *given: np.ones(len(given[2]), dtype=bool))
    exhaustive, all_rays = visible_views(scene, of, hits)
    np.testing.assert_array_equal(views, exhaustive)
    assert exhaustive[np.isfinite(hits.z_mm)].min() < 12
    assert traced < 0.8 * all_rays


def test_a_ball_hides_its_own_far_side() -> None:
    # The cameras see up to 8 degrees round the rim. A ray that starts 0.006 mm above a ball of 60 mm would
    # look 0.8 degrees over its horizon.
    of = replace(grid(5, 4, 96, 120), pitch_mm=(60.0, 40.0))
    scene = evenly_lit([ROUND], backdrop_mm=None)
    hits = first_hits_at_centre(scene, of)
    wide = replace(of, height=960, width=1200)  # so large a film that nothing falls beside it
    hits_z = np.pad(hits.z_mm, ((432, 432), (540, 540)), constant_values=np.inf)
    normal = np.pad(hits.normal, ((432, 432), (540, 540), (0, 0)))
    ids = np.pad(hits.object_id, ((432, 432), (540, 540)))
    found, _ = visible_views(scene, wide, FirstHits(hits_z, ids, normal))
    rays = directions(of)
    point = rays * on_sphere(rays)[..., None]
    here = np.isfinite(point[..., 2]) & ~at_rim(rays)
    expected, sure = np.zeros(here.sum(), dtype=int), np.ones(here.sum(), dtype=bool)
    for k, l in np.ndindex(5, 4):
        camera = np.array([(l - 1.5) * 60.0, (k - 2) * 40.0, 0.0])
        away = camera - point[here]
        cosine = ((point[here] - CENTRE) * away).sum(-1) / RADIUS / np.linalg.norm(away, axis=-1)
        expected += cosine > 0
        sure &= np.abs(cosine) > 1e-4  # what float32 rounds of a normal
    np.testing.assert_array_equal(found[432:-432, 540:-540][here][sure], expected[sure])
    assert expected[sure].min() < 18  # of 20


def test_a_wall_alone_is_seen_by_all_whose_film_it_falls_on() -> None:
    of = grid(2, 3, 20, 30)
    scene = evenly_lit([], backdrop_mm=426.0)  # one step of 6 mm is 10.003 px there, of 4 mm 6.669 px
    found, traced = visible_views(scene, of, first_hits_at_centre(scene, of))
    cols = [sum(-0.5 < j - 10.003 * (l - 1) < 29.5 for l in range(3)) for j in range(30)]
    rows = [sum(-0.5 < i - 6.669 * (k - 0.5) < 19.5 for k in range(2)) for i in range(20)]
    np.testing.assert_array_equal(found, np.outer(rows, cols))
    assert traced == 0
