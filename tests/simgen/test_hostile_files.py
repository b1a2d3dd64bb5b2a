"""Strangers' scenes: whatever is wrong with their files, the answer is one sentence, soon."""

import os
from pathlib import Path

import numpy as np
import pytest
from hostile_files import BOMB, animation, binary_ply, obj, picture, ply, png, scene_toml
from png_files import chunk

from pcii.base import InputError, command_line
from pcii.store import write_exr_safely
from simgen.app import commands
from simgen.assets import read_assets
from simgen.assets.asset_files import read_environment
from simgen.spec import load_scene

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
        read_assets(load_scene(str(folder)), folder)
    assert spent_s() - start < LIMIT_S
    sentence = str(caught.value)
    assert sentence.isprintable()
    assert len(sentence) < 800
    return sentence


def scene_with(folder: Path, name: str, content: bytes | None) -> Path:
    """A scene whose object is, or wears, the file of this name."""
    is_mesh = name.endswith((".ply", ".obj", ".xml"))
    fields = {"shape": f'type = "mesh", file = "{name}"'} if is_mesh else {"material": f'texture = "{name}"'}
    (folder / "scene.toml").write_text(scene_toml(**fields))
    if content is not None:
        (folder / name).write_bytes(content)
    return folder


FILES: dict[str, tuple[str, bytes, str]] = {
    "index 2e9": ("a.ply", binary_ply(0, 1, 2_000_000_000), "vertex 2000000000, but only vertices 0 to 2"),
    "index -1": ("a.ply", binary_ply(0, 1, -1), "vertex -1"),
    "nan vertex": ("a.ply", ply("0 0 0\n10 nan 0\n0 10 0\n"), "a position of nan"),
    "no extent": ("a.ply", ply("1 1 1\n1 1 1\n1 1 1\n"), "no extent"),
    "1e12 vertices": ("a.ply", ply(vertex_count=10**12), "cannot be read"),
    "no faces": ("a.ply", ply(faces="", face_count=0), "has no faces"),
    "truncated mesh": ("a.ply", binary_ply(0, 1, 2)[:-5], "cannot be read: element 'face'"),
    "face of 2 corners": ("a.ply", binary_ply(0, 1), "a face of 2 corners"),
    "no mesh": ("a.ply", b"\x7fELF" + bytes(100), "cannot be read: line 1"),
    "words": ("a.ply", ply("0 0 0\n10 __import__('os') 0\n0 10 0\n"), "malformed input"),
    "no coordinates": ("a.ply", ply().replace(b"float x", b"float q"), "no vertices with x, y and z"),
    "index of an OBJ": ("a.obj", obj("f 1 2 2000000000"), "line 5 that cannot be used: 'f 1 2 2000000000'"),
    "index 0": ("a.obj", obj("f 0 1 2"), "line 5"),
    "empty": ("a.obj", b"", "has no faces"),
    "curved surface": ("a.obj", obj("f 1 2 3\nsurf 0 1 0 1"), "line 6 that cannot be used: 'surf 0 1 0 1'"),
    "part of a vertex": (
        "a.ply",
        ply(faces="3 0 1 1.5\n").replace(b"list uchar int", b"list uchar float"),
        "a face whose vertex is not a whole number",
    ),
    "XML": ("scene.xml", b"<scene version='3.0.0'/>", "not named .ply or .obj"),
    "bomb": ("a.png", png(width=60_000, height=60_000, data=BOMB), "exceeds limit"),
    "text bomb": ("a.png", png(extra=chunk(b"zTXt", b"a\0\0" + BOMB)), "too large"),
    "truncated": ("a.png", png()[:-30], "damaged or cut off"),
    "checksum": ("a.png", png()[:-20] + b"\0\0\0\0" + png()[-16:], "damaged or cut off"),
    "two pictures": ("a.png", animation(), "holds 2 pictures"),
    "clear": ("a.png", picture("RGBA", "PNG"), "not opaque everywhere"),
    "CMYK": ("a.jpg", picture("CMYK", "JPEG"), "of the kind CMYK; save it as RGB"),
    "real numbers": ("a.tif", picture("F", "TIFF"), "channels of float32; save one page"),
    "no picture": ("a.png", b"", "not a PNG, JPEG or TIFF"),
    "huge directory": ("a.tif", b"II*\0\x08\0\0\0" + b"\xff" * 4000, "cannot be read"),
}


