"""Mitsuba scenes that are imported look as Mitsuba renders them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
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
    texture,
    to_uv,
    to_world,
    vector,
)
from mitsuba_views import unlike, views_of
from PIL import Image
from scipy.ndimage import gaussian_filter

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
RNG = np.random.default_rng(7)
BACKS = "backs of surfaces without a twosided bsdf, which are black: they look like the fronts"
SMOOTH = "perfectly smooth plastic and metal: its highlights have a width of 0.001"
WHITE = bsdf("diffuse", rgb("reflectance", ".73 .73 .71"))
GREEN = bsdf("diffuse", spectrum("reflectance", "400:.09, 500:.28, 540:.48, 580:.27, 640:.11, 700:.14"))
OUTSIDE: dict[str, Any] = {"eye": "278,273,-800", "target": "278,273,0", "fov": 39.3, "samples": 128}
WIDE_GGX = GGX + number("alpha", 0.3)
COLOURS = "colours.png"
ORANGE = ".8 .3 .1"


def cornell(red: float) -> str:
    """The box of Goral et al. (1984) as the Program of Computer Graphics at Cornell measured it, in mm."""
    wall, lamp = (
        bsdf("diffuse", rgb("reflectance", f"{red} .06 .05")),
        emitter("area", rgb("radiance", "17 12 4")),
    )
    down, up, far = "278 548.8 279.6", "278 0 279.6", "278 274.4 559.2"
    return "".join(
        shape(kind, surface, to_world(scale(size), rotate(axis, degrees), move(place)))
        for kind, surface, size, axis, degrees, place in (
            ("rectangle", WHITE, "276 280 1", "x", -90, up),
            ("rectangle", WHITE, "278 280 1", "x", 90, down),
            ("rectangle", WHITE, "278 274.4 1", "y", 180, far),
            ("rectangle", wall, "280 274.4 1", "y", -90, "552.8 274.4 279.6"),
            ("rectangle", GREEN, "280 274.4 1", "y", 90, "0 274.4 279.6"),
            ("rectangle", lamp, "65 52.5 1", "x", 90, "278 548.7 279.5"),
            ("cube", WHITE, "82.5", "y", -17, "186 82.5 169"),
            ("cube", WHITE, "82.5 165 82.5", "y", 22, "368 165 351"),
        )
    )


def test_a_cornell_box(tmp_path: Path) -> None:
    ours, theirs, left_out = views_of(cornell(0.63), tmp_path, **OUTSIDE)
    assert left_out == (BACKS,)
    # Their tables for the colour of a spectrum have other steps than ours.
    assert not unlike(ours, theirs, relative=2e-3).any()
    # The fault: a wall that is a tenth redder.
    (tmp_path / "other").mkdir()
    other, _, _ = views_of(cornell(0.7), tmp_path / "other", **OUTSIDE)
    assert unlike(other, theirs, relative=2e-3)[..., 0].sum() > 3


def sky(folder: Path, *steps: str) -> str:
    """A smooth image of light from all around."""
    pixels = gaussian_filter(RNG.random((16, 32, 3)), (2, 2, 0), mode="wrap") ** 3
    header = {"compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, {"RGB": pixels.astype(np.float32)}).write(str(folder / "sky.exr"))
    return emitter("envmap", text("filename", "sky.exr"), number("scale", 2), to_world(*steps))


def picture(folder: Path, name: str, size: tuple[int, ...]) -> None:
    """Smooth colours or greys that look different from all sides."""
    pixels = gaussian_filter(RNG.random(size), (6, 6, 0)[: len(size)], mode="wrap")
    Image.fromarray((255 * (pixels - pixels.min()) / np.ptp(pixels)).astype(np.uint8)).save(folder / name)


ROW_BY_ROW: dict[str, Any] = {"eye": "0,0,-14", "fov": float(np.degrees(2 * np.arctan(4.8 / 14)))}


def side_by_side(shapes: Sequence[str]) -> str:
    """Shapes of some two units in 4 columns and 3 rows; PLACE in each is the step to where it stands."""
    steps = [move(f"{2.4 * (i % 4) - 3.6} {2.4 * (i // 4) - 2.4} 0") for i in range(len(shapes))]
    return "".join(one.replace("PLACE", step) for one, step in zip(shapes, steps, strict=True))


def balls(surfaces: Sequence[str]) -> str:
    return side_by_side([shape("sphere", to_world("PLACE"), surface) for surface in surfaces])


def test_materials_that_are_the_same(tmp_path: Path) -> None:
    surfaces = [
        bsdf("diffuse", rgb("reflectance", ORANGE)),
        bsdf("roughplastic", WIDE_GGX, rgb("diffuse_reflectance", ORANGE)),
        bsdf("plastic", rgb("diffuse_reflectance", ".1 .3 .8")),
        bsdf("roughconductor", WIDE_GGX, text("material", "Au")),
        bsdf("conductor", text("material", "Cu")),
        bsdf("conductor"),
        bsdf("dielectric"),
        bsdf("dielectric", text("int_ior", "air"), number("ext_ior", 1.5)),
        bsdf("dielectric", rgb("specular_transmittance", ".5 .9 .7")),
        bsdf("roughdielectric", WIDE_GGX, text("int_ior", "water")),
        bsdf(
            *("principled", rgb("base_color", ORANGE), number("metallic", 0.4), number("specular", 0.7)),
            number("clearcoat", 0.6),
        ),
        bsdf(
            *("principled", rgb("base_color", ORANGE), number("spec_trans", 0.8), number("eta", 1.4)),
            number("roughness", 0.3),
        ),
    ]
    ours, theirs, left_out = views_of(balls(surfaces) + sky(tmp_path), tmp_path, **ROW_BY_ROW, depth=8)
    assert left_out == (SMOOTH,)
    # Highlights have a width of 0.001, and glass that is turned inside out is made of triangles.
    assert not unlike(ours, theirs, relative=3e-3).any()


def test_colours_of_metals_differ_by_little(tmp_path: Path) -> None:
    """Towards grazing angles Schlick's are not those of a refractive index."""
    surfaces = [
        bsdf("roughconductor", WIDE_GGX, text("material", "Ir")),
        bsdf("roughconductor", WIDE_GGX, text("material", "Au"), rgb("specular_reflectance", ".5 .9 .7")),
        bsdf("roughconductor", WIDE_GGX, rgb("eta", ".2 .9 1.2"), rgb("k", "3 2.5 2")),
    ]
    ours, theirs, left_out = views_of(balls(surfaces) + sky(tmp_path), tmp_path, **ROW_BY_ROW)
    assert left_out == ("metals but for six: how they reflect at an angle is Schlick's estimate",)
    np.testing.assert_allclose(ours.mean(axis=0), theirs.mean(axis=0), rtol=0.04)


