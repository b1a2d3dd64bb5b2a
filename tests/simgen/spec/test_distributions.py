"""Scenes by distribution: what every word of the language draws, and what is refused."""

import math
import re
import tomllib
from collections import Counter
from pathlib import Path
from statistics import NormalDist, mean, stdev
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from scipy.spatial.transform import Rotation
from surface_points import SHAPES, surface_points

from pcii.base.errors import InputError
from simgen.spec.distributions import draw, is_distribution
from simgen.spec.drawn_values import KINDS, MOST_VALUES
from simgen.spec.scene import Scene, load_scene

ROOT = Path(__file__).resolve().parents[3]
LIGHTS = '[[lights]]\ntype = "uniform"\nluminance_cd_m2 = 100.0\n'
BALL = 'shape = { type = "sphere", radius_mm = 10.0 }\nmaterial = { reflectance = [0.5, 0.5, 0.5] }\n'
DRAWS = 2000


def drawn(text: str, number: int = 0) -> dict[str, Any]:
    return draw(tomllib.loads(text), number, "x")


def values_of(distribution: str, count: int = DRAWS) -> list[Any]:
    """What `value = distribution` gives in so many draws."""
    file = tomllib.loads(f"value = {distribution}")
    return [draw(file, number, "x")["value"] for number in range(count)]


# ---- numbers


def test_draws_are_these_for_all_time() -> None:
    # A change of any makes other scenes of all numbers.
    text = """
    uniform = { uniform = [-1, 3] }
    log_uniform = { log_uniform = [0.01, 10] }
    normal = { normal = [100, 5] }
    integer = { integer = [0, 999999] }
    choice = { choice = ["a", "b", "c", "d"] }
    colour = { uniform = [[0, 0, 0], [1, 1, 1]] }
    [[objects]]
    name = "leaf"
    count = 2
    seed = { integer = [0, 999999] }
    """
    first, other = drawn(text, 17), drawn(text, 2**62)
    assert first == {
        "uniform": -0.862273,
        "log_uniform": 0.10408,
        "normal": 98.843,
        "integer": 182205,
        "choice": "d",
        "colour": [0.435303, 0.785983, 0.866747],
        "objects": [{"name": "leaf-1", "seed": 73233}, {"name": "leaf-2", "seed": 657317}],
    }
    assert all(first[key] != other[key] for key in first if key != "choice")


def test_uniform_numbers_fill_their_range_evenly() -> None:
    values = values_of("{ uniform = [-2.0, 6] }")
    assert all(isinstance(value, float) and -2 <= value <= 6 for value in values)
    assert min(values) < -1.97  # all of 2000 miss a 250th of the range once in 3000 tests
    assert max(values) > 5.97
    assert mean(values) == pytest.approx(2, abs=4 * 8 / math.sqrt(12 * DRAWS))
    assert all(float(f"{value:.6g}") == value for value in values)
    assert set(values_of("{ uniform = [1.23456789, 1.23456789] }", 5)) == {
        1.23456789
    }  # not rounded out of it


def test_vectors_are_drawn_by_component() -> None:
    values = np.array(values_of("{ uniform = [[0, 10, -1], [1, 20, -1]] }"))
    assert values.min(axis=0) == pytest.approx([0, 10, -1], abs=0.05)
    assert values.max(axis=0) == pytest.approx([1, 20, -1], abs=0.05)
    assert abs(np.corrcoef(values[:, 0], values[:, 1])[0, 1]) < 4 / math.sqrt(DRAWS)


def test_logarithms_of_log_uniform_numbers_are_even() -> None:
    logs = [math.log10(value) for value in values_of("{ log_uniform = [0.01, 100] }")]
    assert -2 <= min(logs) <= max(logs) <= 2
    assert mean(logs) == pytest.approx(0, abs=4 * 4 / math.sqrt(12 * DRAWS))


