"""Mitsuba scenes that are imported look as Mitsuba renders them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from mitsuba_views import unlike, views_of
from PIL import Image
from scipy.ndimage import gaussian_filter

pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
RNG = np.random.default_rng(7)
BACKS = "backs of surfaces without a twosided bsdf, which are black: they look like the fronts"
# Goral et al. (1984); the measures of the Program of Computer Graphics at Cornell University, in mm.
CORNELL = """
<bsdf type="diffuse" id="white"><rgb name="reflectance" value="0.73 0.73 0.71"/></bsdf>
<bsdf type="diffuse" id="red"><rgb name="reflectance" value="{red} 0.06 0.05"/></bsdf>
<bsdf type="diffuse" id="green">
<spectrum name="reflectance" value="400:0.09, 500:0.28, 540:0.48, 580:0.27, 640:0.11, 700:0.14"/></bsdf>
<shape type="rectangle" id="floor"><ref id="white"/><transform name="to_world">
<scale x="276" y="280"/><rotate x="1" angle="-90"/><translate x="278" z="279.6"/></transform></shape>
<shape type="rectangle" id="ceiling"><ref id="white"/><transform name="to_world">
<scale x="278" y="280"/><rotate x="1" angle="90"/><translate x="278" y="548.8" z="279.6"/></transform></shape>
<shape type="rectangle" id="back"><ref id="white"/><transform name="to_world">
<scale x="278" y="274.4"/><rotate y="1" angle="180"/><translate x="278" y="274.4" z="559.2"/>
</transform></shape>
<shape type="rectangle" id="left"><ref id="red"/><transform name="to_world">
<scale x="280" y="274.4"/><rotate y="1" angle="-90"/><translate x="552.8" y="274.4" z="279.6"/>
</transform></shape>
<shape type="rectangle" id="right"><ref id="green"/><transform name="to_world">
<scale x="280" y="274.4"/><rotate y="1" angle="90"/><translate y="274.4" z="279.6"/></transform></shape>
<shape type="rectangle" id="lamp"><transform name="to_world">
<scale x="65" y="52.5"/><rotate x="1" angle="90"/><translate x="278" y="548.7" z="279.5"/></transform>
<emitter type="area"><rgb name="radiance" value="17 12 4"/></emitter></shape>
<shape type="cube" id="short"><ref id="white"/><transform name="to_world"><scale value="82.5"/>
<rotate y="1" angle="-17"/><translate x="186" y="82.5" z="169"/></transform></shape>
<shape type="cube" id="tall"><ref id="white"/><transform name="to_world"><scale x="82.5" y="165" z="82.5"/>
<rotate y="1" angle="22"/><translate x="368" y="165" z="351"/></transform></shape>
"""
OUTSIDE: dict[str, Any] = {"eye": "278,273,-800", "target": "278,273,0", "fov": 39.3, "samples": 128}
SKY = '<emitter type="envmap"><string name="filename" value="sky.exr"/><float name="scale" value="2"/>{}</emitter>'
GGX = '<string name="distribution" value="ggx"/><float name="alpha" value="0.3"/>'
RAW = '<boolean name="raw" value="true"/>'


def sky(folder: Path, turn: str = "") -> str:
    """A smooth image of light from all around."""
    pixels = gaussian_filter(RNG.random((16, 32, 3)), (2, 2, 0), mode="wrap") ** 3
    header = {"compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, {"RGB": pixels.astype(np.float32)}).write(str(folder / "sky.exr"))
    return SKY.format(turn and f'<transform name="to_world">{turn}</transform>')


def picture(folder: Path, name: str, shape: tuple[int, ...]) -> None:
    """Smooth colours or greys that look different from all sides."""
    blur = (6, 6, 0)[: len(shape)]
    pixels = gaussian_filter(RNG.random(shape), blur, mode="wrap")
    Image.fromarray((255 * (pixels - pixels.min()) / np.ptp(pixels)).astype(np.uint8)).save(folder / name)


def bitmap(name: str, file: str = "colours.png", more: str = "") -> str:
    return f'<texture type="bitmap" name="{name}"><string name="filename" value="{file}"/>{more}</texture>'


def side_by_side(shapes: Sequence[str]) -> str:
    """Shapes of some two units in 4 columns and 3 rows before `ROW_BY_ROW`; {} in each is where it stands."""
    places = [f'<translate x="{2.4 * (i % 4) - 3.6}" y="{2.4 * (i // 4) - 2.4}"/>' for i in range(12)]
    return "".join(shape.format(place) for shape, place in zip(shapes, places, strict=False))


ROW_BY_ROW: dict[str, Any] = {"eye": "0,0,-14", "fov": float(np.degrees(2 * np.arctan(4.8 / 14)))}


def ball(bsdf: str) -> str:
    return f'<shape type="sphere"><transform name="to_world">{{}}</transform>{bsdf}</shape>'


def test_a_cornell_box(tmp_path: Path) -> None:
    ours, theirs, left_out = views_of(CORNELL.format(red=0.63), tmp_path, **OUTSIDE)
    assert left_out == (BACKS,)
    # The mean of a spectrum is taken over a wavelength range and a table a little other than theirs.
    assert not unlike(ours, theirs, relative=2e-3).any()
    # The fault: a wall that is a tenth redder.
    (tmp_path / "other").mkdir()
    other, _, _ = views_of(CORNELL.format(red=0.7), tmp_path / "other", **OUTSIDE)
    assert unlike(other, theirs, relative=2e-3)[..., 0].sum() > 3


def test_materials_that_are_the_same(tmp_path: Path) -> None:
    surfaces = [
        '<bsdf type="diffuse"><rgb name="reflectance" value=".8 .3 .1"/></bsdf>',
        f'<bsdf type="roughplastic">{GGX}<rgb name="diffuse_reflectance" value=".8 .3 .1"/></bsdf>',
        '<bsdf type="plastic"><rgb name="diffuse_reflectance" value=".1 .3 .8"/></bsdf>',
        f'<bsdf type="roughconductor"><string name="material" value="Au"/>{GGX}</bsdf>',
        '<bsdf type="conductor"><string name="material" value="Cu"/></bsdf>',
        '<bsdf type="conductor"/>',
        '<bsdf type="dielectric"/>',
        '<bsdf type="dielectric"><string name="int_ior" value="air"/><float name="ext_ior" value="1.5"/></bsdf>',
        '<bsdf type="dielectric"><rgb name="specular_transmittance" value=".5 .9 .7"/></bsdf>',
        f'<bsdf type="roughdielectric">{GGX}<string name="int_ior" value="water"/></bsdf>',
        '<bsdf type="principled"><rgb name="base_color" value=".8 .3 .1"/><float name="metallic" value=".4"/>'
        '<float name="specular" value=".7"/><float name="clearcoat" value=".6"/></bsdf>',
        '<bsdf type="principled"><rgb name="base_color" value=".8 .3 .1"/><float name="spec_trans" value=".8"/>'
        '<float name="roughness" value=".3"/><float name="eta" value="1.4"/></bsdf>',
    ]
    content = side_by_side([ball(surface) for surface in surfaces]) + sky(tmp_path)
    ours, theirs, left_out = views_of(content, tmp_path, **ROW_BY_ROW, depth=8)
    assert left_out == ("perfectly smooth plastic and metal: its highlights have a width of 0.001",)
    # Highlights of width 0.001, and turned glass as triangles.
    assert not unlike(ours, theirs, relative=3e-3).any()


def test_materials_that_are_nearly_the_same(tmp_path: Path) -> None:
    """Schlick's colours of metals at grazing angles are other than theirs."""
    surfaces = [
        f'<bsdf type="roughconductor"><string name="material" value="Ir"/>{GGX}</bsdf>',
        f'<bsdf type="roughconductor"><string name="material" value="Au"/>{GGX}'
        '<rgb name="specular_reflectance" value=".5 .9 .7"/></bsdf>',
        f'<bsdf type="roughconductor"><rgb name="eta" value=".2 .9 1.2"/><rgb name="k" value="3 2.5 2"/>{GGX}</bsdf>',
    ]
    content = side_by_side([ball(surface) for surface in surfaces]) + sky(tmp_path)
    ours, theirs, left_out = views_of(content, tmp_path, **ROW_BY_ROW)
    assert left_out == ()
    np.testing.assert_allclose(ours.mean(axis=0), theirs.mean(axis=0), rtol=0.04)