def two_sided(surface: str) -> str:
    return bsdf("twosided", surface)


def standing(kind: str, *inner: str, size: str = "0.9") -> str:
    return shape(kind, to_world(scale(size), rotate("x", 40), rotate("y", -30), "PLACE"), *inner)


MOVED = to_uv(scale("2 3 1"), rotate("z", 30), move(".2 0 0"))
TETRAHEDRON = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float s
property float t
element face 4
property list uchar int vertex_indices
end_header
-1 -.5 -.5 .1 .2
1 -.5 -.5 .9 .3
0 1 -.5 .4 .8
0 0 1 .6 .5
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""
TRIANGLE = "v -1 -.5 -.5\nv 1 -.5 -.5\nv 0 1 -.5\nvt .1 .2\nvt .9 .3\nvt .4 .8\nf 1/1 3/3 2/2\n"


def test_pictures_lie_on_all_shapes_as_in_mitsuba(tmp_path: Path) -> None:
    plain = two_sided(bsdf("diffuse", bitmap("reflectance", COLOURS)))
    moved = two_sided(bsdf("diffuse", bitmap("reflectance", COLOURS, MOVED)))
    checks = texture("reflectance", "checkerboard", rgb("color0", ".9 .5 .1"), MOVED)
    squares = two_sided(bsdf("diffuse", checks))
    ply, obj = text("filename", "a.ply"), text("filename", "b.obj")
    upright, mirrored = flag("flip_tex_coords", "false"), flag("flip_tex_coords")
    shapes = [
        standing("rectangle", plain),
        standing("rectangle", moved, size="-1 .7 2"),
        standing("cube", plain, size="0.6"),
        standing("sphere", plain),
        standing("disk", moved),
        standing("cylinder", moved, point("p1", "0 .6 .8"), number("radius", 0.5)),
        standing("sphere", squares),
        standing("cube", squares, size="0.6"),
        standing("ply", plain, ply),
        standing("ply", moved, ply, mirrored, flag("face_normals")),
        standing("obj", plain, obj),
        standing("obj", plain, obj, upright),
    ]
    content = side_by_side(shapes) + emitter("constant")

    def views(folder: Path, turned: bool) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
        folder.mkdir()
        (folder / "a.ply").write_text(TETRAHEDRON)
        (folder / "b.obj").write_text(TRIANGLE)
        image = Image.open(tmp_path / COLOURS)
        (image.transpose(Image.Transpose.FLIP_TOP_BOTTOM) if turned else image).save(folder / COLOURS)
        return views_of(content, folder, **ROW_BY_ROW, samples=128)

    picture(tmp_path, COLOURS, (48, 64, 3))
    ours, theirs, left_out = views(tmp_path / "same", turned=False)
    assert left_out == ()
    # Borders of squares are as wide as one pixel of 512, and pictures are not mixed across their own borders.
    assert not unlike(ours, theirs, relative=4e-3).any()
    # The fault: pictures upside down.
    other, _, _ = views(tmp_path / "other", turned=True)
    assert unlike(other, theirs, relative=4e-3).any(axis=-1).sum() > 10


