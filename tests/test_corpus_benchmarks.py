"""The benchmarks of removal and depth, but for their size: what they would make, and how they sum up."""

from pathlib import Path
from typing import Any

from benchmarks import depth
from benchmarks.corpus import Entry, load_corpus, work_list
from benchmarks.drawn import KINDS, write_recipe
from benchmarks.removal import mean_iou
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


def group(recipe: str, title: str, ious: dict[tuple[float, str], float]) -> dict[str, Any]:
    results = [
        {
            "budget": budget,
            "method": method,
            "seeds": 2,
            "seconds": {"n": 2, "mean": 1.0, "interval": [0.5, 1.5]},
            "object": {"iou": {"n": 2, "mean": mean, "interval": [mean - 0.25, mean + 0.25]}},
            "pixel": {},
            "planes": [],
        }
        for (budget, method), mean in ious.items()
    ]
    common = {"datasets": 2, "results": results, "paired": [], "monotonic": [], "table1": []}
    return {"recipe": recipe, "title": title, "label": title, "scene": title, **common}


GROUPS = [
    group("a", "balls", {(30.0, "m"): 0.25, (100.0, "m"): 0.5}),
    group("b", "slats", {(30.0, "m"): 0.75, (100.0, "m"): 1.0}),
    group("c", "stones", {(30.0, "m"): 0.5}),
    group("d", "unknown", {(30.0, "m"): 0.0}),
]
ENTRIES = {
    "a": Entry(recipe="balls", half="train", kind="textured"),
    "b": Entry(recipe="slats", half="train", kind="cluttered"),
    "c": Entry(recipe="stones", half="test", kind="textured"),
    "e": Entry(recipe="blank", half="test", kind="empty"),
}


def test_means_by_half_and_kind_are_counted_by_hand() -> None:
    table = mean_iou(GROUPS, ENTRIES)
    assert table.header == ("half", "kind", "method", "scenes", "30", "100")
    assert table.rows == (
        ("test", "all", "m", "1", "0.500", "–"),
        ("test", "textured", "m", "1", "0.500", "–"),
        ("train", "all", "m", "2", "0.500", "0.750"),
        ("train", "cluttered", "m", "1", "0.750", "1.000"),
        ("train", "textured", "m", "1", "0.250", "0.500"),
    )


def errors(recipe: str, bad_1px: dict[tuple[float, str], float | None]) -> dict[str, Any]:
    results = [
        {"budget": budget, "method": f"depth:{method}", "depth": {"bad_1px": bad and {"mean": bad}}}
        for (budget, method), bad in bad_1px.items()
    ]
    return {"recipe": recipe, "datasets": 2, "results": results}


DEPTHS = [
    errors(
        "a",
        {
            (30.0, "focus"): 0.25, (30.0, "likelihood-sweep"): 0.5, (30.0, "variance-sweep"): 0.75,
            (100.0, "focus"): 0.25, (100.0, "variance-sweep"): 0.125,
        },
    ),
    errors("b", {(30.0, "focus"): 0.75, (30.0, "likelihood-sweep"): 0.5, (30.0, "variance-sweep"): 0.25}),
    errors("c", {(30.0, "focus"): 0.5}),
    errors("d", {(30.0, "focus"): 0.5}),
    errors("e", {(30.0, "focus"): None}),  # a scene without objects
]  # fmt: skip


def test_errors_of_depth_stand_beside_the_better_sweep_of_the_same_scene_and_budget() -> None:
    table = depth.by_scene(DEPTHS, ENTRIES)
    assert table.header == ("half", "kind", "scene", "method", "30", "100")
    assert table.rows == (
        ("test", "textured", "stones", "depth:focus", "0.500", "–"),
        ("train", "cluttered", "slats", "depth:focus", "0.750 (3.00)", "–"),
        ("train", "cluttered", "slats", "depth:likelihood-sweep", "0.500 (2.00)", "–"),
        ("train", "cluttered", "slats", "depth:variance-sweep", "0.250 (1.00)", "–"),
        ("train", "textured", "balls", "depth:focus", "0.250 (0.50)", "0.250 (2.00)"),
        ("train", "textured", "balls", "depth:likelihood-sweep", "0.500 (1.00)", "–"),
        ("train", "textured", "balls", "depth:variance-sweep", "0.750 (1.50)", "0.125 (1.00)"),
    )
    means = {row[:3]: row[3:] for row in depth.mean_errors(DEPTHS, ENTRIES).rows}
    # (0.25 + 0.75) / 2, and of the better sweeps (0.5 + 0.25) / 2.
    assert means["train", "all", "depth:focus"] == ("2", "0.500 (1.33)", "0.250 (2.00)")
    text = "\n".join(depth.report({"groups": DEPTHS}, ENTRIES))
    assert "10 datasets" in text
    assert "| train | textured | balls | depth:focus | 0.250 (0.50) |" in text