def two_sided(bsdf: str) -> str:
    return f'<bsdf type="twosided">{bsdf}</bsdf>'


def standing(type_: str, bsdf: str, more: str = "", scale: str = 'value="0.9"') -> str:
    return (
        f'<shape type="{type_}"><transform name="to_world"><scale {scale}/><rotate x="1" angle="40"/>'
        f'<rotate y="1" angle="-30"/>{{}}</transform>{bsdf}{more}</shape>'
    )


UV = '<transform name="to_uv"><scale x="2" y="3"/><rotate z="1" angle="30"/><translate x=".2"/></transform>'
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
OBJ = "v -1 -.5 -.5\nv 1 -.5 -.5\nv 0 1 -.5\nvt .1 .2\nvt .9 .3\nvt .4 .8\nf 1/1 3/3 2/2\n"


def test_pictures_lie_on_all_shapes_as_in_mitsuba(tmp_path: Path) -> None:
    picture(tmp_path, "colours.png", (48, 64, 3))
    (tmp_path / "a.ply").write_text(TETRAHEDRON)
    (tmp_path / "b.obj").write_text(OBJ)
    plain = two_sided(f'<bsdf type="diffuse">{bitmap("reflectance")}</bsdf>')
    moved = two_sided(f'<bsdf type="diffuse">{bitmap("reflectance", more=UV)}</bsdf>')
    squares = two_sided(
        '<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"><rgb name="color0" value=".9 .5 .1"/>'
        f"{UV}</texture></bsdf>"
    )
    ply, obj = ('<string name="filename" value="{}"/>'.replace("{}", name) for name in ("a.ply", "b.obj"))
    smooth = '<boolean name="face_normals" value="false"/>'
    flipped = '<boolean name="flip_tex_coords" value="{}"/>'
    shapes = [
        standing("rectangle", plain),
        standing("rectangle", moved, scale='x="-1" y=".7" z="2"'),
        standing("cube", plain, scale='value="0.6"'),
        standing("sphere", plain),
        standing("disk", moved),
        standing(
            "cylinder", moved, '<point name="p1" x="0" y=".6" z=".8"/><float name="radius" value=".5"/>'
        ),
        standing("sphere", squares),
        standing("cube", squares, scale='value="0.6"'),
        standing("ply", plain, ply + smooth),
        standing("ply", moved, ply + flipped.replace("{}", "true") + smooth.replace("false", "true")),
        standing("obj", plain, obj),
        standing("obj", plain, obj + flipped.replace("{}", "false")),
    ]
    content = side_by_side(shapes) + '<emitter type="constant"/>'
    ours, theirs, left_out = views_of(content, tmp_path, **ROW_BY_ROW, samples=128)
    assert left_out == ()
    # Squares have borders of a pixel in 512; pictures end at their borders and are not mixed across them.
    assert not unlike(ours, theirs, relative=4e-3).any()
    # The fault: pictures upside down.
    Image.open(tmp_path / "colours.png").transpose(Image.Transpose.FLIP_TOP_BOTTOM).save(
        tmp_path / "colours.png"
    )
    (tmp_path / "other").mkdir()
    for name in ("colours.png", "a.ply", "b.obj"):
        (tmp_path / name).rename(tmp_path / "other" / name)
    other, _, _ = views_of(content, tmp_path / "other", **ROW_BY_ROW, samples=128)
    assert unlike(other, theirs, relative=4e-3).any(axis=-1).sum() > 10


