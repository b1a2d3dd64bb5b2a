"""Files that people write: defaults, overrides, and one sentence for each mistake."""

from pathlib import Path

import pytest
from pydantic import BaseModel

from pcii.base.errors import InputError
from simgen.base.strict_models import validate
from simgen.spec.recipe import Analysis, Recipe, load_recipe
from simgen.spec.scene import Scene
from simgen.spec.scene_lookup import load_scene

LIGHT = {"type": "uniform", "luminance_cd_m2": 1.0}


def scene_with(**thing: object) -> dict:
    whole = {
        "name": "a",
        "position_mm": [0, 0, 500],
        "shape": {"type": "sphere", "radius_mm": 5},
        "material": {"reflectance": [1, 1, 1]},
    }
    return {"title": "t", "lights": [LIGHT], "objects": [whole | thing]}


def told(model: type[BaseModel], values: dict) -> str:
    """The one sentence by which wrong values are refused."""
    with pytest.raises(InputError) as caught:
        validate(model, values, "a.toml")
    sentence = str(caught.value)
    assert sentence.startswith("a.toml: ")
    assert "\n" not in sentence
    return sentence


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
    with pytest.raises(InputError, match=r"scene=\[two_objects,overlap\].* words in it need quotation marks"):
        load_recipe("paper", ["scene=[two_objects,overlap]"])


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
        ({"scene": "x", "photons": {"budget": True}}, "'photons.budget': input should be a valid number"),
        ({"scene": "x", "photons": {"budget": "300"}}, "'photons.budget': input should be a valid number"),
        ({"scene": "x", "grid": {"rows": 2.0}}, "'grid.rows': input should be a valid integer"),
        (
            {"scene": "x", "grid": {"pitch_mm": [1, "1"]}},
            "'grid.pitch_mm[1]': input should be a valid number",
        ),
    ],
)
def test_a_wrong_recipe_is_told_in_one_sentence(values: dict, message: str) -> None:
    assert message in told(Recipe, values)


def test_a_sensor_has_no_faults_and_a_recipe_no_exposure_unless_told() -> None:
    recipe = validate(Recipe, {"scene": "x"}, "r.toml")
    sensor = recipe.sensor
    assert sensor.quantum_efficiency == (1, 1, 1)
    assert sensor.dark_counts == sensor.hot_pixel_share == sensor.dead_pixel_share == 0
    assert (sensor.bits, sensor.full_light, recipe.exposure) == (None, None, None)
    assert (recipe.photons.nested, recipe.photons.statistics) == ((), "poisson")


def test_another_scene_does_not_keep_title_and_depths_of_the_recipes_own() -> None:
    own, _ = load_recipe("small")
    assert own.title == "Ball and bird, small"
    assert load_recipe("small", ["scene=same_colour"])[0].title == ""  # so the scene's own title is used
    assert load_recipe("small", ["scene=two_objects", "seed=3"])[0].title == own.title
    assert load_recipe("small", ["title=Balls", "scene=same_colour"])[0].title == "Balls"
    assert load_recipe("small", ["scene=same_colour", f"title={own.title}"])[0].title == own.title
    assert load_recipe("small", ["scene=overlap"])[0].analysis == Analysis()  # so the scene's own are taken
    assert load_recipe("small", ["analysis.z_mm=[500]", "scene=overlap"])[0].analysis == Analysis(z_mm=(500,))


def test_overrides_reach_the_sensor_the_exposure_and_nested_budgets() -> None:
    told = ["photons.nested=[100, 300]", "sensor.bits=1", "exposure.time_s=0.5"]
    recipe, _ = load_recipe("paper", [*told, "sensor.full_light.adc_bits=10"])
    assert recipe.photons.nested == (100, 300)
    assert recipe.sensor.bits == 1
    assert recipe.exposure is not None
    assert (recipe.exposure.f_number, recipe.exposure.time_s) == (8, 0.5)
    assert recipe.sensor.full_light is not None
    assert (recipe.sensor.full_light.adc_bits, recipe.sensor.full_light.full_well_e) == (10, 10_000)


