"""Scene files of Mitsuba: values worked out by hand, Mitsuba's own reading, and strangers' files."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pcii.base.errors import InputError
from simgen.mitsuba_xml.mitsuba_reader import read_mitsuba
from simgen.mitsuba_xml.mitsuba_scene import MitsubaScene, Plugin, Rgb, SpectrumValues
from simgen.renderer import backend

LIMIT_S = 2.0
SPHERE = '<shape type="sphere"/>'
MATT = '<bsdf type="diffuse"/>'


def scene(content: str, version: str = "3.0.0") -> str:
    return f'<scene version="{version}">\n{content}\n</scene>'


def read(folder: Path, content: str, version: str = "3.0.0") -> MitsubaScene:
    (folder / "scene.xml").write_text(scene(content, version))
    return read_mitsuba(folder / "scene.xml")


def only(folder: Path, content: str, version: str = "3.0.0") -> Plugin:
    (plugin,) = read(folder, content, version).plugins
    return plugin


def placed(folder: Path, steps: str) -> np.ndarray:
    """The transform of a sphere."""
    content = f'<shape type="sphere"><transform name="to_world">{steps}</transform></shape>'
    matrix = only(folder, content).parameters["to_world"]
    assert isinstance(matrix, np.ndarray)
    return matrix


def matt(folder: Path, reflectance: str) -> object:
    """The reflectance of a diffuse surface."""
    return only(folder, f'<bsdf type="diffuse">{reflectance}</bsdf>').parameters["reflectance"]


def refusal(path: Path) -> str:
    start = sum(os.times()[:2])
    with pytest.raises(InputError) as caught:
        read_mitsuba(path)
    assert sum(os.times()[:2]) - start < LIMIT_S
    sentence = str(caught.value)
    assert sentence.startswith(str(path.parent))
    assert sentence.isprintable()
    assert len(sentence) < 800
    return sentence.removeprefix(f"{path}: ")


def refused(folder: Path, content: str) -> str:
    (folder / "scene.xml").write_text(scene(content))
    return refusal(folder / "scene.xml")


def test_a_scene_is_read(tmp_path: Path) -> None:
    (tmp_path / "wood.png").touch()
    content = """
    <integrator type="path"><integer name="max_depth" value="8"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <film type="hdrfilm"><rfilter type="tent"/></film>
        <sampler type="independent"/>
    </sensor>
    <bsdf type="twosided" id="wood">
        <bsdf type="diffuse">
            <texture type="bitmap" name="reflectance"><string name="filename" value="wood.png"/></texture>
        </bsdf>
    </bsdf>
    <shape type="sphere" id="ball">
        <point name="center" x="1" y="2" z="3"/>
        <integer name="radius" value="2"/>
        <ref id="wood"/>
        <emitter type="area"><rgb name="radiance" value="1 2, 3"/></emitter>
    </shape>"""
    made = read(tmp_path, content)
    assert made.path == tmp_path / "scene.xml"
    assert [(one.category, one.type) for one in made.plugins] == [
        ("sensor", "perspective"),
        ("bsdf", "twosided"),
        ("shape", "sphere"),
    ]
    sensor, wood, ball = made.plugins
    assert sensor.parts == ()
    assert sensor.parameters["fov_axis"] == "x"
    assert ball.id == "ball"
    assert ball.place == f"{tmp_path / 'scene.xml'}: line 14"
    assert ball.parameters["center"] == (1.0, 2.0, 3.0)
    assert ball.parameters["radius"] == 2.0
    assert ball.parameters["flip_normals"] is False
    assert np.array_equal(np.asarray(ball.parameters["to_world"]), np.eye(4))
    bsdf, light = ball.parts
    assert bsdf is wood
    assert light.parameters["radiance"] == Rgb((1.0, 2.0, 3.0))
    texture = wood.parts[0].parameters["reflectance"]
    assert isinstance(texture, Plugin)
    assert texture.parameters["filename"] == "wood.png"
    assert texture.parameters["wrap_mode"] == "repeat"


TURN = '<rotate z="1" angle="90"/>'
TRANSFORMS = {
    "nothing": ("", np.eye(4).tolist()),
    "translate": ('<translate y="3"/>', [[1, 0, 0, 0], [0, 1, 0, 3], [0, 0, 1, 0], [0, 0, 0, 1]]),
    "scale": ('<scale y="3"/>', [[1, 0, 0, 0], [0, 3, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
    "scale all": ('<scale value="3"/>', [[3, 0, 0, 0], [0, 3, 0, 0], [0, 0, 3, 0], [0, 0, 0, 1]]),
    # A quarter turn about +Z takes +X to +Y and +Y to -X.
    "rotate": (TURN, [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
    # Moved along +X and then turned: the point lies along +Y.
    "move, turn": (
        '<translate x="5"/>' + TURN,
        [[0, -1, 0, 0], [1, 0, 0, 5], [0, 0, 1, 0], [0, 0, 0, 1]],
    ),
    "turn, move": (
        TURN + '<translate value="5, 0, 0"/>',
        [[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
    ),
    # From (1, 2, 3) along +X, +Z up: left is Z x X = +Y.
    "look": (
        '<lookat origin="1 2 3" target="9 2 3" up="0 0 1"/>',
        [[0, 0, 1, 1], [1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]],
    ),
    "9 numbers": (
        '<matrix value="1 2 3 4 5 6 7 8 10"/>',
        [[1, 2, 3, 0], [4, 5, 6, 0], [7, 8, 10, 0], [0, 0, 0, 1]],
    ),
    "16 numbers": (
        '<matrix value="1 2 3 4 5 6 7 8 9 10 12 12 0 0 0 1"/>',
        [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 12, 12], [0, 0, 0, 1]],
    ),
}


@pytest.mark.parametrize("what", TRANSFORMS)
def test_transforms_are_composed_from_the_left(what: str, tmp_path: Path) -> None:
    steps, expected = TRANSFORMS[what]
    assert np.allclose(placed(tmp_path, steps), expected, rtol=0, atol=1e-15)  # rounding of cos(90 degrees)


@pytest.mark.renders
def test_transforms_are_those_of_mitsuba(tmp_path: Path) -> None:
    steps = (
        '<rotate x="0.36" y="0.48" z="-0.8" angle="33"/><scale x="2" y="0.5"/>'
        '<lookat origin="1 2 3" target="0 1 0.5"/><translate x="1" z="-3"/>'
        '<matrix value="1 2 0 0 1 0.5 -1 0 3"/><lookat origin="1 2 3" target="0 1 5" up="0.1 1 0"/>'
    )
    mi = backend.load()
    theirs = mi.parser.parse_string(
        mi.parser.ParserConfig(mi.variant()),
        f'<shape version="3.0.0" type="sphere"><transform name="to_world">{steps}</transform></shape>',
    )
    expected = np.array(theirs.root.props["to_world"].matrix)
    # Both count in float64, and six products of numbers up to 10 round differently.
    assert np.allclose(placed(tmp_path, steps), expected, rtol=0, atol=1e-13)


def test_colours_and_spectra(tmp_path: Path) -> None:
    (tmp_path / "green.spd").write_text("# made up\n400 0.1\n\n500, 0.8\n")
    assert matt(tmp_path, "") == 0.5
    assert matt(tmp_path, '<float name="reflectance" value="2.5e-1"/>') == 0.25
    assert matt(tmp_path, '<rgb name="reflectance" value="0.25"/>') == Rgb((0.25, 0.25, 0.25))
    assert matt(tmp_path, '<spectrum name="reflectance" value=".5"/>') == SpectrumValues((), (0.5,))
    table = SpectrumValues((400.0, 500.0), (0.1, 0.8))
    assert matt(tmp_path, '<spectrum name="reflectance" value="400:0.1, 500:0.8"/>') == table
    assert matt(tmp_path, '<spectrum name="reflectance" filename="green.spd"/>') == table


def test_defaults_are_filled_in(tmp_path: Path) -> None:
    content = """
    <default name="r" value="2"/>
    <default name="r" value="9"/>
    <default name="rough" value="$r.5"/>
    <bsdf type="roughplastic" id="a\\$r">
        <float name="alpha" value="$rough"/>
        <rgb name="diffuse_reflectance" value="0.$r 0.1 0"/>
    </bsdf>"""
    plastic = only(tmp_path, content)
    assert plastic.id == "a$r"
    assert plastic.parameters["alpha"] == 2.5
    assert plastic.parameters["diffuse_reflectance"] == Rgb((0.2, 0.1, 0.0))


def test_includes_are_part_of_the_scene(tmp_path: Path) -> None:
    """Their files are found beside them first, and share ids and defaults with the scene."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "surfaces.xml").write_text(
        scene('<bsdf type="diffuse" id="a"><rgb name="reflectance" value="$grey"/></bsdf>\n').replace(
            "</scene>", '<include filename="ball.xml"/></scene>'
        )
    )
    (tmp_path / "parts" / "ball.xml").write_text('<shape type="sphere" version="3.0.0"><ref id="b"/></shape>')
    made = read(
        tmp_path,
        '<default name="grey" value="0.3"/><include filename="parts/surfaces.xml"/>'
        '<alias id="a" as="b"/><shape type="cube"><ref id="b"/></shape>',
    )
    surface, ball, cube = made.plugins
    assert surface.parameters["reflectance"] == Rgb((0.3, 0.3, 0.3))
    assert ball.parts == cube.parts == (surface,)
    assert ball.place == f"{tmp_path / 'parts' / 'ball.xml'}: line 1"


