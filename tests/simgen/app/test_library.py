"""The functions of `import simgen`: what the commands do."""

import pydoc
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tiny import GRID_2_X_3, TINY_RECIPE

import pcii
import simgen
from simgen.photons import counting_plan
from simgen.spec.recipe import Recipe

pytestmark = pytest.mark.renders
RECIPE = simgen.RecipeFile(
    Recipe.model_validate(TINY_RECIPE | {"seed": 3, "photons": {"budget": 200}}), Path()
)
GRID = RECIPE.recipe.grid.camera_grid()


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> pcii.Dataset:
    out = tmp_path_factory.mktemp("library") / "made"
    manifest = simgen.generate(RECIPE, out)
    assert manifest["photons"]["method"] == "thinning"
    return pcii.open_dataset(out)


def test_photons_without_a_file_are_those_of_the_dataset(dataset: pcii.Dataset) -> None:
    scene = simgen.load_scene(RECIPE.recipe.scene)
    counts, truth = simgen.draw_photons(scene, GRID, budget=200, cfa="GRBG", seed=3)
    assert (counts.grid, counts.cfa) == (dataset.grid, dataset.cfa)
    for name in "klijn":
        np.testing.assert_array_equal(getattr(counts.events, name), getattr(dataset.counts.events, name))
    known = dataset.truth
    assert known is not None
    assert truth.names == known.names
    for name in ("z_mm", "object_id", "normal", "coverage"):
        np.testing.assert_array_equal(getattr(truth, name), getattr(known, name))
    assert truth.photons is not None
    assert known.photons is not None
    for name in ("k", "l", "i", "j", "object_id", "z_mm"):
        np.testing.assert_array_equal(getattr(truth.photons, name), getattr(known.photons, name))


def test_photons_too_many_to_be_kept_one_by_one_can_be_scored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(counting_plan, "MOST_SINGLE_PHOTONS", 1 << 15)
    counts, truth = simgen.draw_photons(simgen.load_scene("two_objects"), GRID, budget=6000, seed=1)
    assert abs(counts.total - 36e3) < 5 * np.sqrt(36e3)
    assert truth.photons is None
    focus = pcii.segment(counts, [540, 620], method="brightness")
    assert pcii.score(focus, None, truth).planes


def test_a_recipe_may_be_named_or_be_a_path(dataset: pcii.Dataset, tmp_path: Path) -> None:
    path = tmp_path / "tiny.toml"
    path.write_text(f'scene = "two_objects"\nseed = 3\n{GRID_2_X_3}[photons]\nbudget = 200\n')
    named = simgen.generate(str(path), dataset.path)  # finished, and the same
    assert named["identity"] == dataset.manifest["identity"]
    with pytest.raises(pcii.InputError, match=r"recipe: there is no 'smal'; did you mean 'small'\?"):
        simgen.generate("smal", tmp_path / "out")
    with pytest.raises(pcii.InputError, match=r"^recipe: expected the name .*, got a Scene$"):
        simgen.generate(simgen.load_scene("two_objects"), tmp_path / "out")  # type: ignore[arg-type]
    path.write_text('scene = "two_objects"\nseed = [1, 2]')
    with pytest.raises(pcii.InputError, match=r"tiny.toml: several values of seed .*generate_collection$"):
        simgen.generate(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_wrong_is_told_in_one_sentence() -> None:
    scene = simgen.load_scene("two_objects")
    for wrong in ({"budget": -1}, {"cfa": "GRGB"}, {"seed": -1}):
        with pytest.raises(pcii.InputError, match=rf"^draw_photons: .*{next(iter(wrong))}"):
            simgen.draw_photons(scene, GRID, **wrong)  # type: ignore[arg-type]
    with pytest.raises(pcii.InputError, match=r"^scene: "):
        simgen.draw_photons("two_objects", GRID)  # type: ignore[arg-type]
    with pytest.raises(pcii.InputError, match=r"^grid: "):
        simgen.draw_photons(scene, None)  # type: ignore[arg-type]
    with pytest.raises(AttributeError, match="nothing_of_that_name"):
        simgen.nothing_of_that_name  # noqa: B018


def test_help_shows_the_functions_and_importing_loads_no_renderer() -> None:
    text = pydoc.plain(pydoc.render_doc(simgen))
    for name in ("draw_photons", "generate", "load_recipe", "load_scene", "preview"):
        assert f"    {name}(" in text
    script = "import sys, simgen; print(*[m for m in ('mitsuba', 'drjit', 'pydantic') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
