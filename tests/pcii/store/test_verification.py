"""Whatever happens to the files of a dataset, a collection, results or an evaluation is found."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stored_datasets import flip_a_bit, make_dataset
from tiny_datasets import OWN, write_dataset

from pcii.base import InputError
from pcii.store import (
    COLLECTION_FOLDER,
    EVALUATION_FOLDER,
    MANIFEST,
    RESULTS_FOLDER,
    ROWS,
    index_row,
    list_files,
    print_verification,
    read_manifest,
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
    rows = []
    for seed in (3, 4):
        folder = write_dataset(root / f"seed_{seed}", seed, {OWN: 5 + seed})
        rows.append(index_row(folder.name, {"seed": seed}, read_manifest(folder), folder / MANIFEST))
    COLLECTION_FOLDER.write(root, {"fields": ["seed"]})
    write_index(root, rows)
    return root


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


def test_files_that_no_manifest_lists_are_named(tmp_path: Path) -> None:
    root = make_dataset(tmp_path / "d")
    (root / "counts.zarr" / "extra").touch()
    (root / "notes.txt").touch()
    with pytest.raises(InputError, match=r"not listed in manifest\.json.*: counts\.zarr/extra, notes\.txt;"):
        verify(root)


def test_results_of_other_software_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    print_verification(make_results(tmp_path / "r", {"numpy": "0.1"}), as_json=False)
    assert "2 files match the manifest; other software made them: " in capsys.readouterr().out
