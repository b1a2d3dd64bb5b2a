"""Collections as they are opened: filtered, split, and nothing trusted that was changed."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from pcii.base import InputError
from pcii.store import (
    COLLECTION_FOLDER,
    DATASET_FOLDER,
    INDEX,
    MANIFEST,
    Collection,
    index_row,
    open_collection,
    read_manifest,
    verify,
    write_index,
)

GRID = {"rows": 1, "cols": 2, "pitch_mm": (5, 5), "focal_mm": 50, "pixel_mm": 0.05, "height": 4, "width": 6}
FIELDS = ["scene_number", "photons.budget", "seed"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Twenty scenes with two seeds each, without arrays."""
    root = tmp_path / "scenes"
    root.mkdir()
    rows = []
    for number in range(20):
        for seed in (1, 2):
            name = f"scene_{number}_seed_{seed}"
            values = {"scene_number": number, "photons.budget": 100, "seed": seed}
            (root / name).mkdir()
            recipe = {"scene": "drawn", "scene_number": number, "seed": seed, "photons": {"budget": 100}}
            manifest = {"grid": GRID, "cfa": None, "files": {}, "recipe": recipe, "identity": name}
            DATASET_FOLDER.write(root / name, manifest)
            rows.append(index_row(name, values, read_manifest(root / name), root / name / MANIFEST))
    COLLECTION_FOLDER.write(root, {"fields": FIELDS})
    write_index(root, rows)
    return root


@pytest.fixture
def collection(folder: Path) -> Collection:
    return open_collection(folder)


def test_numbers_slices_and_masks_select_datasets(collection: Collection) -> None:
    assert len(collection) == 40
    assert "40" in repr(collection)
    assert [collection[number].path.name for number in (3, -1)] == ["scene_1_seed_2", "scene_19_seed_2"]
    assert [dataset.path.name for dataset in collection[:2]] == ["scene_0_seed_1", "scene_0_seed_2"]
    table = collection.table()
    names = ["path", "scene", "scene_number", "seed", "split", "photons", "photons.budget"]
    assert list(table.columns) == names
    assert table["seed"].tolist() == 20 * [1, 2]
    (row,) = collection[(table["scene_number"] == 7) & (table["seed"] == 1)].rows
    assert row["path"] == "scene_7_seed_1"
    with pytest.raises(InputError, match="collection: expected a number, a slice or 40 values"):
        collection[[True]]  # type: ignore[call-overload]


def test_all_datasets_of_a_scene_are_in_one_part(collection: Collection) -> None:
    split = collection.table().groupby("split")["scene_number"]
    assert split.count().to_dict() == {"train": 32, "validation": 4, "test": 4}
    assert set(split.unique()["test"]) == {9, 19}


def forge_a_path(folder: Path) -> None:
    rows = [json.loads(line) for line in (folder / INDEX).read_text().splitlines()[:-1]]
    rows[0]["path"] = "../elsewhere"
    write_index(folder, rows)


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (forge_a_path, "not of a dataset in this folder"),
        (
            lambda path: shutil.copy(path / "scene_5_seed_1" / MANIFEST, path / "scene_4_seed_1"),
            "not the one that",
        ),
        (lambda path: shutil.rmtree(path / "scene_4_seed_1"), "missing or unfinished"),
    ],
)
def test_what_no_checksum_of_a_file_tells_is_refused(
    folder: Path, harm: Callable[[Path], None], words: str
) -> None:
    harm(folder)
    for each in (verify, lambda path: open_collection(path)[8]):
        with pytest.raises(InputError, match=words):
            each(folder)