def test_groups_can_be_referred_to_before_they_are_there(tmp_path: Path) -> None:
    instance, group = read(
        tmp_path,
        '<shape type="instance"><ref id="pair"/></shape>'
        '<shape type="shapegroup" id="pair"><shape type="sphere"/><shape type="cube"/></shape>',
    ).plugins
    assert instance.parts == (group,)
    assert [shape.type for shape in group.parts] == ["sphere", "cube"]


def test_old_files_are_read_under_new_names(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    content = """
    <shape type="sphere">
        <transform name="toWorld"><lookAt origin="0 0 0" target="0 0 1" up="0 1 0"/></transform>
        <bsdf type="plastic"><float name="intIOR" value="1.4"/>
            <texture type="bitmap" name="diffuseReflectance"><string name="filename" value="a.png"/>
                <float name="uscale" value="2"/><float name="uoffset" value="0.25"/></texture></bsdf>
    </shape>"""
    ball = only(tmp_path, content, version="0.6.0")
    assert np.array_equal(np.asarray(ball.parameters["to_world"]), np.eye(4))
    assert ball.parts[0].parameters["int_ior"] == 1.4
    texture = ball.parts[0].parameters["diffuse_reflectance"]
    assert isinstance(texture, Plugin)
    to_uv = np.asarray(texture.parameters["to_uv"])
    assert np.array_equal(to_uv @ [0.1, 0.1, 0, 1], [2 * (0.1 + 0.25), 0.1, 0, 1])
    assert "'toWorld' of shape 'sphere'" in refused(tmp_path, content.replace("lookAt", "lookat"))


def test_all_that_cannot_be_imported_is_named_once(tmp_path: Path) -> None:
    content = """
    <shape type="serialized"><bsdf type="hair"/></shape>
    <shape type="serialized"><string name="filename" value="a"/></shape>
    <shape type="sphere"><float name="size" value="1"/><medium type="homogeneous" name="interior"/></shape>
    <shape type="sphere"><float name="size" value="2"/><vector name="center" value="1"/></shape>
    <emitter type="../../evil"/>"""
    (tmp_path / "scene.xml").write_text(scene(content))
    with pytest.raises(InputError) as caught:
        read_mitsuba(tmp_path / "scene.xml")
    assert str(caught.value) == (
        f"{tmp_path / 'scene.xml'}: bsdf 'hair', shape 'serialized', medium 'homogeneous', "
        "emitter '../../evil': not among the plugins that can be imported (and 1 more)"
    )
    assert caught.value.__notes__ == [
        "  'size' of shape 'sphere': not among the parameters that can be imported"
    ]


NESTED = "<shape type='shapegroup'>" * 70 + "</shape>" * 70
TWICE = "".join(
    f'<bsdf type="twosided" id="a{n}"><ref id="a{n - 1}"/><ref id="a{n - 1}"/></bsdf>' for n in range(1, 40)
)
CHAIN = "".join(f'<bsdf type="mask" id="a{n}"><ref id="a{n + 1}"/></bsdf>' for n in range(70))
GROWTH = "".join(f'<default name="a{n + 1}" value="$a{n}$a{n}$a{n}$a{n}"/>' for n in range(12))
FAULTS: dict[str, tuple[str, str]] = {
    "a path": ('<path value="plugins"/>', "line 2: <path> lets files come from other folders"),
    "unknown element": ("<script/>", "line 2: there is no <script> in scenes of Mitsuba 3"),
    "a step alone": ('<translate x="1"/>', "line 2: <translate> has its place in a <transform>"),
    "nested too deep": (NESTED, "elements may be nested 64 deep"),
    "too many": (SPHERE * 100_001, "may have 100000 elements"),
    "long attribute": (f'<string name="a" value="{"x" * 70_000}"/>', "may have 65536 characters"),
    "too large": (f"<!-- {'x' * (1 << 23)} -->", "may have 8388608 bytes"),
    "defaults that grow": (f'<default name="a0" value="{"x" * 9}"/>' + GROWTH, "the scene is too large"),
    "no default": ('<shape type="$kind"/>', "line 2: 'kind' has no value"),
    "not closed": ("<shape", "line 3: not valid XML: not well-formed"),
    "wrongly closed": ("<bsdf></shape>", "line 2: not valid XML: mismatched tag"),
    "undeclared entity": ('<shape type="&lol;"/>', "line 2: not valid XML: undefined entity"),
    "nothing of that id": ('<shape type="sphere"><ref id="a"/></shape>', "line 2: nothing has the id 'a'"),
    "itself": ('<bsdf type="mask" id="a"><ref id="a"/></bsdf>', "line 2: bsdf 'a' refers to itself"),
    "a circle": (
        '<bsdf type="mask" id="a"><ref id="b"/></bsdf><bsdf type="mask" id="b"><ref id="a"/></bsdf>',
        "bsdf 'a' refers to itself",
    ),
    "a chain": (CHAIN + '<bsdf type="diffuse" id="a70"/>', "are deeper with references followed"),
    "twice twice twice": ('<bsdf type="diffuse" id="a0"/>' + TWICE, "more than 100000 plugins"),
    "two of an id": ('<shape type="cube" id="a"/>' * 2, "line 2: the id 'a' is there twice"),
    "two of a name": ('<shape type="cube" name="a"/>' * 2, "line 2: 'a' is there twice in the scene"),
    "alias of nothing": ('<alias id="a" as="b"/>', "line 2: nothing before has the id 'a'"),
    "element in a value": (
        '<shape type="sphere"><float name="radius" value="1"><float/></float></shape>',
        "line 2: <float> holds no other elements",
    ),
    "no type": ("<shape/>", "line 2: <shape> needs the attribute 'type'"),
    "other attribute": ('<shape type="cube" onload="x"/>', "line 2: <shape> has no attribute 'onload'"),
    "includes itself": ('<include filename="scene.xml"/>', "line 2: 'scene.xml' includes itself"),
    "no such include": ('<include filename="a.xml"/>', "line 2: there is no file 'a.xml'"),
    "include outside": (
        '<include filename="../a.xml"/>',
        "line 2: '../a.xml' lies outside the scene's folder",
    ),
    "spectrum outside": (
        '<bsdf type="diffuse"><spectrum name="reflectance" filename="/etc/passwd"/></bsdf>',
        "line 2: '/etc/passwd' lies outside the scene's folder",
    ),
    "wrong kind": (
        '<shape type="sphere"><string name="radius" value="1"/></shape>',
        "line 2: 'radius' of shape 'sphere' must be a number",
    ),
    "true is no number": (
        '<shape type="sphere"><boolean name="radius" value="true"/></shape>',
        "line 2: 'radius' of shape 'sphere' must be a number",
    ),
    "surface as colour": (
        f'<bsdf type="mask"><bsdf type="diffuse" name="opacity"/>{MATT}</bsdf>',
        "'opacity' of bsdf 'mask' must be a number, an rgb, a spectrum or a texture",
    ),
    "no file": ('<shape type="ply"/>', "line 2: shape 'ply' needs 'filename'"),
    "no surface": ('<bsdf type="twosided"/>', "line 2: bsdf 'twosided' needs a bsdf in it"),
    "three surfaces": (f'<bsdf type="twosided">{MATT * 3}</bsdf>', "takes 2 bsdf in it, and has 3"),
    "instance of a cube": (
        '<shape type="instance"><shape type="cube"/></shape>',
        "line 2: shape 'instance' takes no shape 'cube'",
    ),
    "lamp in a surface": (
        '<bsdf type="diffuse"><emitter type="point"/></bsdf>',
        "line 2: emitter 'point' has no place in bsdf 'diffuse'",
    ),
    "two views": (
        '<sensor type="perspective"><float name="fov" value="9"/><string name="focal_length" value="9mm"/>'
        "</sensor>",
        "line 2: sensor 'perspective' takes either 'fov' or 'focal_length'",
    ),
    "unknown choice": (
        '<sensor type="perspective"><string name="fov_axis" value="w"/></sensor>',
        "'fov_axis' of sensor 'perspective' is 'w'; known are x, y, diagonal, smaller, larger",
    ),
}


@pytest.mark.parametrize("what", FAULTS)
def test_faults_are_named_with_their_line(what: str, tmp_path: Path) -> None:
    content, message = FAULTS[what]
    assert message in refused(tmp_path, content)


VALUES: dict[str, tuple[str, str]] = {
    "nan": ('<float name="a" value="nan"/>', "'a': a finite number is needed, not 'nan'"),
    "inf": ('<float name="a" value="-inf"/>', "not '-inf'"),
    "too large": ('<float name="a" value="1e999"/>', "not '1e999'"),
    "underscore": ('<float name="a" value="1_0"/>', "not '1_0'"),
    "other digits": ('<float name="a" value="\u0661"/>', "a finite number is needed"),
    "empty": ('<float name="a" value=""/>', "not ''"),
    "no name": ('<float value="1"/>', "<float> needs the attribute 'name'"),
    "half": ('<integer name="a" value="0.5"/>', "a whole number is needed, not '0.5'"),
    "digits": (f'<integer name="a" value="{"9" * 5000}"/>', "a whole number is needed, not '9999"),
    "yes": ('<boolean name="a" value="yes"/>', "true or false is needed, not 'yes'"),
    "two numbers": ('<vector name="a" value="1 2"/>', "three numbers are needed, not '1 2'"),
    "no z": ('<point name="a" x="1" y="2"/>', "<point> needs 'value', or 'x', 'y' and 'z'"),
    "both": ('<point name="a" value="1" x="1"/>', "<point> takes either 'value' or 'x', 'y' and 'z'"),
    "hexadecimal": ('<rgb name="a" value="#ff0000"/>', "takes no hexadecimal colours"),
    "no spectrum": ('<spectrum name="a"/>', "<spectrum> needs the attribute 'value'"),
    "two spectra": ('<spectrum name="a" value="1" filename="a.spd"/>', "has no attribute 'value'"),
    "falling": ('<spectrum name="a" value="500:1, 400:1"/>', "the wavelengths of a spectrum must grow"),
    "one sample": ('<spectrum name="a" value="500:1"/>', "a spectrum has 2 to 2000 wavelengths, not 1"),
    "no pair": ('<spectrum name="a" value="1 2"/>', "pairs such as 400:0.1, 500:0.2 are needed"),
    "no axis": ('<transform name="a"><rotate angle="9"/></transform>', "axis of a rotation must not be 0"),
    "long axis": (
        '<transform name="a"><rotate x="3" z="-4" angle="9"/></transform>',
        'must have length 1; write x="0.6" y="0" z="-0.8"',
    ),
    "no way": (
        '<transform name="a"><lookat origin="1 1 1" target="1 1 1"/></transform>',
        "'target' must not be at 'origin'",
    ),
    "up ahead": (
        '<transform name="a"><lookat origin="0 0 0" target="0 2 0" up="0 1 0"/></transform>',
        "'up' must not be along the line",
    ),
    "8 numbers": (
        '<transform name="a"><matrix value="1 2 3 4 5 6 7 8"/></transform>',
        "9 or 16 numbers, not 8",
    ),
    "projective": (
        '<transform name="a"><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1"/></transform>',
        "the last row of a matrix must be 0 0 0 1",
    ),
    "overflow": (
        '<transform name="a"><scale value="1e300"/><scale value="1e300"/></transform>',
        "the numbers of this transform are too large",
    ),
    "unknown step": ('<transform name="a"><shear/></transform>', "<transform> takes translate, scale,"),
}


@pytest.mark.parametrize("what", VALUES)
def test_values_are_checked_wherever_they_stand(what: str, tmp_path: Path) -> None:
    """Also in a plugin that is left out."""
    content, message = VALUES[what]
    sentence = refused(tmp_path, f'<film type="whatever">{content}</film>')
    assert sentence.startswith("line 2: ")
    assert message in sentence


FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b" \n", "this file is empty"),
    "text": (b"hello", "line 1: not valid XML: syntax error"),
    "binary": (bytes(range(256)), "line 2: not UTF-8 text"),
    "utf-16": ('<scene version="3.0.0"/>'.encode("utf-16"), "line 1: not UTF-8 text"),
    "nul": (b'<scene version="3.0.0">\0</scene>', "line 1: not valid XML"),
    "wrong root": (
        b'<html version="3.0.0"/>',
        "line 1: the root is <html>, and that of a scene file is <scene>",
    ),
    "a shape": (b'<shape type="cube" version="3.0.0"/>', "line 1: the root is <shape>"),
    "no version": (b"<scene/>", 'line 1: <scene> needs the version of Mitsuba, such as version="3.0.0"'),
    "a word as version": (b'<scene version="new"/>', "needs the version of Mitsuba"),
    "entities": (
        b'<!DOCTYPE a [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;">]>\n<scene version="3.0.0">&b;</scene>',
        "line 1: a scene file has no DOCTYPE",
    ),
    "foreign entity": (
        b'<!DOCTYPE a SYSTEM "file:///etc/passwd"><scene version="3.0.0"/>',
        "line 1: a scene file has no DOCTYPE",
    ),
}


