"""What is reused between datasets changes none of them, whatever was made before; and work is done once."""

from pathlib import Path

import pytest
from digests import digest
from property_settings import mostly_slow
from tiny import GRID_2_X_2

from pcii.base.progress import silent
from simgen.dataset import generation as module
from simgen.dataset.generation import Reuse, generate, make
from simgen.dataset.prepared import Prepared, prepare
from simgen.spec.recipe import load_recipe

pytestmark = pytest.mark.renders
TOML = f'scene = "plain_pair"\nseed = 3\n{GRID_2_X_2}[photons]\nbudget = 100\n'
ERRORS = "grid.errors={position_sd_mm=[1.0,1.0,0.5]}"
OTHERS = {
    "another seed": ["seed=4"],
    "another scene": ["scene=two_objects"],
    "another grid": ["grid.pitch_mm=[9.0,18.0]"],
    "errors of cameras from another seed": [ERRORS, "seed=4"],
    "other planes": ["analysis.z_mm=[500.0]"],
}


@pytest.fixture
def recipe_file(tmp_path: Path) -> str:
    path = tmp_path / "tiny.toml"
    path.write_text(TOML)
    return str(path)


@pytest.mark.parametrize("others", [["another scene"], pytest.param(list(OTHERS), marks=pytest.mark.slow)])
def test_datasets_are_the_same_whatever_was_made_before(
    others: list[str], recipe_file: str, tmp_path: Path
) -> None:
    reuse, between = Reuse(), {name: OTHERS[name] for name in others}
    for name, overrides in {"first": list[str](), **between, "the first again": []}.items():
        recipe, near = load_recipe(recipe_file, overrides)
        make(prepare(recipe, near), tmp_path / "reused" / name, silent, reuse)
        generate(recipe, near, tmp_path / "alone" / name)
        assert digest(tmp_path / "reused" / name) == digest(tmp_path / "alone" / name), name


@pytest.mark.parametrize(
    ("overrides", "again"),
    mostly_slow(
        [
            (["seed=4"], set[str]()),
            (["photons.budget=300"], {"plan"}),
            (["analysis.z_mm=[500.0]"], {"write_truth"}),
            (["grid.pitch_mm=[9.0,18.0]"], {"plan", "write_truth"}),
            ([ERRORS, "seed=4"], {"plan", "write_truth"}),
            (["scene=two_objects"], {"render_scene", "plan", "write_truth"}),
        ],
        quick=[(["photons.budget=300"], {"plan"}), ([ERRORS, "seed=4"], {"plan", "write_truth"})],
    ),
)
def test_only_what_depends_on_a_change_is_made_again(
    recipe_file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overrides: list[str], again: set[str]
) -> None:
    made: list[str] = []
    for owner, name in ((Prepared, "render_scene"), (Prepared, "plan"), (module, "write_truth")):
        work = getattr(owner, name)

        def watched(*args: object, work: object = work, name: str = name, **options: object) -> object:
            made.append(name)
            assert callable(work)
            return work(*args, **options)

        monkeypatch.setattr(owner, name, watched)
    reuse = Reuse()
    make(prepare(*load_recipe(recipe_file)), tmp_path / "first", silent, reuse)
    assert sorted(made) == ["plan", "render_scene", "write_truth"]
    made.clear()
    make(prepare(*load_recipe(recipe_file, overrides)), tmp_path / "second", silent, reuse)
    assert set(made) == again


def test_an_asset_that_changes_is_read_again(recipe_file: str, tmp_path: Path) -> None:
    scene = tmp_path / "own"
    scene.mkdir()
    (scene / "scene.toml").write_text(
        'title = "one card"\n[[objects]]\nname = "card"\nposition_mm = [0.0, 0.0, 500.0]\n'
        'shape = { type = "mesh", file = "card.obj" }\nmaterial = { reflectance = [0.5, 0.5, 0.5] }\n'
        '[[lights]]\ntype = "uniform"\nluminance_cd_m2 = 100.0\n'
    )
    reuse, digests = Reuse(), set[str]()
    for size in (30, 60):
        corners = "\n".join(f"v {x * size} {y * size} 0" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        (scene / "card.obj").write_text(f"{corners}\nf 1 2 3\nf 1 3 4\n")
        recipe, near = load_recipe(recipe_file, [f"scene={scene}"])
        out = tmp_path / f"of {size}"
        make(prepare(recipe, near), out, silent, reuse)
        digests.add(str(digest(out)))
    assert len(digests) == 2
