"""Scenes as text and as folders: what is saved and loaded is the same, and nothing of the user's is lost."""

import tomllib
from pathlib import Path

import pytest
from two_things import BALL, NAMED, SCENE

from pcii.base import InputError
from simgen import Material, Scene, Spectrum, load_scene
from simgen.base import LARGEST_TOML_BYTES, toml_text
from simgen.spec import scene_names


def same(loaded: Scene, scene: Scene) -> bool:
    """To the digit: 0.0 and -0.0 are equal, and not the same."""
    return loaded == scene and loaded.model_dump_json() == scene.model_dump_json()


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_that_ships_is_the_same_once_saved_and_loaded(name: str, tmp_path: Path) -> None:
    scene = load_scene(name)
    file = scene.save(tmp_path / "new" / name)
    loaded = load_scene(file)
    assert same(loaded, scene)
    assert loaded.folder == file.parent
    assert same(Scene.model_validate(tomllib.loads(toml_text(scene, ["a", "b"]))), scene)


def test_the_text_is_laid_out_as_in_the_scenes_that_ship() -> None:
    text = toml_text(NAMED.change(description='First.\n"Second"\n'), ["by hand\nin two lines"])
    assert text.startswith('# by hand\n# in two lines\n\ntitle = "Two things"\ndescription = """\nFirst.\n')
    assert (
        '\n\n[[objects]]\nname = "ball"\nposition_mm = [10.0, 0.0, 540.0]\n'
        'shape = { type = "sphere", radius_mm = 30.0 }\nmaterial = { texture = "a.png" }\n\n[[objects]]'
    ) in text
    assert "objects" not in toml_text(SCENE.change(objects=()))


@pytest.mark.parametrize("words", ['"""', "\\", "a\r\nb", "\n\n", '\\"\n"', "\x7f\x00\t", "''' é\n"])
def test_words_are_the_same_once_saved_and_loaded(words: str, tmp_path: Path) -> None:
    scene = SCENE.change(description=words)
    assert same(load_scene(scene.save(tmp_path)), scene)


def test_files_go_along_and_saving_again_changes_nothing(tmp_path: Path) -> None:
    source, out = tmp_path / "source", tmp_path / "out"
    (source / "art").mkdir(parents=True)
    (source / "a.png").write_bytes(b"first")
    (source / "art" / "b.png").write_bytes(b"second")
    scene = NAMED.replace("card", material=Material(texture="art/b.png")).change(folder=source)
    (out / "mine").mkdir(parents=True)
    scene.save(out)
    files = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
    assert {file.relative_to(out).as_posix() for file in files} == {"a.png", "art/b.png", "scene.toml"}
    assert (out / "art" / "b.png").read_bytes() == b"second"
    scene.save(out)
    assert {file: file.read_bytes() for file in files} == files
    assert (out / "mine").is_dir()


@pytest.mark.parametrize("name", ["scene.toml", "a.png"])
def test_what_is_there_is_kept_unless_it_may_be_overwritten(name: str, tmp_path: Path) -> None:
    source, out = tmp_path / "source", tmp_path / "out"
    for folder in (source, out):
        folder.mkdir()
    (source / "a.png").write_bytes(b"new")
    (out / name).write_bytes(b"mine")
    scene = NAMED.change(folder=source)
    with pytest.raises(InputError, match=rf"^{out / name}: is there with other content; .* overwrite=True$"):
        scene.save(out)
    assert [(file.name, file.read_bytes()) for file in out.iterdir()] == [(name, b"mine")]
    scene.save(out, overwrite=True)
    assert load_scene(out) == scene
    assert (out / "a.png").read_bytes() == b"new"


def test_a_scene_that_cannot_be_saved_writes_nothing(tmp_path: Path) -> None:
    file, out = tmp_path / "file", tmp_path / "out"
    file.write_text("mine")
    with pytest.raises(InputError, match=r"file: this is a file; name a folder for the scene"):
        SCENE.save(file)
    with pytest.raises(
        InputError, match=r"^scene: object 'ball', material.texture: there is no file 'a.png'"
    ):
        NAMED.change(folder=tmp_path).save(out)
    (tmp_path / "taken" / "scene.toml").mkdir(parents=True)
    with pytest.raises(InputError, match=r"scene.toml: is there with other content"):
        SCENE.save(tmp_path / "taken", overwrite=True)
    wavelength_nm = tuple(380 + 0.1234567 * n for n in range(2000))
    spectrum = Spectrum(wavelength_nm=wavelength_nm, value=(1 / 3,) * 2000)
    rainbow = BALL.change(material=Material(reflectance=spectrum))
    with pytest.raises(InputError, match=rf"a scene.toml may have {LARGEST_TOML_BYTES} bytes, and this"):
        SCENE.add(*(rainbow.change(name=f"a{n}") for n in range(10))).save(out)
    assert not out.exists()
