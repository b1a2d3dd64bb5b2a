"""Strangers' scenes: whatever their files do, the answer is one sentence, soon, and this process lives."""

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
from simgen.assets import asset_files as assets
from simgen.assets import asset_worker
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
    "text index 2e9": (ply(faces="3 0 1 2000000000\n"), "vertex 2000000000"),
    "text index -1": (ply(faces="3 0 1 -1\n"), "vertex -1"),
    "text index 0.5": (ply(faces="3 0 1 0.5\n"), "not a whole number"),
    "text index nan": (ply(faces="3 0 1 nan\n"), "not a whole number"),
    "nan vertex": (ply("0 0 0\n10 nan 0\n0 10 0\n"), "a position of nan"),
    "inf vertex": (ply("0 0 0\n10 inf 0\n0 10 0\n"), "a position of inf"),
    "far vertex": (ply("0 0 0\n10 1e38 0\n0 10 0\n"), "a position of 1e+38"),
    "no extent": (ply("1 1 1\n1 1 1\n1 1 1\n"), "no extent"),
    "1e12 vertices": (ply(vertex_count=10**12), "1000000000000 vertices; at most"),
    "4e6 vertices": (ply(vertex_count=4_000_000), "ends before its 4000000"),
    "10^300 vertices": (ply(vertex_count="1" + "0" * 300), "header line"),
    "-1 vertices": (ply(vertex_count=-1), "header line"),
    "1e12 faces": (ply(face_count=10**12), "1000000000000 faces; at most"),
    "4e6 faces": (ply(face_count=4_000_000), "ends before its 4000000"),
    "no faces": (ply(faces="", face_count=0), "has no faces"),
    "truncated": (binary_ply(0, 1, 2)[:-5], "ends before"),
    "truncated vertices": (binary_ply(0, 1, 2)[:-30], "ends before"),
    "face of 255 corners": (binary_ply(0, 1, 2, count=255), "ends before"),
    "face of 2 corners": (binary_ply(0, 1), "a face of 2 corners"),
    "face of -1 corners": (ply(faces="-1 0 1 2\n", list_types="char int"), "a list of length -1"),
    "face of 1e300 corners": (ply(faces="1e300 0 1 2\n"), "a list of length 1e+300"),
    "float list length": (ply(list_types="float int"), "a property that makes no sense"),
    "unknown type": (ply(list_types="uchar int128"), "a property that makes no sense"),
    "no header": (b"", "no PLY header"),
    "endless header": (b"ply\n" + b"comment x\n" * 100_000, "no PLY header"),
    "wrong magic": (b"\x7fELF" + bytes(100), "no PLY header"),
    "words": (ply("0 0 0\n10 __import__('os') 0\n0 10 0\n"), "a word among its numbers"),
    "escapes in the header": (ply(form="\x1b[2J\x07 1.0"), "header line"),
    "no coordinates": (ply().replace(b"float x", b"float q"), "no vertices with x, y and z"),
    "many properties": (ply().replace(b"property float x\n", b"property float x\n" * 999), "header line"),
}
OBJS: dict[str, tuple[bytes, str]] = {
    "index 2e9": (obj("f 1 2 2000000000"), "line 5 that cannot be used: 'f 1 2 2000000000'"),
    "index 0": (obj("f 0 1 2"), "line 5"),
    "index -4": (obj("f -1 -2 -4"), "line 5"),
    "huge index": (obj("f 1 2 " + "9" * 5000), "line 5"),
    "nan": (obj("v nan 0 0", "f 1 2 4"), "a position of nan"),
    "call": (obj("call /etc/passwd"), "line 5 that cannot be used: 'call /etc/passwd'"),
    "shell": (obj("csh rm -rf /"), "line 5 that cannot be used"),
    "no faces": (b"v 0 0 0\n", "has no faces"),
    "two corners": (obj("f 1 2"), "a face of 2 corners"),
    "empty": (b"", "has no faces"),
    "binary": (bytes(range(256)) * 100, "line 1 that cannot be used"),
    "slashes": (obj("f 1/1/1/1 2 3"), "line 5"),
}
PICTURES: dict[str, tuple[bytes, str]] = {
    "bomb.png": (png(width=60_000, height=60_000, data=BOMB), "60000 x 60000 px, and at most 67108864"),
    "billions.png": (png(width=2**31 - 1, height=2**31 - 1), "and at most 67108864 pixels"),
    "no_pixels.png": (png(width=0, height=0), "its header cannot be read"),
    "text_bomb.png": (png(extra=chunk(b"zTXt", b"a\0\0" + BOMB)), "too large"),
    "profile_bomb.png": (png(extra=chunk(b"iCCP", b"a\0\0" + BOMB)), "too large"),
    "truncated.png": (png()[:-30], "its header cannot be read"),
    "checksum.png": (png()[:-20] + b"\0\0\0\0" + png()[-16:], "damaged or cut off"),
    "two.png": (animation(), "holds 2 pictures"),
    "clear.png": (picture("RGBA", "PNG"), "not opaque everywhere"),
    "clear_palette.png": (picture("P", "PNG", transparency=0), "not opaque everywhere"),
    "print.jpg": (picture("CMYK", "JPEG"), "a CMYK picture"),
    "print.tif": (picture("CMYK", "TIFF"), "of the kind SEPARATED"),
    "float.tif": (picture("F", "TIFF"), "a picture of float32"),
    "truncated.jpg": (picture("RGB", "JPEG")[:-200], "its header cannot be read"),
    "gif.png": (picture("RGB", "GIF"), "not a PNG, JPEG or TIFF"),
    "page.png": (b"%!PS-Adobe-3.0\n", "not a PNG, JPEG or TIFF"),
    "empty.png": (b"", "not a PNG, JPEG or TIFF"),
    "huge_directory.tif": (b"II*\0\x08\0\0\0" + b"\xff" * 4000, "cannot be read"),
    "circle.tif": (b"II*\0\x08\0\0\0\0\0\x08\0\0\0", "pixels of the type None"),
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
    "deep array": ("x = " + "[" * 100_000, "nested too deeply"),
    "deep table": ("x = " + "{a=" * 100_000, "nested too deeply"),
    "deep key": (".".join("a" * 50_000) + " = 1", "a key of more than 32 parts"),
    "deep quoted key": (".".join(['"!"'] * 50_000) + " = 1", "a key of more than 32 parts"),
    "deep header": ("[" + " . ".join("a" * 50_000) + "]", "a key of more than 32 parts"),
    "deep values": ("title = " + "[" * 200 + "]" * 200, "'title'"),
    "many entries": ("title = 't'\nlights = [" + "1," * 250_000 + "]", "'lights[0]'"),
    "1e999": (scene_toml().replace("500]", "1e999]"), "'objects[0].position_mm[2]'"),
    "1e300": (scene_toml().replace("500]", "1e300]"), "'objects[0].position_mm[2]'"),
    "nan": (scene_toml().replace("500]", "nan]"), "'objects[0].position_mm[2]'"),
    "large integer": (scene_toml().replace("500]", "9" * 400 + "]"), "'objects[0].position_mm[2]'"),
    "huge integer": (scene_toml().replace("500]", "9" * 5000 + "]"), "not valid TOML"),
    "huge hexadecimal": (scene_toml().replace("500]", "0x" + "f" * 50_000 + "]"), "position_mm[2]'"),
    "many objects": (
        "title = 't'\n" + "".join(f"[[objects]]\nname = 'a{n}'\n{BALL}" for n in range(1001)),
        "'objects': tuple should have at most 1000 items",
    ),
    "many long keys": (
        "".join(f"{'.'.join('a' * 31)}{n} = 1\n" for n in range(7000)),
        "unknown key 'a'",
    ),
    "twice the same key": (scene_toml() + 'name = "b"\n', "not valid TOML"),
    "plugin path": (scene_toml(shape='type = "../../x"'), "'../../x'"),
    "plugin name": (scene_toml(shape='type = "ply", filename = "/etc/passwd"'), "'ply'"),
    "shape of the renderer": (scene_toml(shape='type = "sdfgrid"'), "'sdfgrid'"),
    "unknown key": (scene_toml(material='reflectance = [1, 1, 1], bsdf = "x"'), "unknown key"),
    "escapes in a name": (scene_toml().replace('"a"', '"a\\u001b[2J"'), "'objects[0].name'"),
    "escapes in a title": (scene_toml().replace('"t"', '"t\\u001b[2J\\u009b"'), "'title'"),
    "long name": (scene_toml().replace('"a"', '"' + "a" * 500_000 + '"'), "'objects[0].name'"),
    "long key": ("a" * 500_000 + " = 1", "unknown key"),
    "long illuminant": (
        scene_toml().replace("= 1.0", f'= 1.0\nilluminant = "{"D" * 9999}"', 1),
        "illuminant",
    ),
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


def test_dots_in_a_description_are_no_deep_key(tmp_path: Path) -> None:
    text = f'description = "{"wait... " * 100}. {"." * 1000}"\n' + scene_toml()
    (tmp_path / "scene.toml").write_text(text)
    assert load_scene(str(tmp_path))[0].objects[0].name == "a"


# Faults of a decoder, planted where it is called.
_PLANTED = """
import os, sys
from simgen.assets import asset_worker
def planted(kind, path):
    %s
    yield
asset_worker._decode = planted
"""
FAULTS = {
    "kill": ("os.kill(os.getpid(), 11)", "ends the process that reads it"),
    "leave": ("os._exit(0)", "ends the process that reads it"),
    "hang": ("import time; time.sleep(60)", "takes longer than 1 s"),
    "spin": ("while True: pass", "takes longer than 1 s"),
    "bloat": ("x = bytearray(3 << 30)", "takes more than 2048 MiB"),
    "recurse": ("planted_again = lambda: planted_again(); planted_again()", "cannot be read (RecursionError"),
    "chatter": ("print('x' * 100000); raise ValueError('is odd')", "this file is odd"),
    "write": ("open('written', 'wb').write(b'x' * 9999999)", "File too large"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_decoder_that_fails_is_told_and_survived(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deed, message = FAULTS[fault]
    start, sound = assets._START.rsplit("from", 1)
    monkeypatch.setattr(assets, "_START", f"{start}\n{_PLANTED % deed}\nfrom{sound}")
    if "takes longer" in message:  # a busy machine needs a second to start the process
        monkeypatch.setattr(assets, "SECONDS", 1)
    monkeypatch.chdir(tmp_path)
    sentence = refusal(scene_with(tmp_path, "thing.png", png()))
    assert "thing.png" in sentence
    assert message in sentence


def test_no_process_is_started_for_a_scene_without_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    (tmp_path / "scene.toml").write_text(scene_toml())
    monkeypatch.setattr(subprocess, "Popen", never)
    read_assets(*load_scene(str(tmp_path)))


def test_the_working_directorys_code_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("numpy", "PIL", "simgen", "json"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'w')")
    scene_with(tmp_path, "fine.png", png())
    monkeypatch.chdir(tmp_path)
    assert read_assets(*load_scene(str(tmp_path))).image("fine.png").shape == (4, 4, 3)
    assert not (tmp_path / "ran").exists()


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


def test_limits_are_those_of_the_worker() -> None:
    assert asset_worker.MEMORY_BYTES == 2 << 30
    assert assets.SECONDS <= 10
