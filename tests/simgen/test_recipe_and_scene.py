"""Files that people write: defaults, overrides, and one sentence for each mistake."""

from pathlib import Path
from typing import Any

import pytest
from command_runs import run_simgen
from pydantic import BaseModel

from pcii.base import InputError
from simgen.base import validate
from simgen.spec import Analysis, Recipe, Scene, load_recipe

LIGHT = {"type": "uniform", "luminance_cd_m2": 1.0}
EXPOSED = {"f_number": 8.0, "time_s": 0.01}
LENS = {"aperture_mm": 6.0, "focus_mm": 600.0}


def scene_with(**thing: object) -> dict[str, Any]:
    whole = {
        "name": "a",
        "position_mm": [0, 0, 500],
        "shape": {"type": "sphere", "radius_mm": 5},
        "material": {"reflectance": [1, 1, 1]},
    }
    return {"title": "t", "lights": [LIGHT], "objects": [whole | thing]}


def textured(texture: object) -> dict[str, Any]:
    return scene_with(material={"texture": texture})


def sentence_of(model: type[BaseModel], values: dict) -> str:
    """The one sentence by which wrong values are refused."""
    with pytest.raises(InputError) as caught:
        validate(model, values, "a.toml")
    sentence = str(caught.value)
    assert sentence.startswith("a.toml: ")
    assert "\n" not in sentence
    return sentence


def test_overrides_take_toml_values_and_bare_words_and_make_tables() -> None:
    paper, _ = load_recipe("paper")  # says what the paper says
    assert paper.grid.camera_grid().shape_KLHW == (10, 10, 1024, 1024)
    assert (paper.cfa, paper.photons.budget, paper.photons.scope) == ("GRBG", 1000, "view")
    assert paper.analysis.z_mm == (540, 620)
    recipe, _ = load_recipe("paper", ["photons.nested=[100, 300]", "sensor.cfa=RGGB", "exposure.time_s=0.5"])
    assert recipe.photons.nested == (100, 300)
    assert recipe.cfa == "RGGB"
    assert recipe.exposure is not None
    assert (recipe.exposure.f_number, recipe.exposure.time_s) == (8, 0.5)
    for override, message in (
        ("scene=[two_objects,overlap]", r"scene=\[two_objects,overlap\].* words in a list need quotation"),
        ("photons.budget", "expected key=value"),
        ("scene.x=1", r"'scene' in 'scene\.x' is a value"),
    ):
        with pytest.raises(InputError, match=message):
            load_recipe("paper", [override])


def test_another_scene_does_not_keep_title_and_depths_of_the_recipes_own() -> None:
    small, _ = load_recipe("small")
    assert small.title == "Ball and bird, small"
    assert load_recipe("small", ["scene=same_colour"])[0].title == ""  # so the scene's own title is used
    assert load_recipe("small", ["scene=two_objects", "seed=3"])[0].title == small.title
    assert load_recipe("small", ["title=Balls", "scene=same_colour"])[0].title == "Balls"
    assert load_recipe("small", ["scene=overlap"])[0].analysis == Analysis()  # so the scene's own are taken
    assert load_recipe("small", ["analysis.z_mm=[500]", "scene=overlap"])[0].analysis == Analysis(z_mm=(500,))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"grid": {"pich_mm": [1, 1]}}, "unknown key 'grid.pich_mm'; did you mean 'pitch_mm'?"),
        ({"grid": {"rows": 2.0}}, "'grid.rows': input should be a valid integer"),
        ({"grid": {"focal_mm": 1e-5}}, "focal_mm: 0.00180224 mm or more is needed"),
        ({"grid": {"lens": LENS, "shear_px": (1.0, 0.0)}}, "leave out shear_px"),
        (
            {"grid": {"lens": LENS}, "exposure": EXPOSED},
            "focal_mm / exposure.f_number is 6.25 mm, and aperture_mm is 6; make them agree",
        ),
        ({"sensor": {"cfa": "GRGB"}}, "'GRBG', 'RGGB', 'BGGR', 'GBRG' or 'none', got 'GRGB'"),
        ({"sensor": {"full_light": {}}}, "exposure: photons.scope = 'exposure' and sensor.full_light need"),
        ({"photons": {"scope": "exposure"}}, "exposure: photons.scope = 'exposure' and sensor.full_light"),
        ({"photons": {"budget": float("nan")}}, "'photons.budget'"),
        ({"photons": {"nested": [300, 1000]}}, "nested: every budget must be less than budget = 1000"),
        ({"photons": {"nested": [300, 100, 300]}}, "nested: give each budget once"),
        ({"photons": {"statistics": "multinomial", "budget": 10.5}}, "budgets are whole numbers"),
        (
            {"photons": {"scope": "exposure", "statistics": "multinomial"}, "exposure": EXPOSED},
            "scope: an exposure has no budget",
        ),
        ({"render": {"samples_per_pixel": 2048}}, "2147483648 paths; fewer than 2147483648"),
        ({"render": {"background_samples_per_pixel": 17}}, "expected at most samples_per_pixel"),
        ({"products": {"truth": False, "visibility": True}}, "visibility: it is counted for"),
        ({"analysis": {"z_range_mm": [5, 5]}}, "z_range_mm: near must be less than far"),
        ({"title": "Ball\u2028"}, "'title': a title is one line without control characters"),
    ],
)
def test_a_wrong_recipe_is_refused_in_one_sentence(values: dict, message: str) -> None:
    assert message in sentence_of(Recipe, {"scene": "x"} | values)


def test_what_lies_just_within_the_limits_is_accepted() -> None:
    for values in (
        {"photons": {"budget": 1e15, "nested": [999.9, 0.5]}, "title": "Kugel & Vögel, 5 $ < 6 $ \\frac 球"},
        {"photons": {"statistics": "multinomial", "nested": [1, 999]}},
        {"photons": {"scope": "exposure"}, "exposure": {}},
        {"sensor": {"bits": 32, "hot_pixel_share": 1, "dead_pixel_share": 1}},
        {"sensor": {"full_light": {"adc_bits": 1, "read_noise_e": 0}}, "exposure": EXPOSED},
    ):
        assert validate(Recipe, {"scene": "x"} | values, "r.toml").scene == "x"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (scene_with(position_mm=[0, 0, float("inf")]), "'objects[0].position_mm[2]'"),
        (scene_with(shape={"type": "mesh", "file": "a.ply", "scale": [1, 0, 1]}), "a scale is not 0"),
        (scene_with(material={}), "'objects[0].material': give either 'reflectance' or 'texture'"),
        (scene_with(name="../x"), "'objects[0].name': string should match pattern"),
        (
            {"title": "t", "lights": [LIGHT, {"type": "environment", "file": "a.exr", "luminance_cd_m2": 1}]},
            "only one light can be 'uniform' or 'environment'",
        ),
        (textured({"spokes": 3}), "'objects[0].material.texture.type' is missing"),
        (textured({"type": "text", "text": "Ω"}), "printable Latin-1 characters, not only spaces"),
    ],
)
def test_a_wrong_scene_is_refused_in_one_sentence(values: dict, message: str) -> None:
    assert message in sentence_of(Scene, values)


def test_a_command_prints_each_fault_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "r.toml"
    recipe.write_text('scene = "two_objects"\nseed = -1\n[photons]\nbudgt = 3\n')
    assert run_simgen("check", recipe) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"error: {recipe}: unknown key 'photons.budgt'; did you mean 'budget'?")
    assert lines[1:] == ["  'seed': input should be greater than or equal to 0, got -1"]
