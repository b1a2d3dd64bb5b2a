"""Whose folder it is, its list of files, and that all that happens to them is found."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stored_datasets import flip_a_bit, list_datasets, make_dataset, one_sentence
from tiny_datasets import OWN, write_dataset

from pcii.base import InputError, write_bytes_safely
from pcii.store import (
    COLLECTION_FOLDER,
    DATASET_FOLDER,
    EVALUATION_FOLDER,
    INDEX,
    MANIFEST,
    RESULTS_FOLDER,
    ROWS,
    Collection,
    check_free,
    check_size,
    list_files,
    open_collection,
    print_verification,
    read_listed,
    unlisted_files,
    verify,
    write_index,
)


def make_results(root: Path, versions: dict[str, str] | None = None) -> Path:
    """A report and a group of arrays as results."""
    (root / "depth.zarr").mkdir(parents=True)
    (root / "depth.zarr" / "zarr.json").write_text("{}")
    (root / "report.html").write_text("<!doctype html>")
    origin = {"dataset": "d", "identity": "abc", "light": None, "versions": versions or {}}
    RESULTS_FOLDER.write(root, origin | {"files": list_files(root, ["depth.zarr", "report.html"])})
    return root


def make_evaluation(root: Path) -> Path:
    """Two rows and a page."""
    root.mkdir()
    (root / ROWS).write_text('{"identity": "a"}\n{"identity": "b"}\n')
    (root / "evaluation.md").write_text("# Evaluation")
    EVALUATION_FOLDER.write(root, {"files": list_files(root, [ROWS, "evaluation.md"])})
    return root


def make_collection(root: Path) -> Path:
    """Two datasets and their index."""
    for seed in (3, 4):
        write_dataset(root / f"seed_{seed}", seed, {OWN: 5 + seed})
    return list_datasets(root, {f"seed_{seed}": {"seed": seed} for seed in (3, 4)})


def flip(path: Path, rng: np.random.Generator) -> None:
    flip_a_bit(path, int(rng.integers(8 * path.stat().st_size)))


def delete(path: Path, rng: np.random.Generator) -> None:
    path.unlink()


def add(path: Path, rng: np.random.Generator) -> None:
    path.with_name(f"added-{rng.integers(1 << 30)}").write_bytes(rng.bytes(int(rng.integers(20))))


@pytest.mark.parametrize("make", [make_dataset, make_collection, make_results, make_evaluation])
@pytest.mark.parametrize("damage", [flip, delete, add])
def test_every_damage_to_every_listed_file_is_found(
    tmp_path: Path, make: Callable[[Path], Path], damage: Callable[[Path, np.random.Generator], None]
) -> None:
    root, rng = make(tmp_path / "whole"), np.random.default_rng(5)
    names = [path.relative_to(root) for path in sorted(root.rglob("*")) if path.is_file()]
    assert verify(root) == len(names) - (make is not make_collection)  # a manifest is not in its own list
    for name in names:
        content = (root / name).read_bytes()
        damage(root / name, rng)
        with pytest.raises(InputError) as caught:
            verify(root)
        assert "\n" not in str(caught.value)
        (root / name).write_bytes(content)
        for added in root.rglob("added-*"):
            added.unlink()
    verify(root)


def test_results_of_other_software_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    print_verification(make_results(tmp_path / "r", {"numpy": "0.1"}), as_json=False)
    assert "2 files match the manifest; other software made them: " in capsys.readouterr().out


FOLDERS = [DATASET_FOLDER, COLLECTION_FOLDER, RESULTS_FOLDER, EVALUATION_FOLDER]
of_each_kind = pytest.mark.parametrize("kind", FOLDERS, ids=lambda kind: kind.what)


@of_each_kind
def test_only_new_and_empty_folders_and_those_of_its_kind_are_written_to(kind: Any, tmp_path: Path) -> None:
    assert kind.guard(tmp_path / "new" / "deep") == kind.guard(tmp_path) == set()
    (tmp_path / f".{kind.document}.x1.tmp").touch()  # left by a kill
    assert kind.guard(tmp_path) == set()
    for mark in kind.marks:
        out = tmp_path / mark
        out.mkdir()
        (out / mark).touch()
        (out / "part").touch()
        assert kind.guard(out) == {mark, "part"}
    work = tmp_path / "work"
    work.mkdir()
    file = work / "thesis.tex"
    file.write_text("years of work")
    for check in (kind.guard, lambda folder: check_free(folder, kind.what)):
        assert "holds something else; name a new" in one_sentence(lambda c=check: c(work), work)
        assert f"name a folder for the {kind.what}" in one_sentence(lambda c=check: c(file), file)
    assert file.read_text() == "years of work"


@of_each_kind
def test_a_document_that_is_missing_or_of_others_is_refused(kind: Any, tmp_path: Path) -> None:
    path, nowhere = tmp_path / kind.document, tmp_path / "nowhere"
    assert f"no such {kind.what} folder" in one_sentence(lambda: kind.read(nowhere), nowhere)
    assert f"`{kind.command}` makes one" in one_sentence(lambda: kind.read(tmp_path), tmp_path)
    for change in ({"format": "of others"}, {"format_version": kind.version + 1}, {"format_version": None}):
        kind.write(tmp_path, change)
        assert f"expected a {kind.format}" in one_sentence(lambda: kind.read(tmp_path), path)
    for content in (b"", b"[]", b'{"\xff": 1}'):
        path.write_bytes(content)
        assert "damaged" in one_sentence(lambda: kind.read(tmp_path), path)


def test_every_bit_of_the_manifest_of_a_dataset_is_guarded(tmp_path: Path) -> None:
    DATASET_FOLDER.write(tmp_path, {"a": 1})
    path = tmp_path / DATASET_FOLDER.document
    content = path.read_bytes()
    for bit in range(0, 8 * len(content), 7):
        flip_a_bit(path, bit)
        one_sentence(lambda: DATASET_FOLDER.read(tmp_path), path)
        path.write_bytes(content)


def test_files_are_listed_with_their_sizes_and_hashes(tmp_path: Path) -> None:
    write_bytes_safely(tmp_path / "b" / "c.bin", b"abc")
    write_bytes_safely(tmp_path / "a.bin", b"")
    listed = list_files(tmp_path, ["b", "a.bin"])
    # The SHA-256 of nothing and of "abc" are those of the standard's examples.
    assert {name: (entry["bytes"], entry["sha256"][:16]) for name, entry in listed.items()} == {
        "b/c.bin": (3, "ba7816bf8f01cfea"),
        "a.bin": (0, "e3b0c44298fc1c14"),
    }
    flip_a_bit(tmp_path / "b" / "c.bin", 3)
    check_size(tmp_path, "b/c.bin", listed["b/c.bin"])
    path = tmp_path / "b" / "c.bin"
    one_sentence(lambda: read_listed(tmp_path, "b/c.bin", listed["b/c.bin"]), path)
    (tmp_path / "b" / "link").symlink_to(path)
    assert unlisted_files(tmp_path, ["a.bin", "b/c.bin"]) == ["b/link"]


GRID = {"rows": 1, "cols": 2, "pitch_mm": (5, 5), "focal_mm": 50, "pixel_mm": 0.05, "height": 4, "width": 6}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Twenty scenes with two seeds each, without arrays."""
    root = tmp_path / "scenes"
    root.mkdir()
    values = {}
    for number in range(20):
        for seed in (1, 2):
            name = f"scene_{number}_seed_{seed}"
            values[name] = {"scene_number": number, "photons.budget": 100, "seed": seed}
            (root / name).mkdir()
            recipe = {"scene": "drawn", "scene_number": number, "seed": seed, "photons": {"budget": 100}}
            manifest = {"grid": GRID, "cfa": None, "files": {}, "recipe": recipe, "identity": name}
            DATASET_FOLDER.write(root / name, manifest)
    return list_datasets(root, values)


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


SCENE_4, SCENE_5 = "scene_4_seed_1", "scene_5_seed_1"


def forge_a_path(folder: Path) -> None:
    rows = [json.loads(line) for line in (folder / INDEX).read_text().splitlines()[:-1]]
    rows[0]["path"] = "../elsewhere"
    write_index(folder, rows)


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (forge_a_path, "not of a dataset in this folder"),
        (lambda path: shutil.copy(path / SCENE_5 / MANIFEST, path / SCENE_4), "not the one that"),
        (lambda path: shutil.rmtree(path / SCENE_4), "missing or unfinished"),
    ],
)
def test_what_no_checksum_of_a_file_tells_is_refused(
    folder: Path, harm: Callable[[Path], None], words: str
) -> None:
    harm(folder)
    for each in (verify, lambda path: open_collection(path)[8]):
        with pytest.raises(InputError, match=words):
            each(folder)
