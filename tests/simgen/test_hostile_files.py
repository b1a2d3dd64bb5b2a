"""Strangers' scenes: whatever is wrong with their files, the answer is one sentence, soon."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hostile_files import BOMB, animation, binary_ply, obj, picture, ply, png, scene_toml
from png_files import chunk

from pcii.base.errors import InputError
from simgen.assets.asset_files import read_assets, read_environment
from simgen.spec.scene_lookup import load_scene

LIMIT_S = 2.0


def spent_s() -> float:
    """Processor time of this process and of those it has started and ended: other work does not count."""
    return sum(os.times()[:4])


def refusal(folder: Path) -> str:
    """The sentence with which the scene in this folder is refused, by the way that every command takes.

    `build` begins with `read_assets`, before the renderer sees anything.
    """
    start = spent_s()
    with pytest.raises(InputError) as caught:
        read_assets(*load_scene(str(folder)))
    assert spent_s() - start < LIMIT_S
    sentence = str(caught.value)
    assert sentence.isprintable()
    assert len(sentence) < 800
    return sentence


def scene_with(folder: Path, name: str, content: bytes | None) -> Path:
    """A scene whose object is, or wears, the file of this name."""
    mesh = name.endswith((".ply", ".obj", ".xml", ".so"))
    told = {"shape": f'type = "mesh", file = "{name}"'} if mesh else {"material": f'texture = "{name}"'}
    (folder / "scene.toml").write_text(scene_toml(**told))
    if content is not None:
        (folder / name).write_bytes(content)
    return folder


MESHES: dict[str, tuple[bytes, str]] = {
    "index 2e9": (binary_ply(0, 1, 2_000_000_000), "vertex 2000000000, but only vertices 0 to 2 exist"),
    "index -1": (binary_ply(0, 1, -1), "vertex -1"),
    "nan vertex": (ply("0 0 0\n10 nan 0\n0 10 0\n"), "a position of nan"),
    "no extent": (ply("1 1 1\n1 1 1\n1 1 1\n"), "no extent"),
    "1e12 vertices": (ply(vertex_count=10**12), "more than memory can"),
    "no faces": (ply(faces="", face_count=0), "has no faces"),
    "truncated": (binary_ply(0, 1, 2)[:-5], "cannot be read: element 'face'"),
    "face of 2 corners": (binary_ply(0, 1), "a face of 2 corners"),
    "wrong magic": (b"\x7fELF" + bytes(100), "cannot be read: line 1"),
    "words": (ply("0 0 0\n10 __import__('os') 0\n0 10 0\n"), "malformed input"),
    "no coordinates": (ply().replace(b"float x", b"float q"), "no vertices with x, y and z"),
}
OBJS: dict[str, tuple[bytes, str]] = {
    "index 2e9": (obj("f 1 2 2000000000"), "line 5 that cannot be used: 'f 1 2 2000000000'"),
    "index 0": (obj("f 0 1 2"), "line 5"),
    "call": (obj("call /etc/passwd"), "line 5 that cannot be used: 'call /etc/passwd'"),
    "empty": (b"", "has no faces"),
}
PICTURES: dict[str, tuple[bytes, str]] = {
    "bomb.png": (png(width=60_000, height=60_000, data=BOMB), "60000 x 60000 px, and at most 67108864"),
    "text_bomb.png": (png(extra=chunk(b"zTXt", b"a\0\0" + BOMB)), "too large"),
    "truncated.png": (png()[:-30], "its header cannot be read"),
    "checksum.png": (png()[:-20] + b"\0\0\0\0" + png()[-16:], "damaged or cut off"),
    "two.png": (animation(), "holds 2 pictures"),
    "clear.png": (picture("RGBA", "PNG"), "not opaque everywhere"),
    "print.jpg": (picture("CMYK", "JPEG"), "a CMYK picture"),
    "float.tif": (picture("F", "TIFF"), "a picture of float32"),
    "truncated.jpg": (picture("RGB", "JPEG")[:-200], "its header cannot be read"),
    "empty.png": (b"", "not a PNG, JPEG or TIFF"),
    "huge_directory.tif": (b"II*\0\x08\0\0\0" + b"\xff" * 4000, "cannot be read"),
}


@pytest.mark.parametrize("what", MESHES)
def test_ply_files_are_refused(what: str, tmp_path: Path) -> None:
    content, message = MESHES[what]
    sentence = refusal(scene_with(tmp_path, "thing.ply", content))
    assert "thing.ply" in sentence
    assert message in sentence


@pytest.mark.parametrize("what", OBJS)
def test_obj_files_are_refused(what: str, tmp_path: Path) -> None:
    content, message = OBJS[what]
    sentence = refusal(scene_with(tmp_path, "thing.obj", content))
    assert "thing.obj" in sentence
    assert message in sentence


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_are_refused(name: str, tmp_path: Path) -> None:
    content, message = PICTURES[name]
    sentence = refusal(scene_with(tmp_path, name, content))
    assert name in sentence
    assert message in sentence


@pytest.mark.parametrize("name", ["plugin.so", "scene.xml"])
def test_only_meshes_are_meshes(name: str, tmp_path: Path) -> None:
    assert "not named .ply or .obj" in refusal(scene_with(tmp_path, name, b"<scene version='3.0.0'/>"))


@pytest.mark.parametrize(
    "name",
    [
        "../secret.png",
        "a/../../secret.png",
        "/etc/passwd",
        "absent.png",
        ".",
        "x" * 150,
        "x" * 201,
        "x\\u0000.png",
        "x\\u001b[2J.png",
        "",
    ],
)
def test_names_that_lead_nowhere_good(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    assert "material.texture" in refusal(scene_with(folder, name, None))


def test_links_out_of_the_folder_pipes_and_devices(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "device.png").symlink_to("/dev/zero")
    (folder / "circle.png").symlink_to(folder / "circle.png")
    os.mkfifo(folder / "pipe.png")
    for name, message in {
        "link.png": "lies outside",
        "device.png": "lies outside",
        "circle.png": "there is no file",
        "pipe.png": "there is no file",
    }.items():
        sentence = refusal(scene_with(folder, name, None))
        assert message in sentence
        assert name in sentence


def test_a_file_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    scene_with(tmp_path, "large.png", png())
    os.truncate(tmp_path / "large.png", 1 << 30)
    assert "1073741824 bytes, more than" in refusal(tmp_path)


BALL = """position_mm = [0, 0, 500]
shape = { type = "sphere", radius_mm = 5 }
material = { reflectance = [1, 1, 1] }
"""
TOMLS: dict[str, tuple[str, str]] = {
    "deep array": ("x = " + "[" * 100_000, "not valid TOML"),
    "1e999": (scene_toml().replace("500]", "1e999]"), "'objects[0].position_mm[2]'"),
    "large integer": (scene_toml().replace("500]", "9" * 400 + "]"), "'objects[0].position_mm[2]'"),
    "huge integer": (scene_toml().replace("500]", "9" * 5000 + "]"), "not valid TOML"),
    "many objects": (
        "title = 't'\n" + "".join(f"[[objects]]\nname = 'a{n}'\n{BALL}" for n in range(1001)),
        "'objects': tuple should have at most 1000 items",
    ),
    "twice the same key": (scene_toml() + 'name = "b"\n', "not valid TOML"),
    "plugin path": (scene_toml(shape='type = "../../x"'), "'../../x'"),
    "unknown key": (scene_toml(material='reflectance = [1, 1, 1], bsdf = "x"'), "unknown key"),
    "escapes in a name": (scene_toml().replace('"a"', '"a\\u001b[2J"'), "'objects[0].name'"),
    "long name": (scene_toml().replace('"a"', '"' + "a" * 500_000 + '"'), "'objects[0].name'"),
    "not text": ("\x00\x01", "not valid TOML"),
    "a megabyte": ("# " + "x" * (1 << 20), "524288 bytes"),
}


@pytest.mark.parametrize("what", TOMLS)
def test_scene_files_are_refused(what: str, tmp_path: Path) -> None:
    content, message = TOMLS[what]
    (tmp_path / "scene.toml").write_text(content)
    sentence = refusal(tmp_path)
    assert "scene.toml" in sentence
    assert message in sentence


def test_a_scene_file_that_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "scene.toml")
    assert "there is no scene" in refusal(tmp_path)
    (tmp_path / "scene.toml").unlink()
    (tmp_path / "scene.toml").touch()
    os.truncate(tmp_path / "scene.toml", 1 << 30)
    assert "this has more" in refusal(tmp_path)


@pytest.mark.parametrize("name", ["thing.ply", "thing.png"])
def test_the_command_leaves_with_2_and_one_line(name: str, tmp_path: Path) -> None:
    scene_with(tmp_path, name, b"nonsense")
    command = [
        sys.executable,
        "-m",
        "simgen.app.commands",
        "preview",
        str(tmp_path),
        "-o",
        str(tmp_path / "x.png"),
    ]
    script = "import sys; from simgen.app.commands import main; sys.exit(main())"
    command = [sys.executable, "-c", script, *command[3:]]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 2
    assert run.stderr.startswith("error: ")
    assert name in run.stderr
    assert run.stderr.count("\n") == 1
    assert not (tmp_path / "x.png").exists()


def exr(path: Path, names: str = "RGB", value: float = 1.0, height: int = 4) -> Path:
    planes: dict[str, Any] = {name: np.full((height, 8), value, np.float32) for name in names}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes).write(str(path))
    return path


def test_environments_that_cannot_shine(tmp_path: Path) -> None:
    sky = exr(tmp_path / "sky.exr")
    truncated = tmp_path / "truncated.exr"
    truncated.write_bytes(sky.read_bytes()[:-40])
    window = sky.read_bytes().replace(
        np.array([0, 0, 7, 3], "<i4").tobytes(), np.array([0, 0, 99_999, 99_999], "<i4").tobytes()
    )
    large = tmp_path / "large.exr"
    large.write_bytes(window)
    radiance = tmp_path / "sky.hdr"
    radiance.write_bytes(b"#?RADIANCE\n")
    for path, message in (
        (exr(tmp_path / "nan.exr", value=np.nan), "the value nan"),
        (exr(tmp_path / "inf.exr", value=np.inf), "the value inf"),
        (exr(tmp_path / "negative.exr", value=-1.0), "the value -1"),
        (exr(tmp_path / "grey.exr", names="Y"), "R, G and B are needed"),
        (truncated, "its header cannot be read"),
        (large, "100000 x 100000 px, and at most"),
        (radiance, "convert it to OpenEXR"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            read_environment(path)
        assert str(path) in str(caught.value)
    np.testing.assert_array_equal(read_environment(sky), np.ones((4, 8, 3), np.float32))
