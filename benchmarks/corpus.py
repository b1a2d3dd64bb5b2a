"""Scenes that methods are compared on: those of corpus.toml or drawn ones, many seeds, many photon budgets.

At full size a table takes a day or two. Environment variables make it smaller or share it:

BENCH_SEEDS    datasets of each scene, 20
BENCH_BUDGETS  photons per view, "30 100 300 1000 3000 10000 300000", the last of which stands for full light;
               the most are drawn, and of those the others
BENCH_METHODS  methods by name, as `pcii evaluate --method` has them, with commas between them; all
BENCH_SCENES   scenes by name, with commas between them; all
BENCH_WORKERS  processes that share the scoring (1); each is slower than one alone
BENCH_DRAWN    a-b: instead of the corpus the drawn scenes of these numbers, of every kind (drawn.py)
BENCH_OUT      where datasets and scores are kept, out/benchmark; what is there is not made again
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from benchmarks.drawn import KINDS, TUNING, write_recipe
from pcii.base.errors import InputError
from pcii.base.executor import Executor
from pcii.base.progress import Report, Stages
from pcii.evaluation.comparison import Evaluation, evaluate
from pcii.evaluation.rows import recipe_of
from pcii.evaluation.tables import Table, light_name
from pcii.store.dataset_layout import read_manifest
from simgen.base.strict_models import Strict, read_toml, validate
from simgen.dataset.generation import generate
from simgen.spec.recipe import Recipe
from simgen.spec.sweeps import load_sweep

if TYPE_CHECKING:
    from pandas import DataFrame

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
    """The scenes that methods are measured on."""

    scene: tuple[Entry, ...]


@dataclass(frozen=True)
class Work:
    """One dataset to make and score."""

    entry: Entry
    recipe: Recipe
    recipe_folder: Path
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


def named_scenes(entries: Sequence[Entry], names: Sequence[str]) -> tuple[Entry, ...]:
    """The scenes of these names, or all without names; `InputError` for a name that none has."""
    known = [entry.name for entry in entries]
    for name in names:
        if name not in known:
            raise InputError(f"BENCH_SCENES: there is no scene named {name!r}; use {', '.join(known)}")
    return tuple(entry for entry in entries if not names or entry.name in names)


def work_list(
    entries: Sequence[Entry], out: Path, seeds: int, budgets: list[int], settings: Sequence[str] = ()
) -> list[Work]:
    """Every dataset, seed by seed, so that what is done early tells of all scenes.

    `settings` change the recipes of all, as `--set` does.
    """
    *fewer, most = sorted(set(budgets))
    light = [f"photons.budget={most}", f"photons.nested={fewer}"]
    nothing_more = ["products.radiance=none", "products.visibility=false", "products.view_truth=false"]
    series: list[list[Work]] = []
    for entry in entries:
        sweep = load_sweep(
            entry.recipe, [*light, *nothing_more, f"title={entry.name}", *settings], seeds=seeds
        )
        folder = out / "data" / entry.name
        series.append(
            [
                Work(entry, sweep.recipe(number), sweep.recipe_folder, folder / sweep.folder(number))
                for number in range(len(sweep))
            ]
        )
    return [work for step in zip(*series, strict=True) for work in step]


def chosen_works() -> tuple[list[Work], list[int]]:
    """The datasets that the variables of this module's docstring ask for, and their budgets."""
    setting = os.environ.get
    budgets = [int(text) for text in setting("BENCH_BUDGETS", BUDGETS).split()]
    drawn = setting("BENCH_DRAWN", "")
    corpus = drawn_corpus(drawn, output() / "drawn") if drawn else load_corpus()
    entries = named_scenes(corpus, _names(setting("BENCH_SCENES", "")))
    return work_list(entries, output(), int(setting("BENCH_SEEDS", "20")), budgets), budgets


def output() -> Path:
    """Folder of datasets and scores."""
    return Path(os.environ.get("BENCH_OUT", "out/benchmark"))


def make(works: Sequence[Work], report: Report) -> None:
    """Make the datasets that are missing."""
    for done, work in enumerate(works, start=1):
        generate(work.recipe, work.recipe_folder, work.folder)
        report("datasets", done, len(works))


def evaluated(folder: str, methods: Sequence[str]) -> tuple[Evaluation, dict[str, Entry]]:
    """Make and score what is missing; gives the evaluation, and the scene of each recipe.

    The variables of this module's docstring say of what. `methods` are those without BENCH_METHODS, and
    `folder`, in BENCH_OUT, is for their scores; the datasets are the same for all tables.
    """
    works, _ = chosen_works()
    executor = Executor(int(os.environ.get("BENCH_WORKERS", "1")))
    asked = _names(os.environ.get("BENCH_METHODS", "")) or methods
    with Stages() as progress:
        make(works, progress)
        folders = [work.folder for work in works]
        evaluation = evaluate(folders, output() / folder, methods=asked, executor=executor, report=progress)
    return evaluation, {recipe_of(read_manifest(work.folder)): work.entry for work in works}


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def by_half_and_kind(title: str, own: "DataFrame", words: Callable[["DataFrame"], str]) -> Table:
    """A measure of `scene_means` over the scenes of a half and kind, by method; a column for each light.

    `words` says in words what a table of means over seeds of several scenes has.
    """
    import pandas as pd

    return table_by_light(title, pd.concat([own.assign(kind="all"), own]), ["half", "kind", "method"], words)


def table_by_light(
    title: str, own: "DataFrame", keys: Sequence[str], words: Callable[["DataFrame"], str]
) -> Table:
    """What `words` says of each group of rows with the same `keys`, and the number of scenes, by light."""
    lights = list(own["light"].cat.remove_unused_categories().cat.categories)
    rows: list[tuple[str, ...]] = []
    groups: Any = own.groupby(list(keys))
    for names, of_names in groups:
        cells = dict(list(of_names.groupby("light", observed=True)))
        shown = [words(cells[light]) if light in cells else "–" for light in lights]
        rows.append((*names, str(of_names["scene"].nunique()), *shown))
    return Table(title, (*keys, "scenes", *map(light_name, lights)), tuple(rows), words=len(keys))


def scene_means(evaluation: Evaluation, entry_of: Mapping[str, Entry], measure: str) -> "DataFrame":
    """Means over seeds of a measure, with `half`, `kind` and `name` of the scenes that are in the corpus."""
    means, frame = evaluation.means(), evaluation.frame
    recipes = dict(zip(frame["scene"], frame["recipe"], strict=True))
    entries = {scene: entry_of[recipe] for scene, recipe in recipes.items() if recipe in entry_of}
    own = means[(means["measure"] == measure) & means["scene"].isin(list(entries))]
    return own.assign(
        **{
            name: [getattr(entries[scene], name) for scene in own["scene"]]
            for name in ("half", "kind", "name")
        }
    )