def test_pictures_of_numbers_holes_and_tilts(tmp_path: Path) -> None:
    picture(tmp_path, "colours.png", (48, 64, 3))
    picture(tmp_path, "greys.png", (48, 64))
    hole = np.hypot(*(np.mgrid[:48, :64] - np.array([20, 36])[:, None, None])) > 14
    Image.fromarray((255 * hole).astype(np.uint8)).save(tmp_path / "hole.png")
    tilts = np.full((48, 64, 3), 220, np.uint8)
    tilts[..., 0] = 128 + 50 * np.sin(np.arange(64) / 9)
    tilts[..., 1] = 128 + 50 * np.sin(np.arange(48) / 5)[:, None]
    Image.fromarray(tilts).save(tmp_path / "tilts.png")
    matt = two_sided('<bsdf type="diffuse"/>')
    rough = bitmap("roughness", "greys.png", RAW)
    tilted = f'<bsdf type="normalmap">{bitmap("normalmap", "tilts.png", RAW)}<bsdf type="diffuse"/></bsdf>'
    squares = '<texture type="checkerboard" name="metallic"><float name="color1" value="0.9"/></texture>'
    surfaces = [
        two_sided(f'<bsdf type="principled">{bitmap("base_color")}{rough}</bsdf>'),
        two_sided(f'<bsdf type="principled">{squares}</bsdf>'),
        f'<bsdf type="mask">{bitmap("opacity", "hole.png")}{matt}</bsdf>',
        two_sided(tilted),
        two_sided(f'<bsdf type="diffuse">{bitmap("reflectance", "greys.png", RAW)}</bsdf>'),
        '<bsdf type="thindielectric"/>',
        '<bsdf type="dielectric"/>',
    ]
    shapes = [standing("rectangle", surface) for surface in surfaces]
    shapes.append(standing("rectangle", two_sided(tilted), scale='x="-1"'))
    shapes.append(standing("rectangle", "", f'<emitter type="area">{bitmap("radiance")}</emitter>'))
    ours, theirs, left_out = views_of(side_by_side(shapes) + sky(tmp_path), tmp_path, **ROW_BY_ROW)
    assert left_out == ()
    assert not unlike(ours, theirs, relative=5e-3).any()