def test_pictures_of_numbers_holes_and_tilts(tmp_path: Path) -> None:
    picture(tmp_path, COLOURS, (48, 64, 3))
    picture(tmp_path, "greys.png", (48, 64))
    around = np.hypot(*(np.mgrid[:48, :64] - np.array([20, 36])[:, None, None])) > 14
    Image.fromarray((255 * around).astype(np.uint8)).save(tmp_path / "hole.png")
    tilts = np.full((48, 64, 3), 220, np.uint8)
    tilts[..., 0] = 128 + 50 * np.sin(np.arange(64) / 9)
    tilts[..., 1] = 128 + 50 * np.sin(np.arange(48) / 5)[:, None]
    Image.fromarray(tilts).save(tmp_path / "tilts.png")
    squares = texture("metallic", "checkerboard", number("color1", 0.9))
    tilted = two_sided(bsdf("normalmap", bitmap("normalmap", "tilts.png", RAW), MATT))
    surfaces = [
        two_sided(bsdf("principled", bitmap("base_color", COLOURS), bitmap("roughness", "greys.png", RAW))),
        two_sided(bsdf("principled", squares)),
        bsdf("mask", bitmap("opacity", "hole.png"), two_sided(MATT)),
        tilted,
        two_sided(bsdf("diffuse", bitmap("reflectance", "greys.png", RAW))),
        bsdf("thindielectric"),
        bsdf("dielectric"),
        emitter("area", bitmap("radiance", COLOURS)),
    ]
    shapes = [standing("rectangle", surface) for surface in surfaces]
    shapes.append(standing("rectangle", tilted, size="-1 1 1"))
    ours, theirs, left_out = views_of(side_by_side(shapes) + sky(tmp_path), tmp_path, **ROW_BY_ROW)
    assert left_out == ()
    # The borders of pictures, as above, and of the hole.
    assert not unlike(ours, theirs, relative=5e-3).any()


def test_lights(tmp_path: Path) -> None:
    matt = two_sided(MATT)
    things = [
        shape("sphere", matt),
        shape("rectangle", to_world(scale("3"), rotate("x", -90), move("0 -1 0")), matt),
        shape(
            *("disk", flag("flip_normals"), emitter("area", rgb("radiance", "3 2 1"))),
            to_world(scale("0.5"), rotate("x", -90), move("-1.5 2 0")),
        ),
        emitter("point", point("position", "2 3 -2"), rgb("intensity", "9 5 3")),
        emitter("point", to_world(move("-2 2 0")), spectrum("intensity", "6")),
        emitter(
            *("spot", to_world(look("2 3 -4", ".3 0 0")), rgb("intensity", "20 30 9")),
            number("cutoff_angle", 9),
        ),
        emitter("directional", vector("direction", "-1 -2 3"), spectrum("irradiance", "400:1, 500:2, 700:4")),
        emitter("constant", rgb("radiance", ".2 .4 .6")),
    ]
    ours, theirs, left_out = views_of("".join(things), tmp_path)
    assert left_out == ()
    # Their tables for the colour of a spectrum have other steps than ours.
    assert not unlike(ours, theirs, relative=2e-3).any()


@pytest.mark.parametrize("steps", [(rotate("y", 70),), (scale("-1 1 1"), rotate("y", -40))])
def test_light_from_all_around_comes_from_where_it_came(tmp_path: Path, steps: tuple[str, ...]) -> None:
    content = shape("sphere", two_sided(MATT)) + sky(tmp_path, *steps)
    ours, theirs, _ = views_of(content, tmp_path, eye="1,0,-5", fov=60.0)
    assert not unlike(ours, theirs).any()