def test_normal_numbers_have_their_mean_and_deviation_and_no_far_tails() -> None:
    values = values_of("{ normal = [10, 2] }")
    assert mean(values) == pytest.approx(10, abs=4 * 2 / math.sqrt(DRAWS))
    assert stdev(values) == pytest.approx(2, rel=4 / math.sqrt(2 * DRAWS))
    beyond = sum(abs(value - 10) > 4 for value in values) / DRAWS
    assert beyond == pytest.approx(2 * NormalDist().cdf(-2), abs=4 * math.sqrt(0.0455 / DRAWS))
    assert max(abs(value - 10) for value in values) <= 8
    assert set(values_of("{ normal = [10, 0] }", 5)) == {10.0}


def test_integers_include_both_ends_evenly() -> None:
    counts = Counter(values_of("{ integer = [-1, 2] }"))
    assert all(isinstance(value, int) for value in counts)
    assert counts.keys() == {-1, 0, 1, 2}
    assert all(abs(n - DRAWS / 4) < 4 * math.sqrt(DRAWS * 3 / 16) for n in counts.values())


def test_choices_are_as_often_as_their_weights() -> None:
    counts = Counter(values_of('{ choice = ["a", "b", "c"], weights = [1, 0, 3] }'))
    assert counts.keys() == {"a", "c"}
    assert abs(counts["a"] - DRAWS / 4) < 4 * math.sqrt(DRAWS * 3 / 16)
    counts = Counter(values_of('{ choice = ["a", "b"] }'))
    assert abs(counts["a"] - DRAWS / 2) < 4 * math.sqrt(DRAWS / 4)


def test_entries_of_a_choice_are_drawn_themselves() -> None:
    for value in values_of("{ choice = [{ a = { integer = [1, 9] } }, [{ uniform = [0, 1] }, 5]] }", 50):
        assert (isinstance(value, dict) and 1 <= value["a"] <= 9) or (0 <= value[0] <= 1 and value[1] == 5)


# ---- variables


def test_variables_are_drawn_once_and_in_order() -> None:
    text = """
    a = { variable = "near" }
    b = { variable = "near", times = 2 }
    c = { variable = "near", times = 2.0, plus = { integer = [3, 3] } }
    d = { variable = "far" }
    e = { variable = "colour", item = 1 }
    f = { variable = "colour", times = 0.5, plus = [0.0, 0.25, 0.5] }
    g = { variable = "material" }
    h = { variable = "scale", times = [1, 2] }
    [variables]
    near = { integer = [470, 530] }
    far = { variable = "near", plus = 100 }
    colour = [0.25, 0.5, 0.75]
    material = { choice = [{ reflectance = { variable = "colour" } }] }
    scale = 3
    """
    for number in range(20):
        values = drawn(text, number)
        near = values["a"]
        assert 470 <= near <= 530
        assert [values[key] for key in "bcd"] == [2 * near, 2.0 * near + 3, near + 100]
        assert isinstance(values["b"], int)
        assert values["e"] == 0.5
        assert values["f"] == [0.125, 0.5, 0.875]
        assert values["g"] == {"reflectance": [0.25, 0.5, 0.75]}
        assert values["h"] == [3, 6]
        assert "variables" not in values
    assert len({drawn(text, number)["a"] for number in range(20)}) > 10


# ---- streams


def test_a_number_gives_the_same_scene_and_another_number_another() -> None:
    for name in ("drawn_solids", "drawn_foliage"):
        assert load_scene(name, number=3)[0] == load_scene(name, number=3)[0]
        assert len({load_scene(name, number=number)[0].model_dump_json() for number in range(10)}) == 10


def test_what_is_edited_elsewhere_changes_nothing_here() -> None:
    leaf = '[[objects]]\nname = "leaf"\ncount = {count}\nposition_mm = [{{ uniform = [0, 1] }}, 0, 0]\n'
    before = drawn(leaf.format(count=2))["objects"]
    stone = '[[objects]]\nname = "stone"\ncount = { integer = [1, 3] }\nseed = { integer = [0, 99] }\n'
    lists = "[variables]\na = { normal = [0, 1] }\n[[lights]]\nluminance_cd_m2 = { uniform = [1, 2] }\n"
    more = leaf.format(count=4) + "seed = { integer = [0, 99] }\n"
    after = drawn(lists + stone + more)["objects"]
    leaves = [thing for thing in after if thing["name"].startswith("leaf")]
    assert [thing["position_mm"] for thing in leaves[:2]] == [thing["position_mm"] for thing in before]


