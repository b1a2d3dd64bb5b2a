"""Recipes found by name or path, read from their TOML files, changed by what `--set` says; and those whose
fields have several values, with a dataset for each combination of them.

A field that takes one value may have a list, any field `{ each = [...] }`, and a whole number
`{ range = [first, end] }` or `{ range = [first, end, step] }`, without the end as in Python.
"""

import json
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from pcii.base import InputError
from pcii.store import hash_json
from simgen.base import find, find_all, read_toml, shown_value, suggestion, validate
from simgen.spec.recipe import Recipe
from simgen.spec.scene_lookup import find_scene, is_scene

OF_ITS_SCENE = ("title", "analysis")
"""Fields of a recipe that are about its own scene alone."""
MOST_DATASETS = 1_000_000
PLAIN = r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}"
LONGEST_STEM = 40
"""Letters before the hash of a value that is no plain name: with several fields a folder's name stays below
the 255 bytes that file systems allow."""
_SHORT_NAMES = {"scene_number": "draw"}
_ORDER = {"scene": -2, "scene_number": -1, "seed": 1}


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
    values, source, folder = _read_recipe(str(name_or_path), overrides, trust_python=trust_python)
    return RecipeFile(validate(Recipe, values, source), folder)


def _read_recipe(
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


@dataclass(frozen=True)
class Axis:
    """A swept field, dotted, and its values; `label` is what names of folders call it."""

    field: str
    values: Sequence[Any]
    label: str

    def name_of(self, value: Any) -> str:
        """The value in the names of folders: as it is written if that is plain, else its words and a hash."""
        parts = value if isinstance(value, list | tuple) else [value]
        text = "x".join(f"{part:.15g}" if type(part) is float else str(part) for part in parts)
        if not re.fullmatch(PLAIN, text):
            stem = "-".join(re.findall(r"\w+", text, re.ASCII))[-LONGEST_STEM:].strip("-_")
            text = "-".join(filter(None, (stem, hash_json(value)[:8])))
        return f"{self.label}_{text}"


@dataclass(frozen=True)
class Sweep:
    """A recipe as it is written, its fields that have several values, and where it is from.

    Fields that decide the scene come first and the seed last, so that datasets made one after the other have
    much in common.
    """

    written: Mapping[str, Any]
    axes: tuple[Axis, ...]
    source: str
    recipe_folder: Path

    @property
    def fields(self) -> tuple[str, ...]:
        """The swept fields, dotted."""
        return tuple(axis.field for axis in self.axes)

    def __len__(self) -> int:
        return math.prod(len(axis.values) for axis in self.axes)

    def values(self, number: int) -> dict[str, Any]:
        """Value of each swept field of a dataset, the last field varying fastest."""
        indices = np.unravel_index(number, [len(axis.values) for axis in self.axes])
        return {axis.field: axis.values[int(index)] for axis, index in zip(self.axes, indices, strict=True)}

    def folder(self, number: int) -> str:
        """Name of a dataset's folder: its values, the same whatever other values there are."""
        values = self.values(number)
        return "_".join(axis.name_of(values[axis.field]) for axis in self.axes)

    def recipe(self, number: int) -> Recipe:
        """The recipe of a dataset; raises `InputError` if its values make none."""
        return self._recipe_with(self.values(number))

    def _recipe_with(self, values: Mapping[str, Any]) -> Recipe:
        plain = deepcopy(dict(self.written))
        for field, value in values.items():
            _put(plain, field, value)
        shown = ", ".join(f"{field} = {json.dumps(value)}" for field, value in values.items())
        return validate(Recipe, plain, f"{self.source}{f' at {shown}' * bool(shown)}")

    @property
    def base(self) -> dict[str, Any]:
        """What all datasets have in common: the recipe with all defaults, None for the swept values."""
        resolved = self.recipe(0).model_dump(mode="json")
        for field in self.fields:
            _put(resolved, field, None)
        return resolved

    def check(self) -> None:
        """Raise `InputError` for a value with which there is no recipe, or no scene."""
        first = self.values(0)
        scenes = {self._recipe_with(first).scene}
        for axis in self.axes:
            # Of a range the ends decide: whole numbers are bounded from below and above.
            is_range = isinstance(axis.values, range)
            values = (axis.values[0], axis.values[-1]) if is_range else axis.values
            scenes |= {self._recipe_with(first | {axis.field: value}).scene for value in values}
        for scene in scenes:
            find_scene(scene, self.recipe_folder)


def load_sweep(
    name_or_path: str,
    overrides: Sequence[str] = (),
    *,
    seeds: int | None = None,
    scenes: int | None = None,
    trust_python: bool = False,
) -> Sweep:
    """A recipe whose fields may have several values, by path or shipped name and `overrides` as for one.

    The name of a scene alone means a recipe that says nothing else, with the paper's cameras and photons.
    `seeds` and `scenes` are the numbers of seeds and draws of the scene, from the recipe's own on. Raises
    `InputError` for a recipe that is missing or wrong, for a field without values, with the same value twice,
    or swept twice, and for more than `MOST_DATASETS`.
    """
    file = recipe_file(name_or_path)
    if (file is None or file == Path(name_or_path)) and is_scene(name_or_path):
        written: dict[str, Any] = {"scene": name_or_path}
        override(written, overrides)
        source, recipe_folder = f"a recipe of the scene {name_or_path}", Path()
    else:
        written, source, recipe_folder = _read_recipe(name_or_path, overrides, trust_python=trust_python)
    for option, field, count in (("scenes", "scene_number", scenes), ("seeds", "seed", seeds)):
        if count is not None:
            first = written.get(field, 0)
            if type(first) is not int:
                raise InputError(f"{option}: the recipe gives {field} several values already; leave one out")
            if count < 1:
                raise InputError(f"{option}: expected a whole number from 1, got {count}")
            written[field] = {"range": [first, first + count]}
    swept = dict(sorted(_swept(written, Recipe, ""), key=lambda item: _ORDER.get(item[0], 0)))
    # Folders call a field by the last part of its name, or by all of it where that is not unique.
    short = {field: _SHORT_NAMES.get(field, field.rsplit(".", 1)[-1]) for field in swept}
    uses = Counter(short.values())
    axes: list[Axis] = []
    for field, value in swept.items():
        label = short[field] if uses[short[field]] == 1 else field.replace(".", "-")
        axis = Axis(field, _values(field, value, source), label)
        axes.append(axis)
        if len({axis.name_of(value) for value in axis.values}) < len(axis.values):
            raise InputError(f"{source}: {axis.field}: gives a value twice; each makes one dataset")
    sweep = Sweep(written, tuple(axes), source, recipe_folder)
    if len(sweep) > MOST_DATASETS:
        raise InputError(f"{source}: {len(sweep)} datasets; at most {MOST_DATASETS} can be made at once")
    sweep.check()
    return sweep


def _put(values: dict[str, Any], field: str, value: Any) -> None:
    """Set a field, dotted, whose tables are there."""
    *tables, last = field.split(".")
    for table in tables:
        values = values[table]
    values[last] = value


def _swept(values: Mapping[str, Any], model: type[BaseModel], prefix: str) -> Iterator[tuple[str, Any]]:
    """Fields that have several values, dotted, with what is written there."""
    for name, value in values.items():
        if name not in model.model_fields:
            continue  # an unknown key, which the check of the recipe reports
        inner, takes_list = _kind(model.model_fields[name].annotation)
        is_marked = isinstance(value, dict) and set(value) in ({"each"}, {"range"})
        if is_marked or (isinstance(value, list) and not takes_list):
            yield f"{prefix}{name}", value
        elif isinstance(value, dict) and inner is not None:
            yield from _swept(value, inner, f"{prefix}{name}.")


def _kind(annotation: Any) -> tuple[type[BaseModel] | None, bool]:
    """The model that a field holds, if it holds one, and whether it takes a list."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return _kind(get_args(annotation)[0])
    if origin in (Union, UnionType):
        kinds = [_kind(part) for part in get_args(annotation)]
        return next((model for model, _ in kinds if model is not None), None), any(many for _, many in kinds)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, False
    return None, tuple in (origin, annotation)


def _values(field: str, written: Any, source: str) -> Sequence[Any]:
    values = written if isinstance(written, list) else written.get("each")
    if isinstance(written, dict) and "range" in written:
        ends = written["range"]
        are_whole = isinstance(ends, list) and all(type(end) is int for end in ends)
        if not are_whole or len(ends) not in (2, 3) or ends[2:] == [0]:
            raise InputError(
                f"{source}: {field}: range: expected [first, end] or [first, end, step], whole numbers"
            )
        values = range(*ends)
    if not isinstance(values, list | range) or not values:
        raise InputError(f"{source}: {field}: expected at least one value to sweep over")
    if values[MOST_DATASETS:]:
        raise InputError(f"{source}: {field}: at most {MOST_DATASETS} values can be swept over")
    return values
