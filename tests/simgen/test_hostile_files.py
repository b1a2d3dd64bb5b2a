"""Strangers' scenes: whatever is wrong with their files, the answer is one sentence."""

import os
from pathlib import Path

import numpy as np
import pytest
from hostile_files import BOMB, animation, binary_ply, obj, picture, ply, png, scene_toml

from pcii.base import InputError, command_line
from pcii.store import write_exr_safely
from simgen.app import commands
from simgen.assets import read_assets
from simgen.spec import load_scene


def refusal(folder: Path) -> str:
    """The sentence with which the scene in this folder is refused, by the way that every command takes.

    `build` begins with `read_assets`, before the renderer sees anything.
    """
    with pytest.raises(InputError) as caught:
        read_assets(load_scene(str(folder)), folder)
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
    "no faces": ("a.ply", ply(faces="", face_count=0), "has no faces"),
    "truncated mesh": ("a.ply", binary_ply(0, 1, 2)[:-5], "cannot be read: element 'face'"),
    "words": ("a.ply", ply("0 0 0\n10 __import__('os') 0\n0 10 0\n"), "malformed input"),
    "index of an OBJ": ("a.obj", obj("f 1 2 2000000000"), "line 5 that cannot be used: 'f 1 2 2000000000'"),
    "empty": ("a.obj", b"", "has no faces"),
    "XML": ("scene.xml", b"<scene version='3.0.0'/>", "not named .ply or .obj"),
    "bomb": ("a.png", png(60_000, BOMB), "exceeds limit"),
    "truncated": ("a.png", png()[:-30], "damaged or cut off"),
    "two pictures": ("a.png", animation(), "holds 2 pictures"),
    "clear": ("a.png", picture("RGBA", "PNG"), "not opaque everywhere"),
    "CMYK": ("a.jpg", picture("CMYK", "JPEG"), "of the kind CMYK; save it as RGB"),
    "no picture": ("a.png", b"", "not a PNG, JPEG or TIFF"),
}


@pytest.mark.parametrize("case", FILES)
def test_files_that_cannot_be_used_are_refused(case: str, tmp_path: Path) -> None:
    name, content, message = FILES[case]
    sentence = refusal(scene_with(tmp_path, name, content))
    assert name in sentence
    assert message in sentence


@pytest.mark.parametrize("name", ["../secret.png", "/etc/passwd", "absent.png", "x\\u001b[2J.png"])
def test_names_that_lead_nowhere_good(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    assert "material.texture" in refusal(scene_with(folder, name, None))


def test_links_out_of_the_folder_and_pipes(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    os.mkfifo(folder / "pipe.png")
    for name, message in {"link.png": "lies outside", "pipe.png": "there is no file"}.items():
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
    "1e999": (scene_toml().replace("500]", "1e999]"), "'objects[0].position_mm[2]'"),
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
    ones = np.ones((4, 8, 3))
    pictures = {"nan.exr": np.nan * ones, "negative.exr": -ones, "square.exr": ones[:, :4], "sky.exr": ones}
    for name, pixels in pictures.items():
        write_exr_safely(tmp_path / name, pixels.astype(np.float32))
    (tmp_path / "truncated.exr").write_bytes((tmp_path / "sky.exr").read_bytes()[:-40])
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\n")
    for name, message in {
        "nan.exr": "not finite",
        "negative.exr": "negative",
        "square.exr": "4 x 4 px, 3 channels",
        "truncated.exr": "damaged or cut off",
        "sky.hdr": "not an EXR picture",
    }.items():
        light = f'[[lights]]\ntype = "environment"\nfile = "{name}"\nluminance_cd_m2 = 1.0\n'
        (tmp_path / "scene.toml").write_text(f'title = "t"\n{light}')
        sentence = refusal(tmp_path)
        assert name in sentence
        assert message in sentence
