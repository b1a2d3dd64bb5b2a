"""Removal of defocused points by every method: the scenes of corpus.toml, many seeds, many photon budgets.

At full size this takes a day or two. Environment variables make it smaller or share it:

BENCH_SEEDS    datasets of each scene, 20
BENCH_BUDGETS  photons per view, "30 100 300 1000 3000 10000 300000", the last of which stands for full light;
               the most are drawn, and of those the others
BENCH_METHODS  methods by name, with commas between them; all
BENCH_WORKERS  processes that share the scoring (1); each is slower than one alone
BENCH_DRAWN    a-b: instead of the corpus the drawn scenes of these numbers, of every kind (drawn.py)
BENCH_OUT      where datasets and scores are kept, out/benchmark; what is there is not made again
"""

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from benchmarks.drawn import KINDS, TUNING, write_recipe
from pcii.base.crew import Crew
from pcii.base.errors import InputError
from pcii.base.progress import Stages
from pcii.evaluation.comparison import evaluate
from pcii.evaluation.rows import recipe_of
from pcii.evaluation.tables import Table, markdown, overview, tables_of
from pcii.io.dataset_layout import read_manifest
from simgen.base.strict_models import Strict, read_toml, validate
from simgen.dataset.generation import generate
from simgen.spec.recipe import Recipe
from simgen.spec.sweeps import load_sweep

CORPUS = Path(__file__).with_name("corpus.toml")
BUDGETS = "30 100 300 1000 3000 10000 300000"


class Entry(Strict):
    """One scene of the corpus: the name or path of a recipe, and what the scene is for."""

    recipe: str
    half: Literal["train", "test"]
    """Methods may be tuned on the one; figures that are told are of the other."""
    kind: Literal["textured", "untextured", "cluttered", "depth", "empty", "paper"]

    @property
    def name(self) -> str:
        """What datasets and tables call it; `recipe` may be a path."""
        return Path(self.recipe).stem


class Corpus(Strict):
    """The scenes that removal is measured on."""

    scene: tuple[Entry, ...]


@dataclass(frozen=True)
class Work:
    """One dataset to make and score."""

    entry: Entry
    recipe: Recipe
    near: Path
    folder: Path


def load_corpus(path: Path = CORPUS) -> tuple[Entry, ...]:
    """The scenes of a corpus file; `InputError` for one that is told wrongly."""
    return validate(Corpus, read_toml(path), str(path)).scene


def drawn_corpus(numbers: str, folder: Path) -> tuple[Entry, ...]:
    """Drawn scenes of every kind, of the numbers "a-b", with recipes in a folder; else `InputError`."""
    first, _, last = numbers.partition("-")
    if not (first.isdecimal() and (last or first).isdecimal()):
        raise InputError(f"BENCH_DRAWN: expected numbers of scenes such as 100-103, got {numbers!r}")
    return tuple(
        Entry(
            recipe=str(write_recipe(folder, kind, number)),
            half="train" if number < TUNING else "test",
            kind=hard,
        )
        for kind, hard in KINDS.items()
        for number in range(int(first), int(last or first) + 1)
    )


def work_list(entries: Sequence[Entry], out: Path, seeds: int, budgets: list[int]) -> list[Work]:
    """Every dataset, seed by seed, so that what is done early tells of all scenes."""
    *fewer, most = sorted(set(budgets))
    light = [f"photons.budget={most}", f"photons.nested={fewer}"]
    nothing_more = ["products.radiance=none", "products.visibility=false", "products.view_truth=false"]
    series: list[list[Work]] = []
    for entry in entries:
        sweep = load_sweep(entry.recipe, [*light, *nothing_more, f"title={entry.name}"], seeds=seeds)
        folder = out / "data" / entry.name
        series.append(
            [
                Work(entry, sweep.recipe(number), sweep.near, folder / sweep.folder(number))
                for number in range(len(sweep))
            ]
        )
    return [work for step in zip(*series, strict=True) for work in step]


def table() -> Iterator[str]:
    """Make and score what is missing, then tell all that is there, as Markdown."""
    setting = os.environ.get
    budgets = [int(text) for text in setting("BENCH_BUDGETS", BUDGETS).split()]
    methods = [name.strip() for name in setting("BENCH_METHODS", "").split(",") if name.strip()]
    out = Path(setting("BENCH_OUT", "out/benchmark"))
    crew = Crew(int(setting("BENCH_WORKERS", "1")))
    drawn = setting("BENCH_DRAWN", "")
    corpus = drawn_corpus(drawn, out / "drawn") if drawn else load_corpus()
    works = work_list(corpus, out, int(setting("BENCH_SEEDS", "20")), budgets)
    with Stages() as progress:
        for done, work in enumerate(works, start=1):
            generate(work.recipe, work.near, work.folder)
            progress("datasets", done, len(works))
        folders = [work.folder for work in works]
        evaluation = evaluate(folders, out / "scores", methods=methods, crew=crew, report=progress)
    yield from report(evaluation, {recipe_of(read_manifest(work.folder)): work.entry for work in works})


def report(evaluation: Mapping[str, Any], entry_of: Mapping[str, Entry]) -> Iterator[str]:
    """The tables of an evaluation, line by line; `entry_of` tells which scene a group's recipe is."""
    groups = evaluation["groups"]
    yield f"removal of defocused points, {sum(group['datasets'] for group in groups)} datasets. In brackets:"
    yield evaluation["interval"]
    for shown in (overview(groups), by_half_and_kind(groups, entry_of)):
        yield f"\n{shown.title}\n\n{markdown(shown)}"
    for group in groups:
        yield f"\n{group['label']}"
        for shown in tables_of(group):
            yield f"\n{shown.title}\n\n{markdown(shown)}"


def by_half_and_kind(groups: list[dict[str, Any]], entry_of: Mapping[str, Entry]) -> Table:
    """Mean over scenes of the mean object IoU, by half, kind and method; a column for each budget."""
    found: dict[tuple[str, str, str], dict[float, list[float]]] = defaultdict(lambda: defaultdict(list))
    for group in groups:
        entry = entry_of.get(group["recipe"])
        for row in group["results"]:
            if entry is not None and row.get("object", {}).get("iou"):
                for kind in (entry.kind, "all"):
                    cell = found[entry.half, kind, row["method"]][row["budget"]]
                    cell.append(row["object"]["iou"]["mean"])
    budgets = sorted({budget for cells in found.values() for budget in cells})
    rows: list[tuple[str, ...]] = []
    for names, cells in sorted(found.items()):
        means = [f"{sum(cells[b]) / len(cells[b]):.3f}" if cells[b] else "–" for b in budgets]
        rows.append((*names, str(max(len(values) for values in cells.values())), *means))
    header = ("half", "kind", "method", "scenes", *(f"{budget:g}" for budget in budgets))
    return Table("Mean IoU of scenes of a kind", header, tuple(rows), words=3)
