"""Collections of datasets, opened one by one as they are used.

    collection.json   the recipe that all have in common, and the fields that differ
    index.jsonl       a line of JSON for each finished dataset, in order; the last line is the hash of all
                      others
    draw_17_seed_3/   a dataset, named by the values of the fields that differ

The index is written when the work on the collection ends or is interrupted. It says what could be read from
all the manifests, and the hash of each.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from pcii.base import InputError, ShortForm, listed, write_bytes_safely
from pcii.store.dataset import Dataset, open_dataset
from pcii.store.folders import COLLECTION, COLLECTION_FOLDER, MANIFEST, DatasetManifest, hash_file

if TYPE_CHECKING:
    import pandas

COLUMNS = ("path", "scene", "scene_number", "seed", "split", "photons")
"""Columns of the table beside the swept fields."""
INDEX = "index.jsonl"
CROISSANT = "croissant.json"
"""In the folder of a benchmark: what catalogues of datasets read."""
CERTIFICATE = "certificate.json"
"""In the folder of a benchmark: how its datasets compare with the published ones."""
REMEDY = "the same `simgen generate` command makes it again from the datasets"
Split = Literal["train", "validation", "test"]
Half = Literal["development", "test"]
"""Of a benchmark: methods are made on the one, and what is reported is of the other."""
BENCHMARK_FIELDS = ("name", "kind", "half", "light", "seed")
"""What distinguishes the datasets of a benchmark, which is a collection of many recipes."""
IN_FRAMES = ", binary frames"
"""What follows the name of the scene in the title of a benchmark's dataset that is binary frames."""


@dataclass(frozen=True, eq=False, repr=False)
class Collection(ShortForm, Sequence[Dataset]):
    """Datasets of one folder in the order of its index, each opened, and checked, when it is asked for.

    A slice selects some, and so does a mask, such as `collection[collection.table()["split"] == "train"]`.
    `rows` are what the index says of each: `path`, `values` of the swept fields of the recipe, `scene`,
    `scene_number`, `seed`, `split`, `photons`.
    """

    path: Path
    fields: tuple[str, ...]
    """Fields of the recipe that differ between the datasets, dotted."""
    rows: tuple[Mapping[str, Any], ...]

    def _facts(self) -> dict[str, object]:
        return {"name": self.path.resolve().name, "datasets": len(self), "fields": listed(self.fields)}

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, number: int) -> Dataset: ...
    @overload
    def __getitem__(self, number: "slice | Iterable[bool]") -> "Collection": ...
    def __getitem__(self, number: "int | slice | Iterable[bool]") -> "Dataset | Collection":
        if isinstance(number, slice):
            return replace(self, rows=self.rows[number])
        if not isinstance(number, Iterable):
            return open_dataset(check_manifest(self.path, self.rows[number]))
        mask = list(number)
        if len(mask) != len(self) or not {*mask} <= {False, True}:
            raise InputError(f"collection: expected a number, a slice or {len(self)} values True or False")
        return replace(self, rows=tuple(compress(self.rows, mask)))

    def table(self) -> "pandas.DataFrame":
        """A row for each dataset: its folder, scene, split, photons, and the fields that differ."""
        import pandas

        rows = [{name: row[name] for name in COLUMNS} | dict(row["values"]) for row in self.rows]
        return pandas.DataFrame(rows, columns=list(dict.fromkeys([*COLUMNS, *self.fields])))


def open_collection(path: str | Path) -> Collection:
    """Open the folder of a collection, which `simgen generate` makes of a recipe that is swept.

    Reads the index only. Raises `InputError` for a folder that is no collection, or whose index was changed.
    """
    root = Path(path)
    fields, rows = COLLECTION_FOLDER.read(root).fields, read_index(root)
    return Collection(root, tuple(fields), tuple(rows))


def split_of(scene_number: int) -> Split:
    """Split of a drawn scene, by its number modulo 10: 80 % training, 10 % validation, 10 % test.

    All datasets of a scene are in the same split, however many there are.

    >>> [split_of(number) for number in (0, 17, 8, 29)]
    ['train', 'train', 'validation', 'test']
    """
    last: dict[int, Split] = {8: "validation", 9: "test"}
    return last.get(scene_number % 10, "train")


def index_row(
    name: str, values: Mapping[str, Any], manifest: DatasetManifest, manifest_file: Path
) -> dict[str, Any]:
    """The index's line about a finished dataset, in the folder `name`, of these values of swept fields."""
    recipe, photons = manifest.recipe, manifest.photons
    number = recipe.get("scene_number")
    return {
        "path": name,
        "values": dict(values),
        "scene": recipe.get("scene"),
        "scene_number": number,
        "seed": recipe.get("seed"),
        "split": None if number is None else split_of(number),
        "photons": None if photons is None else photons["total"],
        "identity": manifest.identity,
        "manifest_sha256": hash_file(manifest_file),
    }


def write_index(root: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write the index, atomically."""
    write_bytes_safely(root / INDEX, index_bytes(rows))


def index_bytes(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """The index of these rows as it is written."""
    lines = b"".join(json.dumps(row, allow_nan=False).encode() + b"\n" for row in rows)
    return lines + json.dumps({"sha256": hashlib.sha256(lines).hexdigest()}).encode() + b"\n"


def read_index(root: Path) -> list[dict[str, Any]]:
    """Rows of the index; `InputError` if it is missing, was changed or lacks a member."""
    path = root / INDEX
    if not path.is_file():
        raise InputError(f"{root}: the collection has no {INDEX} yet; {REMEDY}")
    content = path.read_bytes()
    try:
        rows = [json.loads(line) for line in content.splitlines()[:-1]]
        if content != index_bytes(rows):
            raise ValueError("its checksum does not match")
        if any("/" in row["path"] or row["path"].startswith(".") for row in rows):
            raise ValueError("a row is not of a dataset in this folder")
    except (ValueError, TypeError, KeyError) as fault:
        raise InputError(f"{path}: damaged or changed ({fault}); {REMEDY}") from None
    return rows


def is_collection(path: Path) -> bool:
    """Whether a folder holds a collection."""
    return (path / COLLECTION).is_file()


def check_manifest(root: Path, row: Mapping[str, Any]) -> Path:
    """Folder of the dataset of a row; `InputError` if its manifest is not the one that the index lists."""
    folder = root / row["path"]
    if not (folder / MANIFEST).is_file():
        raise InputError(f"{folder}: listed in {INDEX} but missing or unfinished; {REMEDY}")
    if hash_file(folder / MANIFEST) != row["manifest_sha256"]:
        raise InputError(f"{folder / MANIFEST}: is not the one that {INDEX} lists; {REMEDY}")
    return folder
