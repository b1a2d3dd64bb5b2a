"""A recipe at many seeds: one dataset each, alike in everything but chance."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.io.dataset_layout import MANIFEST, MARKER
from simgen.dataset.generation import generate
from simgen.dataset.reuse import Reuse
from simgen.spec.recipe import SEED_LIMIT, Recipe

MOST_SEEDS = 1000


def at_seeds(recipe: Recipe, count: int) -> list[Recipe]:
    """The recipe at `count` seeds: its own and those that follow.

    Raises `InputError` for a count that is not from 1 to `MOST_SEEDS`, or seeds too large to be told apart.
    """
    if not 1 <= count <= MOST_SEEDS:
        raise InputError(f"seeds: expected a whole number from 1 to {MOST_SEEDS}, got {count}")
    if recipe.seed + count > SEED_LIMIT:
        raise InputError(f"seed: {count} seeds from {recipe.seed} on end beyond 2^63; start at a smaller one")
    return [recipe.model_copy(update={"seed": recipe.seed + step}) for step in range(count)]


def folder_of(out: Path, recipe: Recipe) -> Path:
    """Where the dataset of the recipe's seed stands among those of others."""
    return out / f"seed_{recipe.seed}"


def generate_series(
    recipe: Recipe, near: Path, out: Path, count: int
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Make the dataset of each of `count` seeds in its folder of `out`; yield folder and manifest.

    Each is what `generate` makes of the recipe with that seed, resumed and left alone likewise. One process
    makes all, so that the renderer compiles once, and what does not depend on the seed is made once.
    Raises `InputError` as `generate` and `at_seeds` do.
    """
    recipes = at_seeds(recipe, count)
    if (out / MANIFEST).exists() or (out / MARKER).exists():
        raise InputError(f"{out}: holds a single dataset; name another folder for those of several seeds")
    reuse = Reuse()
    for seeded in recipes:
        folder = folder_of(out, seeded)
        yield folder, generate(seeded, near, folder, reuse=reuse)
