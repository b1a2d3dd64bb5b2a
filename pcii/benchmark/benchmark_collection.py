"""The datasets of a benchmark, which `simgen benchmark make` makes, by half."""

from dataclasses import dataclass
from pathlib import Path

from pcii.base.errors import InputError
from pcii.io.collection import Collection, open_collection
from pcii.io.collection_layout import BENCHMARK_FIELDS, Half, read_collection
from pcii.io.dataset import Dataset


@dataclass(frozen=True)
class BenchmarkCollection:
    """A benchmark on disk: its name, and its datasets."""

    name: str
    collection: Collection

    def datasets(self, half: Half) -> list[Dataset]:
        """The datasets of one half, opened; `InputError` if one is damaged, or there is none."""
        chosen = self.collection.where(lambda row: row["values"]["half"] == half)
        if not len(chosen):
            raise InputError(
                f"{chosen.path}: has no dataset of the {half} half; `simgen benchmark make` makes it"
            )
        return list(chosen)


def open_benchmark(path: Path) -> BenchmarkCollection:
    """Open the collection of a benchmark; `InputError` for a folder that is none."""
    collection = open_collection(path)
    if {*collection.fields} != {*BENCHMARK_FIELDS}:
        raise InputError(f"{path}: is no benchmark; make one with `simgen benchmark make`")
    return BenchmarkCollection(str(read_collection(path)["recipe"].get("name")), collection)
