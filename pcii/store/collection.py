"""Collections of datasets, opened one by one as they are used."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, overload

from pcii.base.errors import InputError
from pcii.base.short_form import ShortForm, listed
from pcii.store.collection_layout import check_manifest, read_collection, read_index
from pcii.store.dataset import Dataset, open_dataset

COLUMNS = ("path", "scene", "scene_number", "seed", "split", "photons")
"""Columns of the table beside the swept fields."""


@dataclass(frozen=True, eq=False, repr=False)
class Collection(ShortForm, Sequence[Dataset]):
    """Datasets of one folder in the order of its index, each opened, and checked, when it is asked for.

    `rows` are what the index says of each: `path`, `values` of the swept fields of the recipe, `scene`,
    `scene_number`, `seed`, `split`, `photons`.
    """

    path: Path
    fields: tuple[str, ...]
    """Fields of the recipe that differ between the datasets, dotted."""
    rows: tuple[Mapping[str, Any], ...]

    def _facts(self) -> dict[str, object]:
        ends = {name: self._ends(name) for name in self.fields}
        return {"name": self.path.resolve().name, "datasets": len(self), **ends}

    def _ends(self, field: str) -> str:
        values = list(dict.fromkeys(str(row["values"][field]) for row in self.rows))
        return listed(values) if len(values) <= 4 else f"{len(values)} values"

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, number: int) -> Dataset: ...
    @overload
    def __getitem__(self, number: slice) -> "Collection": ...
    def __getitem__(self, number: int | slice) -> "Dataset | Collection":
        if isinstance(number, slice):
            return replace(self, rows=self.rows[number])
        return open_dataset(check_manifest(self.path, self.rows[number]))

    def __iter__(self) -> Iterator[Dataset]:
        return (self[number] for number in range(len(self)))

    def where(
        self, condition: Callable[[Mapping[str, Any]], bool] | None = None, /, **values: Any
    ) -> "Collection":
        """The datasets of whose row `condition` is true and which have these values.

        Values are of columns and of swept fields; of a dotted field the last part is enough where that is
        unique: `where(budget=300, split="train")`. Raises `InputError` for an unknown name, and for a value
        that no dataset has.
        """
        named = {self._column(name): value for name, value in values.items()}
        for column, value in named.items():
            held = [_cell(row, column) for row in self.rows]
            if held and value not in held:
                known = listed([str(one) for one in dict.fromkeys(map(str, held))])
                raise InputError(f"where: no dataset has {column} = {value!r}; there are {known}")
        rows = [
            row
            for row in self.rows
            if all(_cell(row, column) == value for column, value in named.items())
            and (condition is None or condition(row))
        ]
        return replace(self, rows=tuple(rows))

    def table(self) -> dict[str, list[Any]]:
        """Columns by name, a value for each dataset: what a data frame is made of."""
        return {
            column: [_cell(row, column) for row in self.rows]
            for column in dict.fromkeys([*COLUMNS, *self.fields])
        }

    def _column(self, name: str) -> str:
        known = [*COLUMNS, *self.fields]
        matching = [column for column in self.fields if column.rsplit(".", 1)[-1] == name]
        if name in known:
            return name
        if len(matching) == 1:
            return matching[0]
        raise InputError(f"where: there is no column {name!r}; there are {', '.join(dict.fromkeys(known))}")


def open_collection(path: str | Path) -> Collection:
    """Open the folder of a collection, which `simgen generate` makes of a recipe that is swept.

    Reads the index only. Raises `InputError` for a folder that is no collection, or whose index was changed.
    """
    root = Path(path)
    document, rows = read_collection(root), read_index(root)
    return Collection(root, tuple(document["fields"]), tuple(rows))


def _cell(row: Mapping[str, Any], column: str) -> Any:
    return row["values"][column] if column in row["values"] else row.get(column)