@pytest.mark.parametrize("what", FILES)
def test_files_that_are_no_scenes(what: str, tmp_path: Path) -> None:
    content, message = FILES[what]
    (tmp_path / "scene.xml").write_bytes(content)
    assert message in refusal(tmp_path / "scene.xml")


def test_there_must_be_a_file(tmp_path: Path) -> None:
    assert "there is no such file" in refusal(tmp_path / "scene.xml")
    os.mkfifo(tmp_path / "pipe.xml")
    assert "there is no such file" in refusal(tmp_path / "pipe.xml")
    with pytest.raises(InputError, match="this is a folder"):
        read_mitsuba(tmp_path)


NAMES: dict[str, str] = {
    "../a.ply": "lies outside the scene's folder",
    "/etc/passwd": "lies outside the scene's folder",
    "link.ply": "lies outside the scene's folder",
    "a.ply": "there is no file 'a.ply'",
    "http://localhost/a.ply": "there is no file",
    "file:///etc/passwd": "there is no file",
    "": "there is no file ''",
    ".": "there is no file '.'",
    "x" * 5000: "there is no file",
}


@pytest.mark.parametrize("name", NAMES)
def test_files_come_from_the_scenes_folder(name: str, tmp_path: Path) -> None:
    (tmp_path / "a.ply").touch()
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "link.ply").symlink_to(tmp_path / "a.ply")
    sentence = refused(folder, f'<shape type="ply"><string name="filename" value="{name}"/></shape>')
    assert sentence.startswith("line 2: 'filename' of shape 'ply': ")
    assert NAMES[name] in sentence


