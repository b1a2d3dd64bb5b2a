"""What a collection is made of: datasets by number, with what distinguishes each from the others."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from simgen.spec.recipe import Recipe


class Series(Protocol):
    """Datasets of one collection, in order; a sweep over the fields of a recipe is one."""

    @property
    def fields(self) -> Sequence[str]:
        """Names of what distinguishes the datasets."""
        ...

    @property
    def base(self) -> Mapping[str, Any]:
        """What all datasets have in common."""
        ...

    @property
    def recipe_folder(self) -> Path:
        """Where files are that recipes name."""
        ...

    def __len__(self) -> int: ...

    def values(self, number: int) -> Mapping[str, Any]:
        """Value of each of the fields of a dataset."""
        ...

    def folder(self, number: int) -> str:
        """Name of a dataset's folder, the same whatever other datasets there are."""
        ...

    def recipe(self, number: int) -> Recipe:
        """The recipe of a dataset; raises `InputError` if its values make none."""
        ...