@given(st.integers(min_value=0, max_value=2**63 - 1))
@at_least(30)
def test_every_number_gives_a_valid_scene(number: int) -> None:
    scene, _ = load_scene("drawn_foliage", number=number)
    assert 21 <= len(scene.objects) <= 46
    assert scene.planes_mm[1] - scene.planes_mm[0] >= 95


# ---- objects


def test_objects_come_as_often_as_their_count_says() -> None:
    text = '[[objects]]\nname = "leaf"\ncount = { integer = [0, 2] }\nsize = { uniform = [0, 1] }\n'
    found = [drawn(text, number)["objects"] for number in range(40)]
    assert {len(things) for things in found} == {0, 1, 2}
    for things in found:
        assert [thing["name"] for thing in things] == [f"leaf-{copy + 1}" for copy in range(len(things))]
        assert len({thing["size"] for thing in things}) == len(things)
        assert all("count" not in thing for thing in things)
    assert drawn('[[objects]]\nname = "one"\n')["objects"] == [{"name": "one"}]


def test_placed_objects_keep_their_distance_in_every_draw() -> None:
    place = "position_mm = [{ uniform = [-60, 60] }, { uniform = [-60, 60] }, { uniform = [450, 650] }]\n"
    box = 'shape = { type = "box", width_mm = { uniform = [5, 30] }, height_mm = 20, depth_mm = 10 }\n'
    placed = "placement = { apart_mm = 5.0 }\n"
    text = (
        f'[[objects]]\nname = "ball"\ncount = 6\n{place}{BALL}{placed}'
        f'[[objects]]\nname = "box"\ncount = 6\n{place}{box}{placed}'
        f'[[objects]]\nname = "free"\n{place}{BALL}'
    )
    retried = 0
    for number in range(200):
        things = drawn(text, number)["objects"]
        free = drawn(text.replace(placed, ""), number)["objects"]
        retried += sum(one != other for one, other in zip(things, free, strict=True))
        assert things[-1] == free[-1]
        solids = [
            (np.array(thing["position_mm"]), radius_of(thing["shape"]))
            for thing in things
            if thing != things[-1]
        ]
        for position, (centre, radius) in enumerate(solids):
            for other_centre, other_radius in solids[:position]:
                gap = np.linalg.norm(centre - other_centre) - radius - other_radius
                assert gap >= 5.0 - 1e-9
    assert retried > 200  # some had to be drawn again


def radius_of(shape: dict[str, Any]) -> float:
    if shape["type"] == "sphere":
        return shape["radius_mm"]
    return float(np.linalg.norm([shape[f"{side}_mm"] for side in ("width", "height", "depth")])) / 2


@pytest.mark.parametrize("kind", SHAPES)
def test_what_stands_on_a_box_has_its_lowest_point_on_the_boxs_top(kind: str) -> None:
    given = ", ".join(
        f'{key} = "{value}"' if key == "type" else f"{key} = {value}"
        for key, value in SHAPES[kind].model_dump().items()
    )
    text = f"""
    [[objects]]
    name = "desk"
    position_mm = [0, 205, 590]
    rotation_deg = [0, {{ uniform = [0, 360] }}, 0]
    shape = {{ type = "box", width_mm = 640, height_mm = 240, depth_mm = 320 }}
    [[objects]]
    name = "thing"
    position_mm = [{{ uniform = [-90, 90] }}, 0, 600]
    rotation_deg = {{ uniform = [[-180, -180, -180], [180, 180, 180]] }}
    shape = {{ {given} }}
    placement = {{ on = "desk" }}
    """
    points = surface_points(SHAPES[kind])
    for number in range(20):
        thing = drawn(text, number)["objects"][1]
        turned = Rotation.from_euler("xyz", thing["rotation_deg"], degrees=True)
        lowest = thing["position_mm"][1] + turned.apply(points)[:, 1].max()  # Y is down
        assert lowest == pytest.approx(85.0, abs=1e-3 if kind in ("sphere", "cylinder") else 2e-6)


# ---- what is a distribution, and what is refused


