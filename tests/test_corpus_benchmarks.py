"""The benchmarks of removal and depth, but for their size: what they would make, and how they sum up."""

from pathlib import Path
from typing import Any

from benchmarks import depth
from benchmarks.corpus import Entry, load_corpus, work_list
from benchmarks.drawn import KINDS, write_recipe
from pcii.evaluation.comparison import Evaluation
from pcii.evaluation.rows import frame_of
from simgen.dataset.prepared import prepare
from simgen.spec.recipe import load_recipe
from simgen.spec.scene_lookup import drawn_scenes


def test_the_corpus_is_of_recipes_that_ship(tmp_path: Path) -> None:
    entries = load_corpus()
    works = work_list(entries, tmp_path, 2, [100, 30])
    assert len(works) == 2 * len(entries)
    # Seed by seed: whoever stops early has every scene.
    assert [work.entry for work in works[: len(entries)]] == list(entries)
    for first, second in zip(works[: len(entries)], works[len(entries) :], strict=True):
        assert second.recipe == first.recipe.model_copy(update={"seed": first.recipe.seed + 1})
        assert first.recipe.photons.budget == 100
        assert first.recipe.photons.nested == (30,)
        assert first.recipe.products.radiance == "none"
        assert first.recipe.title == first.entry.recipe
        assert first.folder == tmp_path / "data" / first.entry.recipe / f"seed_{first.recipe.seed}"


def test_every_kind_of_drawn_scene_is_seen_by_the_papers_cameras(tmp_path: Path) -> None:
    assert {f"drawn_{kind}" for kind in KINDS} <= drawn_scenes().keys()
    for kind in KINDS:
        recipe, near = load_recipe(str(write_recipe(tmp_path, kind, 7)))
        paper, _ = load_recipe("paper")
        assert (recipe.grid, recipe.cfa, recipe.photons) == (paper.grid, paper.cfa, paper.photons)
        assert prepare(recipe, near).scene.title == f"Drawn: {kind} 7"


def evaluation_of(means: dict[tuple[str, float, str], Any]) -> Evaluation:
    """Two datasets of each recipe, by light and method of depth, which differ by 0.5 and have these means."""
    rows = []
    for (recipe, light, method), mean in means.items():
        for seed in (0, 1):
            value = None if mean is None else mean + 0.25 * (2 * seed - 1)
            row = {
                "identity": f"{recipe}{seed}",
                "dataset": f"seed_{seed}",
                "recipe": recipe,
                "title": recipe,
            }
            row |= {"seed": seed, "budget": light, "photons_per_view": light, "seconds": 1.0}
            rows.append(row | {"method": f"depth:{method}", "depth": {"bad_1px": value}})
    return Evaluation(Path("out"), frame_of(rows), {})


ENTRIES = {
    "a": Entry(recipe="balls", half="train", kind="textured"),
    "b": Entry(recipe="slats", half="train", kind="cluttered"),
    "c": Entry(recipe="stones", half="test", kind="textured"),
    "e": Entry(recipe="blank", half="test", kind="empty"),
}


def test_errors_of_depth_stand_beside_the_better_sweep_of_the_same_scene_and_light() -> None:
    errors = {
        ("a", 30.0, "posterior"): 0.25,
        ("a", 30.0, "sweep-17"): 0.5,
        ("a", 30.0, "variance-sweep"): 0.75,
        ("a", 100.0, "posterior"): 0.5,
        ("a", 100.0, "variance-sweep"): 0.25,
        ("b", 30.0, "posterior"): 0.75,
        ("b", 30.0, "sweep-17"): 0.5,
        ("b", 30.0, "variance-sweep"): 0.25,
        ("c", 30.0, "posterior"): 0.5,
        ("d", 30.0, "posterior"): 0.5,  # of no scene of the corpus
        ("e", 30.0, "posterior"): None,  # a scene without objects
    }
    text = "\n".join(depth.report(evaluation_of(errors), ENTRIES))
    assert "10 datasets" in text
    for row in (
        "| test | textured | stones | depth:posterior | 1 | 0.500 | – |",
        "| train | cluttered | slats | depth:posterior | 1 | 0.750 (3.00) | – |",
        "| train | cluttered | slats | depth:variance-sweep | 1 | 0.250 (1.00) | – |",
        "| train | textured | balls | depth:posterior | 1 | 0.250 (0.50) | 0.500 (2.00) |",
        "| train | textured | balls | depth:variance-sweep | 1 | 0.750 (1.50) | 0.250 (1.00) |",
        # (0.25 + 0.75) / 2, and of the better sweeps (0.5 + 0.25) / 2.
        "| train | all | depth:posterior | 2 | 0.500 (1.33) | 0.500 (2.00) |",
    ):
        assert row in text, row
