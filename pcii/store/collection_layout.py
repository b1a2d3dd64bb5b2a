"""The folder of a collection of datasets: what they have in common, and the index of them.

    collection.json   the recipe that all have in common, the fields that differ, sealed by its checksum
    index.jsonl       a line of JSON for each finished dataset, in order; the last line is the hash of all
                      others
    draw_17_seed_3/   a dataset, named by the values of the fields that differ

The index is written when the work on the collection ends or is interrupted. It says what could be read from
all the manifests, and the hash of each.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

from pcii.base.errors import InputError
from pcii.base.safe_files import write_bytes_safely
from pcii.store.dataset_layout import MANIFEST
from pcii.store.folder_kind import FolderKind
from pcii.store.hashes import hash_bytes, hash_file

COLLECTION = "collection.json"
INDEX = "index.jsonl"
LOCK = ".lock"
"""Locked while a run writes to the folder, and then removed."""
REMEDY = "the same `simgen generate` command makes it again from the datasets"
COLLECTION_FOLDER = FolderKind(
    "collection",
    COLLECTION,
    version=1,
    absent=f"not a collection (no {COLLECTION}); make one with `simgen generate`",
    remedy=REMEDY,
    marks=frozenset({COLLECTION}),
    passing=frozenset({LOCK}),
)
Split = Literal["train", "validation", "test"]
Half = Literal["development", "test"]
"""Of a benchmark: methods are made on the one, and what is reported is of the other."""
BENCHMARK_FIELDS = ("name", "kind", "half", "light", "seed")
"""What distinguishes the datasets of a benchmark, which is a collection of many recipes."""
IN_FRAMES = ", binary frames"
"""What follows the name of the scene in the title of a benchmark's dataset that is binary frames."""


def split_of(scene_number: int) -> Split:
    """Split of a drawn scene, by its number modulo 10: 80 % training, 10 % validation, 10 % test.

    All datasets of a scene are in the same split, however many there are.

    >>> [split_of(number) for number in (0, 17, 8, 29)]
    ['train', 'train', 'validation', 'test']
    """
    last: dict[int, Split] = {8: "validation", 9: "test"}
    return last.get(scene_number % 10, "train")


def index_row(
    name: str, values: Mapping[str, Any], manifest: Mapping[str, Any], manifest_file: Path
) -> dict[str, Any]:
    """The index's line about a finished dataset, in the folder `name`, of these values of swept fields."""
    recipe = manifest["recipe"]
    number, photons = recipe.get("scene_number"), manifest.get("photons")
    return {
        "path": name,
        "values": dict(values),
        "scene": recipe["scene"],
        "scene_number": number,
        "seed": recipe["seed"],
        "split": None if number is None else split_of(number),
        "photons": None if photons is None else photons["total"],
        "identity": manifest["identity"],
        "manifest_sha256": hash_file(manifest_file),
    }


def read_collection(root: Path) -> dict[str, Any]:
    """What the datasets of a collection have in common; `InputError` if that is missing or was changed."""
    from pcii.store.manifest_schema import CollectionDocument, validate

    document = COLLECTION_FOLDER.read(root)
    validate(CollectionDocument, document, root / COLLECTION, REMEDY)
    return document


def write_index(root: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write the index, atomically."""
    lines = b"".join(json.dumps(row, allow_nan=False).encode() + b"\n" for row in rows)
    write_bytes_safely(root / INDEX, lines + _seal(lines))


def _seal(lines: bytes) -> bytes:
    """The last line of an index of these lines."""
    return json.dumps({"sha256": hash_bytes(lines)}).encode() + b"\n"


def read_index(root: Path) -> list[dict[str, Any]]:
    """Rows of the index; `InputError` if it is missing, was changed or lacks a member."""
    path = root / INDEX
    if not path.is_file():
        raise InputError(f"{root}: the collection has no {INDEX} yet; {REMEDY}")
    content = path.read_bytes()
    start = content.rstrip(b"\n").rfind(b"\n") + 1
    try:
        if content[start:] != _seal(content[:start]):
            raise ValueError("its checksum does not match")
        rows = [json.loads(line) for line in content[:start].splitlines()]
        for row in rows:
            if (
                not {"path", "values", "manifest_sha256"} <= set(row)
                or "/" in row["path"]
                or row["path"][:1] == "."
            ):
                raise ValueError("a row is not of a dataset in this folder")
    except (ValueError, TypeError) as fault:
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
