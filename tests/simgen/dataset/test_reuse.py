"""What is reused between datasets changes none of them, whatever was made before; and work is done once."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w
from digests import digest
from lit_scenes import EVENLY, card
from tiny import GRID_2_X_2

from pcii.base import silent
from simgen.dataset import Prepared, generate, generation, prepare
from simgen.dataset.generation import Reuse, make
from simgen.spec import load_recipe

pytestmark = pytest.mark.renders
TOML = f'scene = "plain_pair"\nseed = 3\n{GRID_2_X_2}[photons]\nbudget = 100\n'
ERRORS = "grid.errors={position_sd_mm=[1.0,1.0,0.5]}"
OTHERS = [
    ["photons.budget=300"],
    [ERRORS, "seed=4"],
    ["analysis.z_mm=[500.0]"],
    ["grid.pitch_mm=[9.0,18.0]"],
    ["scene=two_objects"],
]


@pytest.fixture
def recipe_file(tmp_path: Path) -> str:
    path = tmp_path / "tiny.toml"
    path.write_text(TOML)
    return str(path)


@pytest.mark.parametrize("others", [[["scene=two_objects"]], pytest.param(OTHERS, marks=pytest.mark.slow)])
def test_datasets_are_the_same_whatever_was_made_before(
    others: list[list[str]], recipe_file: str, tmp_path: Path
) -> None:
    reuse, alone = Reuse(), tmp_path / "alone"
    for number, overrides in enumerate([[], *others, []]):
        recipe, near = load_recipe(recipe_file, overrides)
        make(prepare(recipe, near), tmp_path / f"reused {number}", silent, reuse)
        if not (alone / str(overrides)).exists():
            generate(recipe, near, alone / str(overrides))
        assert digest(tmp_path / f"reused {number}") == digest(alone / str(overrides)), overrides


def test_only_what_depends_on_a_change_is_made_again(
    recipe_file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    works: list[str] = []

    def watch(owner: Any, name: str) -> None:
        work = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *args: works.append(name) or work(*args))

    watch(Prepared, "render_scene")
    watch(Prepared, "plan")
    watch(generation, "write_truth")
    reuse = Reuse()
    make(prepare(*load_recipe(recipe_file)), tmp_path / "first", silent, reuse)
    assert sorted(works) == ["plan", "render_scene", "write_truth"]
    works.clear()
    make(prepare(*load_recipe(recipe_file, [ERRORS])), tmp_path / "second", silent, reuse)
    assert sorted(works) == ["plan", "write_truth"]


def test_an_asset_that_changes_is_read_again(recipe_file: str, tmp_path: Path) -> None:
    scene = tmp_path / "mine"
    scene.mkdir()
    thing = card(500, 0, {"reflectance": [0.5, 0.5, 0.5]}) | {"shape": {"type": "mesh", "file": "card.obj"}}
    values = {"title": "one card", "objects": [thing], "lights": [EVENLY]}
    (scene / "scene.toml").write_text(tomli_w.dumps(values))
    reuse, digests = Reuse(), set[str]()
    for size in (30, 60):
        corners = "\n".join(f"v {x * size} {y * size} 0" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        (scene / "card.obj").write_text(f"{corners}\nf 1 2 3\nf 1 3 4\n")
        recipe, near = load_recipe(recipe_file, [f"scene={scene}"])
        make(prepare(recipe, near), tmp_path / f"of {size}", silent, reuse)
        digests.add(str(digest(tmp_path / f"of {size}")))
    assert len(digests) == 2