def test_the_example_of_the_documentation_draws_scenes() -> None:
    page = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    (example,) = (text for text in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "[variables]" in text)
    values = tomllib.loads(example)
    for number in range(20):
        scene = Scene.model_validate(draw(values, number, "x"))
        assert 11 <= len(scene.objects) <= 41
        assert scene.planes_mm[1] == scene.planes_mm[0] + 100


@pytest.mark.parametrize("name", ["two_objects", "desk", "foliage"])
def test_a_scene_is_no_distribution(name: str) -> None:
    values = tomllib.loads((ROOT / "scenes" / name / "scene.toml").read_text())
    assert not is_distribution(values)
    assert draw(values, 5, "x") == values


@pytest.mark.parametrize(
    "text",
    [
        "[variables]\n",
        '[[objects]]\nname = "a"\ncount = 3\n',
        '[[objects]]\nname = "a"\nplacement = { apart_mm = 1 }\n',
        "[[lights]]\nluminance_cd_m2 = { uniform = [1, 2] }\n",
        '[[objects]]\nname = "a"\nmaterial = { texture = { colours = [[0, 0, { integer = [0, 1] }]] } }\n',
    ],
)
def test_a_scene_with_any_of_the_language_is_a_distribution(text: str) -> None:
    assert is_distribution(tomllib.loads(text))


def test_no_field_of_a_scene_has_a_name_of_the_language() -> None:
    words = {*KINDS, "count", "placement", "variables"}
    definitions = [Scene.model_json_schema(), *Scene.model_json_schema()["$defs"].values()]
    assert not words & {field for table in definitions for field in table["properties"]}


