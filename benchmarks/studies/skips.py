"""Work that is skipped: on against off over random small scenes, and whether both give the same bytes.

Fixed costs weigh most on small scenes, so skips that save little there are measured at realistic size too.
"""

import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import bars
from benchmarks.results import Measured, Row, Size, Study
from benchmarks.scenes import film
from benchmarks.skip_pairs import SKIPS, Arrays, Skip, World
from benchmarks.timing import median_of, ratio_of
from simgen.drawn import FIRST_UNSEEN
from simgen.spec import Recipe, load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Every skip, on against off"
REALISTIC = "Skips that save little there, at realistic size"
LITTLE_PERCENT = 5.0
"""A skip that saves less is not worth its code."""
KINDS = "plain", "textured", "cards", "room", "crossing", "leaves", "checks", "shiny"
"""Kinds of drawn scenes that studies are of."""

SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"scenes": 4, "side_px": 96, "realistic_px": 256, "repeats": 3},
    "full": {"scenes": 1000, "side_px": 96, "realistic_px": 1024, "repeats": 6},
}


def measure(scenes: int, side_px: int, realistic_px: int, repeats: int) -> Measured:
    """Every skip on random scenes, and on one before them that warms up.

    Those that save little are then repeated with the paper's cameras on films of `realistic_px`.
    """
    seconds: dict[str, tuple[list[float], list[float]]] = {skip.name: ([], []) for skip in SKIPS}
    same = dict.fromkeys(seconds, 0)
    for number in range(scenes + 1):
        with tempfile.TemporaryDirectory() as folder:
            world = random_world(number, side_px, Path(folder))
            world.prepare_all()
            for skip in SKIPS:
                is_same = _timed_pair(skip, world, number, seconds[skip.name] if number else ([], []))
                same[skip.name] += is_same and number > 0
    rows = [_row(TABLE, skip, *seconds[skip.name], same[skip.name]) for skip in SKIPS]
    ratios = {name: ratio_of(off, on) for name, (on, off) in seconds.items()}
    little = [skip for skip, row in zip(SKIPS, rows, strict=True) if _saved(row) < LITTLE_PERCENT]
    rows += _realistic_rows(little, realistic_px, repeats)
    return Measured(rows, ratios, list(range(1, scenes + 1)))


def _timed_pair(skip: Skip, world: World, number: int, seconds: tuple[list[float], list[float]]) -> bool:
    """Add the seconds that a skip takes on and off; whether both give the same, if they are to."""
    # First the one, then the other, so that neither always finds what the other left in caches.
    turns = ((0, skip.on), (1, skip.off))
    content: dict[int, Arrays] = {}
    for which, work in turns if number % 2 else turns[::-1]:
        start = time.perf_counter()
        content[which] = work(world, f"{skip.name}, {number}, {which}")
        seconds[which].append(time.perf_counter() - start)
    return not skip.exact or are_same(content[0], content[1])


def _realistic_rows(skips: Sequence[Skip], side_px: int, repeats: int) -> list[Row]:
    """The skips with the paper's cameras and scene, after a pair that warms up."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        recipe, recipe_folder = load_recipe("paper", [*film(side_px), "products.radiance=none"])
        world = World(recipe, recipe_folder, Path(folder))
        world.prepare_all()
        for skip in skips:
            _timed_pair(skip, world, 0, ([], []))
            seconds: tuple[list[float], list[float]] = [], []
            same = sum(_timed_pair(skip, world, number, seconds) for number in range(1, repeats + 1))
            rows.append(_row(REALISTIC, skip, *seconds, same))
    return rows


def random_world(number: int, side_px: int, folder: Path) -> World:
    """A drawn scene of any kind, any few cameras, photons and pattern."""
    rng = np.random.default_rng([31, number])
    rows, cols = (int(n) for n in rng.integers(2, 5, 2))
    recipe = Recipe.model_validate(
        {
            "scene": f"drawn_{rng.choice(KINDS)}",
            "scene_number": int(FIRST_UNSEEN + rng.integers(1000)),
            "seed": number,
            "grid": {
                "rows": rows,
                "cols": cols,
                "pitch_mm": [18.0, 18.0],
                "pixel_mm": 36.0448 / side_px,
                "height": side_px,
                "width": side_px,
            },
            "sensor": {"cfa": str(rng.choice(["GRBG", "RGGB", "BGGR", "GBRG"]))},
            "photons": {"budget": int(10 ** rng.uniform(1, 3.5))},
            "render": {"samples_per_pixel": 8},
            "products": {"radiance": "none"},
        }
    )
    return World(recipe, Path(), folder)


def are_same(one: Arrays, other: Arrays) -> bool:
    """Whether both have the same arrays, byte by byte, and any at all."""
    return (
        bool(one)
        and one.keys() == other.keys()
        and all(
            one[name].shape == other[name].shape and np.array_equal(one[name], other[name], equal_nan=True)
            for name in one
        )
    )


def _saved(row: Row) -> float:
    return row.values["time_saved_percent"].value


def _row(table: str, skip: Skip, on: list[float], off: list[float], same: int) -> Row:
    claim = "same bytes" if skip.exact else "same distribution"
    saved = median_of([100 * (1 - a / b) for a, b in zip(on, off, strict=True)])
    values = {
        "time_on_ms": median_of(on, 1e3),
        "time_off_ms": median_of(off, 1e3),
        "time_saved_percent": saved,
    }
    held = f"{same} of {len(on)}" if skip.exact else "see photon images"
    return Row(table, skip.name, {"claim": claim, "scenes_where_it_holds": held}, values)


def draw(figure: "Figure", measured: Measured) -> None:
    """Time that each skip saves, with the line below which it would not be worth its code."""
    axes = figure.subplots()
    rows = measured.of(TABLE)
    bars(
        axes, [row.name for row in rows], [row.values["time_saved_percent"] for row in rows], "time saved, %"
    )
    axes.axvline(LITTLE_PERCENT, color="#d55e00", linewidth=0.9, linestyle=":")


def reading(measured: Measured) -> str:
    """How to read it: how many hold, and which save little here."""
    rows = measured.of(TABLE)
    exact = [row for row in rows if row.parameters["claim"] == "same bytes"]
    scenes = len(measured.seeds)
    hold = sum(row.parameters["scenes_where_it_holds"] == f"{scenes} of {scenes}" for row in exact)
    little = [row.name for row in rows if _saved(row) < LITTLE_PERCENT]
    sentence = "all save more than that"
    if little:
        there = [f"{row.name} ({_saved(row):.0f} %)" for row in measured.of(REALISTIC)]
        sentence = (
            f"less than {LITTLE_PERCENT:g} % is saved by {len(little)} of them. With the paper's cameras and"
            f" scene these save: {'; '.join(there)}"
        )
    return (
        f"Is skipped work really not missed? Of {len(exact)} skips that claim the same bytes, {hold} gave"
        f" them in all {scenes} random scenes; the other draws anew from the same distribution. Bars are"
        " the share of the time saved on these small scenes, where fixed costs weigh most, and the dotted"
        f" line is {LITTLE_PERCENT:g} %: {sentence}."
    )


STUDY = Study("skips", "Skipped work", SIZES, measure, draw, reading, width_in=9.5, height_in=4.6)