def first_includes_second(folder: Path) -> str:
    for here, there in (("a", "b"), ("b", "a")):
        (folder / f"{here}.xml").write_text(scene(f'<include filename="{there}.xml"/>'))
    return "b.xml: line 2: 'a.xml' includes itself"


def one_after_the_other(folder: Path) -> str:
    for number in range(20):
        (folder / f"{number}.xml").write_text(scene(f'<include filename="{number + 1}.xml"/>'))
    (folder / "a.xml").write_text(scene('<include filename="0.xml"/>'))
    return "files may include each other 15 deep"


def deep_in_deep(folder: Path) -> str:
    """Half as deep as allowed, and again."""
    inner = "<shape type='shapegroup'>" * 40 + "{}" + "</shape>" * 40
    (folder / "b.xml").write_text(scene(inner.format(SPHERE)))
    (folder / "a.xml").write_text(scene(inner.format('<include filename="b.xml"/>')))
    return "b.xml: line 2: elements may be nested 64 deep"


def many_in_one(folder: Path) -> str:
    (folder / "b.xml").write_text(scene(""))
    (folder / "a.xml").write_text(scene('<include filename="b.xml"/>' * 3000))
    return "a scene here may include 2000 files"


def bad_values(folder: Path) -> str:
    (folder / "b.spd").write_text("400 0.1 0.2\n")
    (folder / "a.xml").write_text(
        scene('<bsdf type="diffuse"><spectrum name="reflectance" filename="b.spd"/></bsdf>')
    )
    return "line 2: 'reflectance': 'b.spd': each line needs a wavelength and a value"


@pytest.mark.parametrize(
    "make", [first_includes_second, one_after_the_other, deep_in_deep, many_in_one, bad_values]
)
def test_included_files_are_no_way_around(make: Callable[[Path], str], tmp_path: Path) -> None:
    message = make(tmp_path)
    (tmp_path / "scene.xml").write_text(scene('<include filename="a.xml"/>'))
    assert message in refusal(tmp_path / "scene.xml")
