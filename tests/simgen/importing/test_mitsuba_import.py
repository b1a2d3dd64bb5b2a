"""Mitsuba scene files as scenes: numbers worked out by hand, and what is said of the rest."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mitsuba_elements import (
    GGX,
    MATT,
    RAW,
    bitmap,
    bsdf,
    emitter,
    flag,
    look,
    move,
    number,
    point,
    rgb,
    rotate,
    scale,
    shape,
    spectrum,
    text,
    to_uv,
    to_world,
    vector,
)
from PIL import Image

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE, linear_to_srgb
from simgen.importing import mitsuba_objects
from simgen.importing.scene_import import import_scene
from simgen.spec.scene import Scene, load_scene

EYE = f'<sensor type="perspective">{to_world(look("0 0 -4", "0 0 0"))}</sensor>'
BACKS = "backs of surfaces without a twosided bsdf, which are black: they look like the fronts"
DARK = "the file has no light: the scene is lit evenly from all around"
GREYS = np.array([[10, 200], [90, 30]], np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With a picture a.png in it."""
    Image.fromarray(GREYS).save(tmp_path / "a.png")
    return tmp_path


def imported(content: str, folder: Path, **options: Any) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a file with this in it and a camera at z = -4, and what could not be represented."""
    (folder / "a.xml").write_text(f'<scene version="3.0.0">{EYE}{content}</scene>')
    said = import_scene(folder / "a.xml", folder / "scene", **options)
    return load_scene(str(folder / "scene"))[0], said.left_out


def test_plain_shapes_become_spheres_cards_and_boxes(tmp_path: Path) -> None:
    ball = shape(
        *("sphere", point("center", "1 2 3"), number("radius", 2), to_world(scale("0.5"))), name="a ball"
    )
    card = shape("rectangle", to_world(scale("3 2 1"), rotate("y", 180)))
    box = shape("cube", to_world(scale("1 2 3")))
    scene, _ = imported(ball + card + shape("rectangle", flag("flip_normals")) + box, tmp_path, unit="cm")
    first, second, third, fourth = scene.objects
    # The camera looks along +Z with X to its left: X and Y are turned round, and depth begins at -4 cm.
    assert (first.name, first.position_mm) == ("a-ball", (-5.0, -10.0, 55.0))
    assert first.shape.model_dump() == {"type": "sphere", "radius_mm": 10.0}
    assert second.shape.model_dump() == {"type": "card", "width_mm": 60.0, "height_mm": 40.0}
    # One is turned towards the camera, the other faces it by its flipped normal.
    np.testing.assert_allclose(np.mod([second.rotation_deg[:2], third.rotation_deg[:2]], 360), 0, atol=1e-6)
    expected = {"type": "box", "width_mm": 20.0, "height_mm": 40.0, "depth_mm": 60.0}
    assert fourth.shape.model_dump() == expected
    assert [thing.name for thing in scene.objects] == ["a-ball", "rectangle", "rectangle-2", "cube"]


def test_what_is_sheared_turned_inside_out_or_pictured_becomes_a_mesh(folder: Path) -> None:
    pictured = bsdf("diffuse", bitmap("reflectance", "a.png"))
    sheared = to_world(rotate("z", 30), scale("2 1 1"))
    lamp = emitter("area") + flag("flip_normals")
    shapes = [shape(type_, more) for type_ in ("sphere", "cube") for more in (sheared, lamp, pictured)]
    shapes += [shape("rectangle", more) for more in (sheared, pictured)]
    scene, _ = imported("".join(shapes), folder)
    assert {thing.shape.type for thing in scene.objects} == {"mesh"}


def test_instances_share_a_mesh_and_scenes_without_a_camera_stand_upright(tmp_path: Path) -> None:
    (tmp_path / "tree.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n")
    group = '<shape type="shapegroup" id="g">{}</shape>'
    content = group.format(shape("obj", text("filename", "tree.obj"), to_world(scale("2"))))
    for name, step in (("tree 1", move("0 0 0")), ("tree 2", move("10 0 0")), ("flat", scale("0 1 1"))):
        content += shape("instance", '<ref id="g"/>', to_world(step), name=name)
    scene, left_out = imported(content, tmp_path, place_at_mm=(0.0, 0.0, 5000.0))
    assert [thing.name for thing in scene.objects] == ["tree-1", "tree-2"]
    assert {getattr(thing.shape, "file", None) for thing in scene.objects} == {"tree.ply"}
    # 12 by 4 units about the middle, Y up.
    places = [thing.position_mm for thing in scene.objects]
    np.testing.assert_allclose(places, [(-6000, 2000, 5000), (4000, 2000, 5000)])
    assert left_out == (BACKS, "'flat', which is scaled to nothing", DARK)


@pytest.mark.parametrize(
    ("surface", "finish"),
    [
        (bsdf("roughplastic", GGX, number("alpha", 0.2)), {"type": "plastic", "roughness": 0.2}),
        (
            bsdf("roughconductor", GGX, text("material", "W")),
            {"type": "metal", "name": "W", "roughness": 0.1},
        ),
        (
            bsdf("roughconductor", GGX, text("material", "Ir"), number("alpha", 0.36)),
            {"type": "principled", "metallic": 1.0, "roughness": 0.6},
        ),
        (
            bsdf("dielectric", text("int_ior", "Water"), number("ext_ior", 1)),
            {"type": "glass", "refractive_index": 1.333},
        ),
        (
            bsdf("roughdielectric", GGX, number("alpha", 0.25), number("int_ior", 1.5), number("ext_ior", 1)),
            {"type": "principled", "roughness": 0.5, "transmission": 1.0, "refractive_index": 1.5},
        ),
        (
            # 0.08 times 0.8 is ((n - 1) / (n + 1))^2.
            bsdf("principled", number("metallic", 0.2), number("roughness", 0.3), number("specular", 0.8)),
            {"type": "principled", "metallic": 0.2, "roughness": 0.3, "refractive_index": 1.677312},
        ),
    ],
)
def test_finishes(tmp_path: Path, surface: str, finish: dict[str, Any]) -> None:
    scene, left_out = imported(shape("sphere", surface), tmp_path)
    made = scene.objects[0].material.finish.model_dump()
    assert {name: made[name] for name in finish} == pytest.approx(finish, abs=1e-6)
    by_schlick = finish.get("metallic") == 1
    assert (len(left_out), left_out[-1]) == (1 + by_schlick, DARK)


def test_colours(tmp_path: Path) -> None:
    plain = bsdf("diffuse", rgb("reflectance", ".5 .1 .9"))
    table = bsdf("diffuse", spectrum("reflectance", "350:.1, 500:.5, 600:.9"))
    scene, _ = imported(shape("sphere", plain) + shape("sphere", table), tmp_path)
    one, other = (thing.material.model_dump()["reflectance"] for thing in scene.objects)
    assert one == pytest.approx(linear_to_srgb(np.array([0.5, 0.1, 0.9])), abs=1e-6)
    # Beyond its end, where scenes go on with the last value, it is 0.
    assert other["wavelength_nm"] == pytest.approx((350, 500, 600, 600), abs=1e-5)
    assert other["value"] == (0.1, 0.5, 0.9, 0.0)


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (bsdf("twosided", MATT, bsdf("plastic")), "backs of surfaces that differ"),
        (bsdf("roughplastic"), "Beckmann's microfacets"),
        (bsdf("roughplastic", GGX, flag("nonlinear")), "nonlinear of roughplastic"),
        (bsdf("roughplastic", GGX, number("int_ior", 1.9)), "indices of plastic other"),
        (bsdf("conductor"), "perfectly smooth"),
        (bsdf("roughconductor", GGX, number("alpha_u", 0.3)), "wider in one direction"),
        (bsdf("dielectric", number("specular_reflectance", 0.5)), "specular_reflectance of dielectric"),
        (bsdf("dielectric", number("int_ior", 4)), "that are not from 1.01 to 3.0"),
        (bsdf("thindielectric"), "thin panes that are no rectangles"),
        (bsdf("principled", number("sheen", 0.5)), "sheen of principled"),
        (bsdf("mask", number("opacity", 0.7), MATT), "partly clear"),
        (bsdf("bumpmap", bitmap("height", "a.png"), MATT), "bumps"),
        (
            bsdf("diffuse", bitmap("reflectance", "a.png", text("filter_type", "nearest"))),
            "sharp borders of pixels",
        ),
        (
            bsdf("diffuse", bitmap("reflectance", "a.png", text("wrap_mode", "mirror"))),
            "repetition of a picture mirrored",
        ),
        (
            bsdf(
                "principled",
                bitmap("base_color", "a.png"),
                bitmap("roughness", "a.png", to_uv(scale("2"))),
            ),
            "pictures of roughness that are laid out unlike",
        ),
    ],
)
def test_what_is_lost_of_a_surface_is_said_once(folder: Path, surface: str, said: str) -> None:
    scene, left_out = imported(2 * shape("sphere", surface), folder)
    assert len(scene.objects) == 2
    (lost,) = set(left_out) - {DARK}
    assert said in lost
    assert len(left_out) == 2


@pytest.mark.parametrize("opacity", [number("opacity", 0.2), bitmap("opacity", "a.png", to_uv(scale("0.1")))])
def test_what_is_all_clear_is_left_out(folder: Path, opacity: str) -> None:
    Image.fromarray(GREYS // 2).save(folder / "a.png")
    scene, left_out = imported(shape("sphere") + shape("cube", bsdf("mask", opacity, MATT)), folder)
    assert [thing.name for thing in scene.objects] == ["sphere"]
    assert "surfaces that are all clear" in left_out


def test_holes_are_where_the_linear_value_is_below_a_half(tmp_path: Path) -> None:
    # As sRGB 188 is 0.503 and 187 is 0.497; of raw numbers 128 is the first above a half.
    for name, below in (("a.png", 187), ("b.png", 127)):
        Image.fromarray(np.array([[0, below], [below + 1, 255]], np.uint8)).save(tmp_path / name)
    masks = bitmap("opacity", "a.png"), bitmap("opacity", "b.png", RAW)
    shapes = [shape("rectangle", bsdf("mask", mask, MATT)) for mask in masks]
    scene, _ = imported("".join(shapes), tmp_path)
    for thing in scene.objects:
        assert thing.material.opacity is not None
        stored = np.array(Image.open(tmp_path / "scene" / thing.material.opacity)) / 65535
        np.testing.assert_array_equal(stored >= 0.5, [[False, False], [True, True]])


def test_pictures_are_tiled_only_where_they_are_passed(folder: Path) -> None:
    larger, clamp = to_uv(scale("2")), text("wrap_mode", "clamp")
    pictures = [bitmap("reflectance", "a.png", more) for more in ("", larger, larger + clamp)]
    scene, _ = imported("".join(shape("rectangle", bsdf("diffuse", one)) for one in pictures), folder)
    assert [thing.material.tiled for thing in scene.objects] == [False, True, False]
    (file,) = (folder / "scene").glob("*.png")
    np.testing.assert_array_equal(np.array(Image.open(file))[..., 0], GREYS)


def test_lights_have_mitsubas_numbers(tmp_path: Path) -> None:
    lights = [
        emitter("point", point("position", "1 2 0"), rgb("intensity", "100 50 25")),
        emitter("spot", number("cutoff_angle", 20), number("intensity", 7)),
        emitter("directional", vector("direction", "0 -3 0"), number("irradiance", 5)),
        emitter("constant", number("radiance", 3)),
        emitter("point", number("intensity", 0)),
    ]
    lamp = shape("sphere", emitter("area", rgb("radiance", "4 2 2")))
    scene, left_out = imported(lamp + "".join(lights), tmp_path, unit="cm")
    first, spot, sun, even = (light.model_dump() for light in scene.lights)
    light = np.array([100.0, 50.0, 25.0])
    # In cm: a square unit is 1e-4 m^2.
    assert first["intensity_cd"] == pytest.approx(light @ LUMINANCE * 1e-4)
    assert first["illuminant"] == pytest.approx(linear_to_srgb(light / 100), abs=1e-6)
    assert first["position_mm"] == (-10.0, -20.0, 40.0)
    assert (spot["beam_deg"], spot["cutoff_deg"]) == (15.0, 20.0)
    assert spot["intensity_cd"] == pytest.approx(7e-4)
    np.testing.assert_allclose(np.subtract(spot["target_mm"], spot["position_mm"]), (0, 0, 100))
    assert (sun["illuminance_lux"], sun["direction"]) == (5.0, (0.0, 1.0, 0.0))
    assert (even["type"], even["luminance_cd_m2"], even["illuminant"]) == ("uniform", 3.0, "D65")
    emission = scene.objects[0].material.emission
    assert emission is not None
    assert emission.luminance_cd_m2 == pytest.approx(np.array([4.0, 2.0, 2.0]) @ LUMINANCE)
    assert left_out == ()


def test_lamps_may_share_a_light_that_stands_in_the_scene(tmp_path: Path) -> None:
    light = emitter("area", number("radiance", 3)).replace("<emitter", '<emitter id="light"', 1)
    scene, _ = imported(light + 2 * shape("sphere", '<ref id="light"/>'), tmp_path)
    found = [thing.material.emission for thing in scene.objects]
    assert [one and one.luminance_cd_m2 for one in found] == [3.0, 3.0]
    assert scene.lights == ()


def test_cameras(tmp_path: Path) -> None:
    angle = number("fov", 50)
    near = f'<sensor type="thinlens" id="near">{angle}{number("aperture_radius", 1)}</sensor>'
    other = f'<sensor type="perspective">{angle}{text("fov_axis", "y")}</sensor>'
    (tmp_path / "a.xml").write_text(f'<scene version="3.0.0">{shape("sphere")}{near}{other}</scene>')
    scene = mitsuba_objects.foreign_mitsuba(tmp_path / "a.xml", 1.0)
    assert [(view.name, view.angle_deg) for view in scene.viewpoints] == [("near", 50.0), ("camera 2", None)]
    np.testing.assert_array_equal(scene.viewpoints[0].matrix, np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert scene.left_out == ["apertures of cameras, which recipes set"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (shape("sphere", bsdf("conductor", text("material", "Augh"))), "no metal 'Augh'; did you mean 'Au'?"),
        (shape("sphere", bsdf("dielectric", text("int_ior", "gin"))), "no substance 'gin'"),
        (shape("sphere", bsdf("dielectric", number("int_ior", 0))), "above 0"),
        (shape("cylinder", point("p1", "0 0 0")), "'p1' must not be at 'p0'"),
        (emitter("directional", vector("direction", "0 0 0")), "must not be 0 0 0"),
        (emitter("spot", to_world(scale("0"))), "leaves this light no direction"),
        (2 * emitter("constant"), "one light from all around"),
        (emitter("constant", bitmap("radiance", "a.png")), "not a texture"),
        (shape("ply", text("filename", "a.png")), "not named .ply or .obj"),
        (shape("disk", bsdf("diffuse", bitmap("reflectance", "a.xml"))), "PNG"),
        (emitter("envmap", text("filename", "a.png")), "OpenEXR"),
    ],
)
def test_what_cannot_be_imported_is_named(folder: Path, content: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        imported(content, folder)
    sentence = str(caught.value)
    assert sentence.startswith(str(folder))
    assert sentence.isprintable()
    assert said in sentence


def test_no_more_shapes_and_triangles_than_a_scene_may_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    group = f'<shape type="shapegroup" id="g">{20 * shape("sphere")}</shape>'
    with pytest.raises(InputError, match="has more than 1000 shapes, instances of a group included"):
        imported(group + 51 * shape("instance", '<ref id="g"/>'), tmp_path)
    monkeypatch.setattr(mitsuba_objects, "MOST_FACES", 2000)
    with pytest.raises(InputError, match="has more than 2000 triangles"):
        imported(shape("disk") + shape("cylinder"), tmp_path)
