"""Recipes found by name or path, read from their TOML files, and changed by what `--set` says."""

import tomllib
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

from pcii.base import InputError
from simgen.base import find, find_all, read_toml, shown_value, suggestion, validate
from simgen.spec.recipe import Recipe

OF_ITS_SCENE = ("title", "analysis")
"""Fields of a recipe that are about its own scene alone."""


def override(values: dict[str, Any], overrides: Sequence[str]) -> None:
    """Put values written as `key=value` into what a recipe says; raises `InputError` for any other text.

    A key is dotted (`photons.budget=300`), a value is TOML or else taken as a string.
    """
    for text in overrides:
        key, equals, value = text.partition("=")
        if not equals or not all(key.split(".")):
            raise InputError(f"--set: expected key=value such as photons.budget=300, got {text!r}")
        *tables, last = key.split(".")
        target = values
        for table in tables:
            target = target.setdefault(table, {})
            if not isinstance(target, dict):
                raise InputError(f"--set: {table!r} in {key!r} is a value, not a table")
        try:
            target[last] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            if value.startswith(("[", "{")):
                raise InputError(f"--set: {text!r}: words in a list need quotation marks") from None
            target[last] = value


class RecipeFile(NamedTuple):
    """A recipe as its TOML file and overrides say, and the folder beside which its scene is looked up."""

    recipe: Recipe
    folder: Path


def load_recipe(
    name_or_path: str | Path, overrides: Sequence[str] = (), *, trust_python: bool = False
) -> RecipeFile:
    """A recipe by the name of one that ships or by path; `overrides` such as "photons.budget=300".

    With another scene the recipe's title and analysis are dropped but for what the overrides say. A file that
    names a Python function as its scene is read only if its author is trusted, `trust_python`. Raises
    `pcii.InputError` for a recipe that is missing or wrong, with the field at fault.

    >>> load_recipe("paper", ["photons.budget=300"]).recipe.photons.budget
    300.0
    """
    values, source, folder = read_recipe(str(name_or_path), overrides, trust_python=trust_python)
    return RecipeFile(validate(Recipe, values, source), folder)


def read_recipe(
    name_or_path: str, overrides: Sequence[str] = (), *, trust_python: bool = False
) -> tuple[dict[str, Any], str, Path]:
    """What a recipe and its overrides say, before it is checked; what to call both; and the folder.

    Overrides may name a Python function whatever is trusted: they are the person's own.
    """
    path = recipe_file(name_or_path)
    if path is None:
        hint = suggestion(Path(name_or_path).stem, recipe_names())
        raise InputError(f"recipe: there is no {name_or_path!r}{hint}")
    written = read_toml(path)
    if not trust_python and ":" in str(written.get("scene", "")):
        raise InputError(
            f"{path}: scene: {shown_value(written['scene'])} runs Python code of the recipe's author; "
            "if you trust it, add --trust-python (in Python trust_python=True)"
        )
    values = deepcopy(written)
    override(values, overrides)
    if values.get("scene") != written.get("scene"):
        values = {name: value for name, value in written.items() if name not in OF_ITS_SCENE}
        override(values, overrides)
    source = str(path) if not overrides else f"{path} with --set {' '.join(overrides)}"
    return values, source, path.parent


def recipe_file(name_or_path: str) -> Path | None:
    """The file of a recipe by path or shipped name, None if there is none."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    shipped = find(f"data_recipes/{name_or_path.removesuffix('.toml')}.toml")
    return shipped if path.parent == Path() else None


def recipe_names() -> list[str]:
    """Names of the recipes that ship or stand in the working directory."""
    return sorted({file.stem for file in find_all("data_recipes/*.toml")})
