"""Many seeds of a recipe: what each alone would give, byte for byte, and nothing done twice."""

from pathlib import Path

import numpy as np
import pytest
from test_generation import digest
from tiny import TINY_RECIPE

from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.io.dataset import open_dataset
from pcii.io.dataset_layout import MANIFEST
from simgen.app import commands as cli
from simgen.dataset import generation as module
from simgen.dataset.generation import generate
from simgen.dataset.series import MOST_SEEDS, at_seeds, generate_series
from simgen.spec.recipe import Recipe, load_recipe

pytestmark = pytest.mark.renders
TOML = """
scene = "two_objects"
seed = 7
[grid]
rows = 2
cols = 3
pitch_mm = [18.0, 18.0]
pixel_mm = 0.5632
height = 64
width = 60
[photons]
budget = 200
nested = [50]
[render]
samples_per_pixel = 2
[products]
radiance = "mosaic"
"""


@pytest.fixture(scope="module")
def recipe_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    path.write_text(TOML)
    return path


@pytest.fixture(scope="module")
def series(recipe_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("series") / "three"
    assert command_line.run(cli.app, ["generate", str(recipe_file), "-o", str(out), "--seeds", "3"]) == 0
    return out


def test_every_seed_has_its_own_whole_dataset(series: Path) -> None:
    assert sorted(folder.name for folder in series.iterdir()) == ["seed_7", "seed_8", "seed_9"]
    events = [open_dataset(folder).counts.events for folder in sorted(series.iterdir())]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        assert events[one].j.shape != events[other].j.shape or (events[one].j != events[other].j).any()
    truths = [open_dataset(folder).truth for folder in sorted(series.iterdir())]
    assert truths[0] is not None
    for truth in truths[1:]:
        assert truth is not None
        np.testing.assert_array_equal(truth.z_mm, truths[0].z_mm)


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_each_is_what_its_seed_alone_gives(
    recipe_file: Path, series: Path, tmp_path: Path, seed: int
) -> None:
    recipe, near = load_recipe(str(recipe_file), [f"seed={seed}"])
    manifest = generate(recipe, near, tmp_path / "alone")
    assert digest(tmp_path / "alone") == digest(series / f"seed_{seed}")
    assert open_dataset(series / f"seed_{seed}").manifest["identity"] == manifest["identity"]


def test_what_is_finished_is_left_alone_and_what_is_missing_is_made(
    recipe_file: Path, series: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    original = module.Prepared.render_scene
    monkeypatch.setattr(module.Prepared, "render_scene", lambda self: made.append(self) or original(self))
    before = [(series / f"seed_{n}" / MANIFEST).stat().st_mtime_ns for n in (7, 8, 9)]
    recipe, near = load_recipe(str(recipe_file))
    assert len(list(generate_series(recipe, near, series, 3))) == 3
    assert made == []
    assert [(series / f"seed_{n}" / MANIFEST).stat().st_mtime_ns for n in (7, 8, 9)] == before
    folders = [folder.name for folder, _ in generate_series(recipe, near, series, 4)]
    assert folders == ["seed_7", "seed_8", "seed_9", "seed_10"]
    assert [own.recipe.seed for own in made] == [10]


def test_a_single_dataset_and_many_are_kept_apart(recipe_file: Path, series: Path) -> None:
    recipe, near = load_recipe(str(recipe_file))
    with pytest.raises(InputError, match="holds a single dataset"):
        list(generate_series(recipe, near, series / "seed_7", 2))
    with pytest.raises(InputError, match="holds something else"):
        generate(recipe, near, series)


@pytest.mark.parametrize("count", [0, -1, MOST_SEEDS + 1])
def test_a_count_of_seeds_that_makes_no_sense_is_refused(count: int) -> None:
    with pytest.raises(InputError, match=f"from 1 to {MOST_SEEDS}"):
        at_seeds(Recipe.model_validate(TINY_RECIPE), count)


def test_half_a_seed_is_refused(
    recipe_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["generate", str(recipe_file), "-o", str(tmp_path / "out"), "--seeds", "2.5"]
    assert command_line.run(cli.app, command) == 2
    assert "expected a whole number, got '2.5'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_seeds_end_where_seeds_end() -> None:
    last = Recipe.model_validate(TINY_RECIPE | {"seed": 2**63 - 2})
    assert [own.seed for own in at_seeds(last, 2)] == [2**63 - 2, 2**63 - 1]
    with pytest.raises(InputError, match="smaller"):
        at_seeds(last, 3)
