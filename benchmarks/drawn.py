"""Drawn scenes (`simgen.drawn`) as a benchmark: what is hard about each kind, and a recipe for each scene.

Numbers below 100 are for tuning; figures that are told are of numbers from 100 on.
"""

from pathlib import Path
from typing import Literal

TUNING = 100
"""Numbers from here on are for figures."""
KINDS: dict[str, Literal["untextured", "textured", "cluttered"]] = {
    "plain": "untextured",
    "textured": "textured",
    "cards": "cluttered",
    "room": "cluttered",
    "crossing": "untextured",
    "leaves": "cluttered",
    "checks": "textured",
    "shiny": "untextured",
}
"""What is hard about each, in the words of corpus.toml."""


def write_recipe(folder: Path, kind: str, number: int) -> Path:
    """Write the recipe of a drawn scene, seen by the paper's cameras, into a folder; gives its path."""
    folder.mkdir(parents=True, exist_ok=True)
    recipe = folder / f"{kind}_{number}.toml"
    recipe.write_text(
        f'title = "{kind}_{number}"\nscene = "drawn_{kind}"\nscene_number = {number}\nseed = {number}\n',
        encoding="utf-8",
    )
    return recipe
