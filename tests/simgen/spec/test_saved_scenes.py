"""Scenes as text and as folders: what is saved and loaded is the same, and nothing of the user's is lost."""

import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from two_things import BALL, NAMED, SCENE, SKY

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


def test_a_comment_stays_a_comment() -> None:
    hostile = ["a\rtitle = 1\x0b[[objects]]\x85x", "b\x00\u2028y = 2", ""]
    lines = toml_text(SCENE, hostile).split("\n")
    first = lines.index("")
    assert all(line.startswith("#") for line in lines[:first])
    assert tomllib.loads("\n".join(lines)) == tomllib.loads(toml_text(SCENE))


WORDS = st.text(max_size=40) | st.sampled_from(
    ['"""', "\\", "a\r\nb", "\n\n", '\\"\n"', "\x7f\x00\t", "''' é\n"]
)
NUMBERS = st.floats(-1e6, 1e6)
LENGTHS = st.floats(1e-6, 1e6)
SHARES = st.floats(0, 1)
VECTORS = st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3)
FILES = st.text(min_size=1, max_size=30).filter(str.isprintable)
NOISE = st.fixed_dictionaries(
    {"type": st.just("noise"), "contrast": st.just(0.01)},
    optional={"seed": st.integers(0, 2**63 - 1), "exponent": st.floats(0, 4), "chroma": SHARES},
)
LETTERS = st.text(min_size=1, max_size=9).filter(
    lambda text: text.isprintable() and text.strip() and max(text) <= "ÿ"
)
TABLES = st.integers(2, 5).flatmap(
    lambda count: st.fixed_dictionaries(
        {
            "wavelength_nm": st.lists(st.floats(1, 700), min_size=count, max_size=count, unique=True)
            .map(sorted)
            .filter(lambda nm: nm[-1] > 380),
            "value": st.lists(SHARES, min_size=count, max_size=count),
        }
    )
)
MATERIALS = st.one_of(
    st.fixed_dictionaries(
        {"texture": FILES | NOISE | LETTERS.map(lambda text: {"type": "text", "text": text})}
    ),
    st.fixed_dictionaries({"reflectance": st.tuples(SHARES, SHARES, SHARES) | TABLES, "normal_map": FILES}),
    st.fixed_dictionaries(
        {
            "reflectance": st.just("dark skin"),
            "finish": st.fixed_dictionaries({"type": st.just("principled"), "metallic": SHARES | FILES}),
        }
    ),
)
THINGS = st.fixed_dictionaries(
    {
        "position_mm": st.tuples(NUMBERS, NUMBERS, NUMBERS),
        "rotation_deg": VECTORS,
        "shape": st.fixed_dictionaries({"type": st.just("mesh"), "file": FILES, "scale": LENGTHS}),
        "material": MATERIALS,
    }
)
SCENES = st.fixed_dictionaries(
    {
        "title": WORDS.filter(lambda text: text.isprintable()),
        "description": WORDS,
        "objects": st.lists(THINGS, max_size=2).map(
            lambda things: [{"name": f"a{number}", **thing} for number, thing in enumerate(things)]
        ),
        "lights": st.just([SKY]),
        "planes_mm": st.lists(LENGTHS, max_size=2),
    },
    optional={"backdrop": st.fixed_dictionaries({"z_mm": LENGTHS, "half_width_mm": st.floats(0, 1e6)})},
)


@given(values=SCENES)
def test_any_scene_is_the_same_once_saved_and_loaded(values: dict[str, Any]) -> None:
    scene = Scene(**values)
    assert same(Scene.model_validate(tomllib.loads(toml_text(scene))), scene)
    bare = scene.change(objects=())  # whose files are not there
    with TemporaryDirectory() as folder:
        assert same(load_scene(bare.save(folder)), bare)


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
