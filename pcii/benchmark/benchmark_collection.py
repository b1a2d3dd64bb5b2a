"""The datasets of a benchmark, which `simgen benchmark make` makes, by half and light."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pcii.base.errors import InputError
from pcii.io.collection_layout import check_manifest, read_collection, read_index
from pcii.io.dataset import Dataset, open_dataset

Half = Literal["development", "test"]
COLUMNS = {"name", "kind", "half", "light", "seed"}


@dataclass(frozen=True)
class BenchmarkCollection:
    """A benchmark on disk: its name, and for each dataset its folder's name and what it is for."""

    path: Path
    name: str
    rows: tuple[Mapping[str, Any], ...]

    def datasets(self, half: Half) -> list[Dataset]:
        """The datasets of one half, opened; `InputError` if one is damaged, or there is none."""
        rows = [row for row in self.rows if row["values"]["half"] == half]
        if not rows:
            raise InputError(
                f"{self.path}: has no dataset of the {half} half; `simgen benchmark make` makes it"
            )
        return [open_dataset(check_manifest(self.path, row)) for row in rows]


def open_benchmark(path: Path) -> BenchmarkCollection:
    """Open the collection of a benchmark; `InputError` for a folder that is none."""
    document = read_collection(path)
    if {*document["fields"]} != COLUMNS:
        raise InputError(f"{path}: is no benchmark; make one with `simgen benchmark make`")
    return BenchmarkCollection(path, str(document["recipe"].get("name")), tuple(read_index(path)))