@pytest.mark.parametrize("case", FILES)
def test_files_that_cannot_be_used_are_refused(case: str, tmp_path: Path) -> None:
    name, content, message = FILES[case]
    sentence = refusal(scene_with(tmp_path, name, content))
    assert name in sentence
    assert message in sentence


@pytest.mark.parametrize(
    "name",
    ["../secret.png", "a/../../secret.png", "/etc/passwd", "absent.png", ".", "x" * 201, "x\\u001b[2J.png"],
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
    assert "larger than the 268435456 bytes" in refusal(tmp_path)
    os.truncate(tmp_path / "scene.toml", 1 << 30)
    assert "524288 bytes" in refusal(tmp_path)


TOMLS: dict[str, tuple[str, str]] = {
    "deep array": ("x = " + "[" * 100_000, "not valid TOML"),
    "1e999": (scene_toml().replace("500]", "1e999]"), "'objects[0].position_mm[2]'"),
    "huge integer": (scene_toml().replace("500]", "9" * 5000 + "]"), "not valid TOML"),
    "plugin path": (scene_toml(shape='type = "../../x"'), "'../../x'"),
    "not text": ("\x00\x01", "not valid TOML"),
}


@pytest.mark.parametrize("what", TOMLS)
def test_scene_files_are_refused(what: str, tmp_path: Path) -> None:
    content, message = TOMLS[what]
    (tmp_path / "scene.toml").write_text(content)
    sentence = refusal(tmp_path)
    assert "scene.toml" in sentence
    assert message in sentence


def test_dots_in_a_description_are_no_deep_key(tmp_path: Path) -> None:
    text = f'description = "{"wait... " * 100}. {"." * 1000}"\n' + scene_toml()
    (tmp_path / "scene.toml").write_text(text)
    assert load_scene(str(tmp_path)).objects[0].name == "a"


def test_the_command_leaves_with_2_and_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Of libraries nothing is printed either."""
    scene_with(tmp_path, "thing.ply", b"nonsense")
    arguments = ["preview", str(tmp_path), "-o", str(tmp_path / "x.png")]
    assert command_line.run(commands.app, arguments) == 2
    error = capfd.readouterr().err
    assert error.startswith("error: ")
    assert "thing.ply" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "x.png").exists()


def test_environments_that_cannot_shine(tmp_path: Path) -> None:
    def exr(name: str, pixels: np.ndarray) -> Path:
        write_exr_safely(tmp_path / name, pixels.astype(np.float32))
        return tmp_path / name

    ones = np.ones((4, 8, 3))
    sky = exr("sky.exr", ones)
    (tmp_path / "truncated.exr").write_bytes(sky.read_bytes()[:-40])
    large = sky.read_bytes().replace(
        np.array([0, 0, 7, 3], "<i4").tobytes(), np.array([0, 0, 99_999, 99_999], "<i4").tobytes()
    )
    (tmp_path / "large.exr").write_bytes(large)
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\n")
    for path, message in (
        (exr("nan.exr", np.nan * ones), "not finite"),
        (exr("negative.exr", -ones), "negative"),
        (exr("grey.exr", ones[..., :1]), "4 x 8 px, 1 channels .* R, G and B, twice as wide as high"),
        (exr("square.exr", ones[:, :4]), "4 x 4 px, 3 channels .* twice as wide as high"),
        (tmp_path / "truncated.exr", "damaged or cut off"),
        (tmp_path / "large.exr", "cannot be read"),
        (tmp_path / "sky.hdr", "not an EXR picture"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            read_environment(path)
        assert str(path) in str(caught.value)
    np.testing.assert_array_equal(read_environment(sky), ones)
