"""Files that people write: defaults, overrides, and one sentence for each mistake."""

from pathlib import Path

import pytest

from pcii.errors import InputError
from simgen.recipe import Recipe, load_recipe
from simgen.scene import Scene, load_scene, scene_names
from simgen.schema import validate

LIGHT = {"type": "uniform", "luminance_cd_m2": 1.0}


def scene_with(**thing: object) -> dict:
    whole = {
        "name": "a",
        "position_mm": [0, 0, 500],
        "shape": {"type": "sphere", "radius_mm": 5},
        "material": {"reflectance": [1, 1, 1]},
    }
    return {"title": "t", "lights": [LIGHT], "objects": [whole | thing]}


def test_the_papers_recipe_says_what_the_paper_says() -> None:
    recipe, _ = load_recipe("paper")
    grid = recipe.grid.camera_grid()
    assert grid.shape_KLHW == (10, 10, 1024, 1024)
    assert (recipe.cfa, recipe.photons.budget, recipe.photons.scope) == ("GRBG", 1000, "view")
    assert recipe.analysis.z_mm == (540, 620)


def test_overrides_take_toml_values_and_bare_words() -> None:
    recipe, _ = load_recipe("paper", ["photons.budget=300", "sensor.cfa=RGGB", "grid.pitch_mm=[2.0, 3.0]"])
    assert recipe.photons.budget == 300
    assert recipe.cfa == "RGGB"
    assert recipe.grid.pitch_mm == (2.0, 3.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"scene": "x", "gird": {}}, "unknown key 'gird'; did you mean 'grid'?"),
        ({"scene": "x", "grid": {"pich_mm": [1, 1]}}, "unknown key 'grid.pich_mm'; did you mean 'pitch_mm'?"),
        ({}, "'scene' is missing"),
        (
            {"scene": "x", "grid": {"rows": 0}},
            "'grid.rows': input should be greater than or equal to 1, got 0",
        ),
        ({"scene": "x", "sensor": {"cfa": "GRGB"}}, "'GRBG', 'RGGB', 'BGGR', 'GBRG' or 'none', got 'GRGB'"),
        ({"scene": "x", "photons": {"budget": float("nan")}}, "'photons.budget'"),
    ],
)
def test_a_wrong_recipe_is_told_in_one_sentence(values: dict, message: str) -> None:
    with pytest.raises(InputError) as caught:
        validate(Recipe, values, "r.toml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("r.toml: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            scene_with(shape={"type": "sphere", "radius": 5}),
            "unknown key 'objects[0].shape.radius'; did you mean 'radius_mm'?",
        ),
        (scene_with(shape={"type": "shpere", "radius_mm": 5}), "'shpere'"),
        (scene_with(material={}), "'objects[0].material': give either 'reflectance' or 'texture'"),
        (scene_with(material={"reflectance": [1, 2, 0]}), "'objects[0].material.reflectance[1]'"),
        (scene_with(name="../x"), "'objects[0].name'"),
        ({"title": "t", "lights": []}, "'lights'"),
        (scene_with() | {"objects": scene_with()["objects"] * 2}, "two objects are named 'a'"),
    ],
)
def test_a_wrong_scene_is_told_in_one_sentence(values: dict, message: str) -> None:
    with pytest.raises(InputError) as caught:
        validate(Scene, values, "s.toml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_recipe_or_scene_gets_a_suggestion() -> None:
    with pytest.raises(InputError, match="did you mean 'paper'"):
        load_recipe("papre")
    with pytest.raises(InputError, match="did you mean 'two_objects'"):
        load_scene("two_object")


def test_bad_overrides_are_refused() -> None:
    with pytest.raises(InputError, match="expected key=value"):
        load_recipe("paper", ["photons.budget"])
    with pytest.raises(InputError, match=r"'scene' in 'scene\.x' is a value"):
        load_recipe("paper", ["scene.x=1"])


@pytest.mark.parametrize("name", ["../secret.png", "/etc/passwd", "absent.png"])
def test_assets_must_lie_inside_the_scenes_folder(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "secret.png").touch()
    (folder / "scene.toml").write_text(
        'title = "t"\n[[lights]]\ntype = "uniform"\nluminance_cd_m2 = 1.0\n'
        '[[objects]]\nname = "a"\nposition_mm = [0, 0, 500]\n'
        'shape = { type = "sphere", radius_mm = 5 }\n'
        f'material = {{ texture = "{name}" }}\n'
    )
    with pytest.raises(InputError, match=r"object 'a', material\.texture"):
        load_scene(str(folder))


def test_every_scene_that_ships_is_valid() -> None:
    assert "two_objects" in scene_names()
    for name in scene_names():
        scene, folder = load_scene(name)
        assert scene.title
        assert (folder / "scene.toml").is_file()
