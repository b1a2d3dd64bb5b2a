"""Whatever happens to the files of a dataset, a collection, results or an evaluation is found."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stored_datasets import flip_a_bit, make_dataset
from tiny_datasets import OWN, write_dataset

from pcii.app.results import save_depth, writing
from pcii.base.errors import InputError
from pcii.evaluation.comparison import evaluate
from pcii.store.collection_layout import COLLECTION_FOLDER, index_row, write_index
from pcii.store.dataset import open_dataset
from pcii.store.dataset_layout import MANIFEST, read_manifest
from pcii.store.verification import verify
from pcii.types.estimates import DepthMap


def make_results(root: Path) -> Path:
    """Results of a dataset that stands beside them."""
    dataset = open_dataset(make_dataset(root.with_name("dataset")))
    with writing(root, dataset) as folder:
        save_depth(folder, DepthMap(np.full(dataset.grid.shape_HW, 540.0), np.ones(dataset.grid.shape_HW)))
        (folder / "report.html").write_text("<!doctype html>")
    return root


def make_evaluation(root: Path) -> Path:
    """Two methods on two datasets that stand beside it."""
    data = root.with_name("data")
    for seed in (3, 4):
        write_dataset(data / f"seed_{seed}", seed, {OWN: 5 + seed})
    evaluate([data], root, methods=["brightness", "variance"])
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


def truncate(path: Path, rng: np.random.Generator) -> None:
    path.write_bytes(path.read_bytes()[: rng.integers(path.stat().st_size)])


def delete(path: Path, rng: np.random.Generator) -> None:
    path.unlink()


def add(path: Path, rng: np.random.Generator) -> None:
    path.with_name(f"added-{rng.integers(1 << 30)}").write_bytes(rng.bytes(int(rng.integers(20))))


def add_a_folder(path: Path, rng: np.random.Generator) -> None:
    (path.parent / "added").mkdir()


def append(path: Path, rng: np.random.Generator) -> None:
    path.write_bytes(path.read_bytes() + b"\n")


@pytest.mark.parametrize("make", [make_dataset, make_collection, make_results, make_evaluation])
@pytest.mark.parametrize("damage", [flip, truncate, delete, add, add_a_folder, append])
def test_every_damage_to_every_file_is_found(
    tmp_path: Path, make: Callable[[Path], Path], damage: Callable[[Path, np.random.Generator], None]
) -> None:
    root, rng = make(tmp_path / "whole"), np.random.default_rng(5)
    names = [path.relative_to(root) for path in sorted(root.rglob("*")) if path.is_file()]
    assert verify(root) == len(names) - (make is not make_collection)  # a manifest is not in its own list
    for name in names:
        if name.name == "results.json":  # not sealed: what it lists is checked
            continue
        broken = tmp_path / "broken"
        shutil.copytree(root, broken)
        damage(broken / name, rng)
        with pytest.raises(InputError) as caught:
            verify(broken)
        assert "\n" not in str(caught.value)
        shutil.rmtree(broken)


def test_several_faults_are_counted_and_the_first_is_described(tmp_path: Path) -> None:
    root = make_dataset(tmp_path / "d")
    names = sorted(path for path in (root / "radiance").iterdir())
    for path in names[:3]:
        path.unlink()
    with pytest.raises(InputError, match=r"view_00_00\.exr: .* 2 more of \d+ files are wrong"):
        verify(root)


def test_strays_are_named(tmp_path: Path) -> None:
    root = make_dataset(tmp_path / "d")
    (root / "counts.zarr" / "dense").mkdir()
    (root / "notes.txt").touch()
    with pytest.raises(InputError, match=r"not listed in manifest\.json.*: counts\.zarr/dense/, notes\.txt;"):
        verify(root)