THING = f'[[objects]]\nname = "thing"\nposition_mm = [0, 0, 500]\n{BALL}'
ONE = "{{ variable = 'a{}' }}, "
TEN_TIMES = "".join(f"a{n + 1} = [{10 * ONE.format(n)}]\n" for n in range(9))
REFUSED = {
    "value = { uniform = [2, 1] }": "value: uniform: expected [low, high] with low <= high, got [2, 1]",
    "value = { uniform = 3 }": "value: uniform: expected [low, high]",
    "value = { uniform = [1, 2, 3] }": "value: uniform: expected [low, high]",
    "value = { uniform = [[1, 2], [3]] }": "value: uniform: expected [low, high]",
    "value = { uniform = [[[1, 2]], [[3, 4]]] }": "value: uniform: expected [low, high]",
    "value = { uniform = [[], []] }": "value: uniform: expected [low, high]",
    "value = { uniform = [0, inf] }": "value: uniform: expected [low, high]",
    "value = { uniform = [nan, 1] }": "value: uniform: expected [low, high]",
    "value = { uniform = [false, true] }": "value: uniform: expected [low, high]",
    f"value = {{ uniform = [0, 0x{'f' * 5000}] }}": "value: uniform: expected [low, high]",
    "value = { log_uniform = [0, 1] }": "value: log_uniform: expected [low, high] with 0 < low <= high",
    "value = { normal = [0, -1] }": "value: normal: expected [mean, deviation] with deviation >= 0",
    "value = { integer = [0, 1.5] }": "value: integer: expected [low, high], whole numbers",
    "value = { integer = [0, 9007199254740992] }": "less than 2^53 apart",
    "value = { choice = [] }": "value: choice: expected [x, y, ...], got []",
    "value = { choice = [1, 2], weights = [1] }": "value: weights: expected a number >= 0 for each of the 2",
    "value = { choice = [1, 2], weights = [0, 0] }": "value: weights: expected",
    "value = { choice = [1, 2], weights = [-1, 2] }": "value: weights: expected",
    "value = { choice = [1, { uniform = [2, 1] }] }": "value.choice[1]: uniform: expected",
    "value = { uniform = [1, 2], wieghts = [1] }": "value: unknown key 'wieghts' beside 'uniform'",
    "value = { choice = [1, 2], wieghts = [1] }": "'wieghts' beside 'choice'; did you mean 'weights'?",
    "value = { uniform = [1, 2], normal = [1, 2] }": "value: unknown key 'normal' beside 'uniform'",
    'value = { variable = "a" }': "value: there is no variable 'a'",
    'value = { variable = "naer" }\n[variables]\nnear = 1': "did you mean 'near'?",
    '[variables]\na = { variable = "b" }\nb = 1': "variables.a: the variable 'b' is not drawn before this",
    '[variables]\na = { variable = "a" }': "variables.a: the variable 'a' is not drawn before this",
    'value = { variable = "a", item = 2 }\n[variables]\na = [1, 2]': "value: item: there is no item 2",
    'value = { variable = "a", times = 2 }\n[variables]\na = "text"': "value: times and plus are of numbers",
    'value = { variable = "a", times = [1, 2] }\n[variables]\na = [1]': "or lists as long as [1]",
    'value = { variable = "a", times = 1e300 }\n[variables]\na = 1e300': "the result is too large",
    f'value = {{ variable = "a", times = {10**299}, plus = 0.5 }}\n[variables]\na = {10**299}': (
        "the result is too large"
    ),
    "variables = 3": "variables: expected a table, got 3",
    "objects = 3": "objects: expected [[objects]], got 3",
    "[[objects]]\ncount = 2": "objects[0]: expected a table with a name",
    '[[objects]]\nname = { choice = ["a"] }': "objects[0]: expected a table with a name",
    f"{THING}{THING}count = 2": "objects[1].name: two objects are named 'thing'",
    '[[objects]]\nname = "t"\ncount = 2\n[[objects]]\nname = "t-1"': "objects[1].name: two objects are named",
    f"{THING}count = -1": "objects[0].count: expected a whole number from 0 to 1000, got -1",
    f"{THING}count = 1001": "objects[0].count: expected a whole number from 0 to 1000, got 1001",
    f"{THING}count = {{ uniform = [1, 2] }}": "objects[0].count: expected a whole number",
    f"{THING}placement = 3": "objects[0].placement: expected a table such as { apart_mm = 5.0 }, got 3",
    f"{THING}placement = {{ apart = 3 }}": "unknown key 'apart'; did you mean 'apart_mm'?",
    f"{THING}placement = {{ apart_mm = -3 }}": "placement.apart_mm: expected a number >= 0, got -3",
    f"{THING}placement = {{ on = 'desk' }}": "objects[0].placement.on: there is no object 'desk' before this",
    f"{THING}[[objects]]\nname = 'top'\nposition_mm = [0, 0, 1]\n{BALL}placement = {{ on = 'thing' }}": (
        "objects[1].placement.on: 'thing' is no box"
    ),
    f"{THING}count = 2\nplacement = {{ apart_mm = 1 }}": (
        "objects[0].placement: in draw 0 1000 tries found no place 1 mm apart from others for 'thing-2'"
    ),
    "[[objects]]\nname = 'a'\nposition_mm = [0, 0, 1]\nshape = { type = 'mesh', file = 'a.ply' }\n"
    "placement = { apart_mm = 1 }": (
        "objects[0].placement: it is for spheres, boxes, cylinders and cards, and this object is a mesh"
    ),
    f"{THING}placement = {{ apart_mm = 1 }}".replace("10.0", "{ uniform = [-2, -1] }"): (
        "x, draw 0: objects[0]: 'shape.radius_mm'"
    ),
    "[variables]\na0 = 1\n" + TEN_TIMES: f"a draw of a scene may hold {MOST_VALUES} values",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_not_in_the_language_is_refused_with_its_place(text: str) -> None:
    with pytest.raises(InputError, match=re.escape(REFUSED[text])) as caught:
        drawn(text)
    assert str(caught.value).startswith("x")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_a_draw_that_is_no_scene_says_its_number(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(f'title = "a"\n{LIGHTS}{THING}'.replace("10.0", "{ uniform = [-1, 1] }"))
    assert load_scene(str(file), number=3)[0].objects[0].name == "thing"
    with pytest.raises(InputError, match=r"scene\.toml, draw 0: 'objects\[0\]\.shape\.radius_mm'"):
        load_scene(str(file), number=0)


def test_what_is_nested_too_deeply_is_refused_and_not_a_crash(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    for levels in (50, 150, 300, 450):
        file.write_text(f'title = "a"\n{LIGHTS}[variables]\na = {"[" * levels}1{"]" * levels}\n')
        try:
            load_scene(str(file), number=1)
        except InputError as fault:
            assert "nested too deeply" in str(fault)  # noqa: PT017