EXPOSED = {"f_number": 8.0, "time_s": 0.01}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"photons": {"nested": [300, 1000]}}, "nested: every budget must be less than budget = 1000"),
        ({"photons": {"nested": [2e3], "budget": 1500}}, "nested: every budget must be less than budget"),
        ({"photons": {"nested": [300, 100, 300]}}, "nested: give each budget once"),
        ({"photons": {"nested": [0]}}, "'photons.nested[0]': input should be greater than 0"),
        ({"photons": {"nested": [100, -5]}}, "'photons.nested[1]': input should be greater than 0"),
        ({"photons": {"nested": 100}}, "'photons.nested'"),
        (
            {"photons": {"statistics": "multinomial", "budget": 10.5}},
            "with 'multinomial' statistics budgets are whole numbers",
        ),
        (
            {"photons": {"statistics": "multinomial", "budget": 10, "nested": [2.5]}},
            "with 'multinomial' statistics budgets are whole numbers",
        ),
        ({"photons": {"budget": 2e15}}, "'photons.budget': input should be less than or equal to"),
        ({"photons": {"scope": "pixel"}}, "'view', 'channel', 'scene' or 'exposure', got 'pixel'"),
        (
            {"photons": {"scope": "exposure", "statistics": "multinomial"}, "exposure": EXPOSED},
            "statistics: an exposure has no fixed total; use 'poisson'",
        ),
        (
            {"photons": {"scope": "exposure", "nested": [10]}, "exposure": EXPOSED},
            "nested: an exposure has no budget; use scope 'view', 'channel' or 'scene'",
        ),
        ({"photons": {"scope": "exposure"}}, "photons.scope: 'exposure' needs the table [exposure]"),
        ({"sensor": {"full_light": {}}}, "sensor.full_light: needs the table [exposure]"),
        (
            {"grid": {"pitch_mm": [1e300, 5]}},
            "'grid.pitch_mm[0]': input should be less than or equal to 1000000",
        ),
        (
            {"grid": {"focal_mm": 1e-300}},
            "'grid.focal_mm': input should be greater than or equal to 0.000001",
        ),
        ({"grid": {"focal_mm": 1e-5}}, "focal_mm: views of 36.0448 mm need a focal length of 0.00180224 mm"),
        ({"grid": {"shear_px": [0, -1e300]}}, "'grid.shear_px[1]'"),
        ({"grid": {"lens": {"aperture_mm": 1e300, "focus_mm": 5}}}, "'grid.lens.aperture_mm'"),
        ({"grid": {"errors": {"position_sd_mm": [1e300, 0, 0]}}}, "'grid.errors.position_sd_mm[0]'"),
        (
            {"render": {"max_depth": 10**10}},
            "'render.max_depth': input should be less than or equal to 1000000",
        ),
        ({"exposure": {"f_number": 0}}, "'exposure.f_number': input should be greater than 0, got 0"),
        ({"exposure": {"time_s": -1}}, "'exposure.time_s'"),
        ({"exposure": {"time_s": float("inf")}}, "'exposure.time_s'"),
        ({"exposure": {"time": 1}}, "unknown key 'exposure.time'; did you mean 'time_s'?"),
        ({"sensor": {"quantum_efficiency": [1, 0, 1]}}, "'sensor.quantum_efficiency[1]'"),
        ({"sensor": {"quantum_efficiency": [1, 1, 1.01]}}, "'sensor.quantum_efficiency[2]'"),
        ({"sensor": {"quantum_efficiency": [0.5]}}, "'sensor.quantum_efficiency"),
        ({"sensor": {"dark_counts": -0.1}}, "'sensor.dark_counts'"),
        ({"sensor": {"hot_pixel_share": 1.1}}, "'sensor.hot_pixel_share'"),
        ({"sensor": {"hot_pixel_counts": -1}}, "'sensor.hot_pixel_counts'"),
        ({"sensor": {"dead_pixel_share": -0.1}}, "'sensor.dead_pixel_share'"),
        ({"sensor": {"bits": 0}}, "'sensor.bits'"),
        ({"sensor": {"bits": 33}}, "'sensor.bits'"),
        ({"sensor": {"bits": 1.5}}, "'sensor.bits'"),
        ({"sensor": {"dark_count": 1}}, "unknown key 'sensor.dark_count'; did you mean 'dark_counts'?"),
        ({"sensor": {"full_light": {"adc_bits": 25}}, "exposure": EXPOSED}, "'sensor.full_light.adc_bits'"),
        ({"sensor": {"full_light": {"full_well_e": 0}}, "exposure": EXPOSED}, "full_light.full_well_e'"),
        ({"sensor": {"full_light": {"read_noise_e": -1}}, "exposure": EXPOSED}, "full_light.read_noise_e'"),
    ],
)
def test_a_wrong_sensor_or_light_is_told_in_one_sentence(values: dict, message: str) -> None:
    assert message in told(Recipe, {"scene": "x"} | values)


@pytest.mark.parametrize(
    ("values", "limit"),
    [
        ({"photons": {"nested": [999.9, 0.5]}}, "just below the budget"),
        ({"photons": {"statistics": "multinomial", "nested": [1, 999]}}, "whole numbers"),
        ({"photons": {"scope": "exposure"}, "exposure": {}}, "the exposure's defaults"),
        ({"photons": {"budget": 1e15}}, "most photons"),
        ({"sensor": {"bits": 32, "hot_pixel_share": 1, "dead_pixel_share": 1}}, "all there is"),
        ({"sensor": {"full_light": {"adc_bits": 1, "read_noise_e": 0}}, "exposure": EXPOSED}, "least"),
    ],
)
def test_what_lies_just_within_the_limits_is_accepted(values: dict, limit: str) -> None:
    assert validate(Recipe, {"scene": "x"} | values, limit).scene == "x"


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
        (scene_with(name="ball\n"), "'objects[0].name'"),
        (scene_with(name="ba\x1bll"), "'objects[0].name'"),
        (scene_with() | {"title": "two\nlines"}, "'title': a title is one line"),
        (scene_with() | {"title": "t\n"}, "'title': a title is one line"),
        ({"title": "t", "lights": []}, "'lights'"),
        (scene_with() | {"objects": scene_with()["objects"] * 2}, "two objects are named 'a'"),
    ],
)
def test_a_wrong_scene_is_told_in_one_sentence(values: dict, message: str) -> None:
    assert message in told(Scene, values)


def test_a_missing_recipe_or_scene_gets_a_suggestion() -> None:
    with pytest.raises(InputError, match="did you mean 'paper'"):
        load_recipe("papre")
    with pytest.raises(InputError, match="did you mean 'two_objects'"):
        load_scene("two_object")


def test_a_title_is_one_line_and_else_holds_what_it_likes() -> None:
    given = "Kugel & Vögel, 5 $ < 6 $ \\frac 球"
    assert Recipe(scene="two_objects", title=given).title == given
    for control in "\n", "\r", "\x1b", "\x7f", "\u2028":
        with pytest.raises(InputError, match="'title': a title is one line without control characters"):
            validate(Recipe, {"scene": "two_objects", "title": f"Ball{control}"}, "r.toml")


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