LAMPS = [
    '<emitter type="point"><point name="position" x="2" y="3" z="-2"/><rgb name="intensity" value="9 5 3"/></emitter>',
    '<emitter type="point"><transform name="to_world"><translate x="-2" y="2"/></transform>'
    '<spectrum name="intensity" value="6"/></emitter>',
    '<emitter type="spot"><transform name="to_world"><lookat origin="2,3,-4" target=".3,0,0" up="0,1,0"/></transform>'
    '<rgb name="intensity" value="20 30 9"/><float name="cutoff_angle" value="9"/></emitter>',
    '<emitter type="directional"><vector name="direction" x="-1" y="-2" z="3"/>'
    '<spectrum name="irradiance" value="400:1, 500:2, 700:4"/></emitter>',
    '<emitter type="constant"><rgb name="radiance" value=".2 .4 .6"/></emitter>',
]


def test_lights(tmp_path: Path) -> None:
    matt = two_sided('<bsdf type="diffuse"/>')
    floor = (
        '<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>'
        f'<translate y="-1"/></transform>{matt}</shape>'
    )
    lamp = (
        '<shape type="disk"><boolean name="flip_normals" value="true"/><transform name="to_world">'
        '<scale value=".5"/><rotate x="1" angle="-90"/><translate x="-1.5" y="2"/></transform>'
        '<emitter type="area"><rgb name="radiance" value="3 2 1"/></emitter></shape>'
    )
    ours, theirs, _ = views_of(f'<shape type="sphere">{matt}</shape>{floor}{lamp}{"".join(LAMPS)}', tmp_path)
    assert not unlike(ours, theirs, relative=2e-3).any()


@pytest.mark.parametrize("turn", ['<rotate y="1" angle="70"/>', '<scale x="-1"/><rotate y="1" angle="-40"/>'])
def test_light_from_all_around_comes_from_where_it_came(tmp_path: Path, turn: str) -> None:
    content = f'<shape type="sphere">{two_sided("<bsdf type=%sdiffuse%s/>" % ((chr(34),) * 2))}</shape>'
    ours, theirs, _ = views_of(content + sky(tmp_path, turn), tmp_path, eye="1,0,-5", fov=60.0)
    assert not unlike(ours, theirs, relative=2e-3).any()
