"""Fields with several values: which datasets a sweep has, their order, names and recipes."""

from pathlib import Path

import pytest

from pcii.base import InputError
from simgen.spec import Scene, Sweep, UniformLight, load_recipe, load_sweep

TOML = """
scene = "two_objects"
seed = 7
[grid]
rows = 2
cols = 3
[photons]
budget = [100, 300.0]
[sensor]
cfa = "RGGB"
"""


@pytest.fixture
def recipe_file(tmp_path: Path) -> str:
    path = tmp_path / "swept.toml"
    path.write_text(TOML)
    return str(path)


def folders(sweep: Sweep) -> list[str]:
    return [sweep.folder(number) for number in range(len(sweep))]


def test_a_list_where_one_value_belongs_is_a_sweep_and_where_a_list_belongs_each_makes_one(
    recipe_file: str,
) -> None:
    sweep = load_sweep(recipe_file)
    assert [sweep.recipe(number).photons.budget for number in range(2)] == [100.0, 300.0]
    assert folders(sweep) == ["budget_100", "budget_300"]
    plain = ["photons.budget=100"]
    assert load_sweep(recipe_file, [*plain, "grid.pitch_mm=[4.0, 5.0]"]).axes == ()
    sweep = load_sweep(recipe_file, [*plain, "grid.pitch_mm={each=[[4.0, 5.0], [2.5, 5.0]]}"])
    assert [sweep.recipe(number).grid.pitch_mm for number in range(2)] == [(4.0, 5.0), (2.5, 5.0)]
    assert folders(sweep) == ["pitch_mm_4x5", "pitch_mm_2.5x5"]


def test_the_seed_varies_fastest_and_the_scene_slowest(recipe_file: str) -> None:
    sweep = load_sweep(recipe_file, ["scene={each=['two_objects', 'plain_pair']}"], seeds=3)
    assert [axis.field for axis in sweep.axes] == ["scene", "photons.budget", "seed"]
    assert len(sweep) == 12
    seeds = [sweep.recipe(number).seed for number in range(12)]
    assert seeds == 4 * [7, 8, 9]
    scenes = [sweep.recipe(number).scene for number in range(12)]
    assert scenes == 6 * ["two_objects"] + 6 * ["plain_pair"]
    assert len({*folders(sweep)}) == 12


def test_draws_of_a_scene_and_seeds_are_counted_from_the_recipes_own(recipe_file: str) -> None:
    """A range ends before its end."""
    plain = ["photons.budget=100"]
    assert load_sweep(recipe_file, [*plain, "seed={range=[3, 8, 2]}"]).axes[0].values == range(3, 8, 2)
    sweep = load_sweep(recipe_file, [*plain, "scene_number=20"], seeds=2, scenes=2)
    assert folders(sweep) == [f"draw_{draw}_seed_{seed}" for draw in (20, 21) for seed in (7, 8)]
    assert [sweep.recipe(number).scene_number for number in range(4)] == [20, 20, 21, 21]


def test_a_folder_keeps_its_name_when_values_are_added(recipe_file: str) -> None:
    names = set[str]()
    for budgets in ("[100]", "[50, 100]", "[50, 100, 1e-3]"):
        sweep = load_sweep(recipe_file, [f"photons.budget={budgets}"], seeds=2)
        assert names <= {*folders(sweep)}
        names = {*folders(sweep)}


def test_folders_of_scenes_that_are_named_by_a_path_are_told_apart_by_a_hash(
    recipe_file: str, tmp_path: Path
) -> None:
    names = ("my scene", "my  scene", "my-scene")
    for name in names:
        Scene(title="light", lights=(UniformLight(luminance_cd_m2=1.0),)).save(tmp_path / name)
    sweep = load_sweep(recipe_file, ["photons.budget=100", f"scene={{each={[*names]}}}"])
    assert [name[:15] for name in folders(sweep)] == ["scene_my-scene-", "scene_my-scene-", "scene_my-scene"]
    assert len({*folders(sweep)}) == 3


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("photons.budget=[]", "photons.budget: expected at least one value"),
        ("photons.budget=[100, 100.0]", "photons.budget: gives a value twice"),
        ("photons.budget=[100, -1]", r"at photons.budget = -1: 'photons.budget': .*greater than 0"),
        ("seed={range=[1, 2.5]}", r"seed: range: expected \[first, end\]"),
        ("seed={range=[0, 600000]}", "1200000 datasets; at most 1000000"),
        ("photons.budgets=[1, 2]", "unknown key 'photons.budgets'"),
        ("seed=[1, 2]", "gives seed several values already"),
        ("seed=1", "expected a whole number from 1, got 0"),
        ('scene=["two_objects", "overlapp"]', "there is no scene 'overlapp'; did you mean 'overlap'"),
    ],
)
def test_sweeps_that_make_no_recipes_are_refused(recipe_file: str, override: str, message: str) -> None:
    seeds = 3 if "already" in message else 0 if "whole number" in message else None
    with pytest.raises(InputError, match=message):
        load_sweep(recipe_file, [override], seeds=seeds)


def test_a_scene_alone_is_a_recipe_that_says_nothing_else() -> None:
    sweep = load_sweep("drawn_crossing", ["photons.budget=[10, 20]"], scenes=3)
    assert len(sweep) == 6
    recipe = sweep.recipe(5)
    assert (recipe.scene, recipe.scene_number, recipe.photons.budget) == ("drawn_crossing", 2, 20.0)
    assert recipe.grid == load_recipe("paper")[0].grid
    assert load_sweep("paper").written["title"]  # a recipe of a name comes before a scene of it
    with pytest.raises(InputError, match="there is no 'drawn_crosing'"):
        load_sweep("drawn_crosing", scenes=3)
