"""The datasets of a benchmark, which `simgen benchmark make` makes, by half."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pcii.base.errors import InputError
from pcii.store.benchmark_layout import Definition
from pcii.store.collection import Collection, Half, is_collection, open_collection, read_collection
from pcii.store.dataset import Dataset


@dataclass(frozen=True)
class BenchmarkCollection:
    """A benchmark on disk: its name, and its datasets."""

    name: str
    collection: Collection

    def datasets(self, half: Half) -> list[Dataset]:
        """The datasets of one half, opened; `InputError` if one is damaged, or there is none."""
        return list(self._of(half))

    def full_light(self, half: Half) -> dict[str, Dataset]:
        """By the name of each dataset of one half: that in full light of the same scene, if it is there."""
        chosen = self._of(half)
        lit = chosen.where(lambda row: row["values"]["light"] == "full-light")
        by_scene = {_scene(row): dataset for row, dataset in zip(lit.rows, lit, strict=True)}
        return {row["path"]: by_scene[_scene(row)] for row in chosen.rows if _scene(row) in by_scene}

    def first_draws(self, half: Half) -> dict[str, str]:
        """Names of the datasets of one half that are the first draw of a scene's photons, and its name."""
        found: dict[str, str] = {}
        for row in self._of(half).rows:
            if row["values"]["light"] == "photons":
                found.setdefault(_scene(row), row["path"])
        return {path: scene for scene, path in found.items()}

    def _of(self, half: Half) -> Collection:
        chosen = self.collection.where(lambda row: row["values"]["half"] == half)
        if not len(chosen):
            raise InputError(
                f"{chosen.path}: has no dataset of the {half} half; `simgen benchmark make` makes it"
            )
        return chosen


def _scene(row: Mapping[str, Any]) -> str:
    return row["values"]["name"]


def open_benchmark(path: Path) -> BenchmarkCollection:
    """Open the collection of a benchmark; `InputError` for a folder that is none."""
    fault = InputError(f"{path}: is no benchmark; make one with `simgen benchmark make`")
    if not is_collection(path):
        raise fault
    try:
        definition = Definition.model_validate(read_collection(path).recipe)
    except ValidationError:
        raise fault from None
    return BenchmarkCollection(definition.name, open_collection(path))
