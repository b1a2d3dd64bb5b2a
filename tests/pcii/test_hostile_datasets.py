"""Broken and hostile datasets, hashes made right again, are read or refused in one sentence."""

import json
import random
import shutil
from pathlib import Path
from typing import Any

import pytest
from stored_datasets import make_dataset

from pcii.base.errors import InputError
from pcii.store.dataset import open_dataset
from pcii.store.dataset_layout import COUNTS, MANIFEST, PHOTON_TRUTH, RADIANCE, TRUTH, write_manifest
from pcii.store.folders import list_files

VALUES: list[Any] = [
    None, True, 0, -1, 3, 255, 1 << 31, 1 << 64, 10**40, -0.0, 0.5, 1e-300, 1e308, "", "NaN", "-Infinity",
    "../../etc/passwd", "\x1b[2J", "GRBG", "float64", "object", "zstd", "gzip", "x" * 100_000, [], [0],
    [1 << 30, 1 << 30], [[]], {}, {"name": "regular"},
]  # fmt: skip


def mutated(document: Any, rng: random.Random) -> Any:
    """A copy of a JSON value in which a few members are changed, deleted, added or exchanged."""
    document = json.loads(json.dumps(document))
    for _ in range(rng.choice((1, 1, 2, 5))):
        places = [(node, key) for node in nodes(document) for key in keys(node)]
        if not places:
            break
        (node, key), (other, its) = rng.choice(places), rng.choice(places)
        match rng.randrange(4):
            case 0:
                del node[key]
            case 1 if its in keys(other):
                node[key] = json.loads(json.dumps(other[its]))
            case 2 if isinstance(node, dict):
                node[str(rng.choice(VALUES))] = rng.choice(VALUES)
            case _:
                node[key] = rng.choice(VALUES)
    return document


def nodes(value: Any) -> list[Any]:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [value, *(node for one in inner for node in nodes(one))]


def keys(node: Any) -> list[Any]:
    return list(node) if isinstance(node, dict) else list(range(len(node))) if isinstance(node, list) else []


def flip_bytes(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    for _ in range(rng.choice((1, 1, 30))):
        content[rng.randrange(len(content))] = rng.randrange(256)
    path.write_bytes(content)


def make_hostile(root: Path, rng: random.Random) -> None:
    """Change one file of the dataset in `root`; but for raw bytes the hashes are made right again."""
    manifest = json.loads((root / MANIFEST).read_text())
    manifest.pop("sha256")
    files = sorted(path for path in root.rglob("*") if path.is_file() and path.name != MANIFEST)
    path, kind = rng.choice(files), rng.randrange(4)
    if kind == 0:
        return flip_bytes(rng.choice([root / MANIFEST, *files]), rng)
    if kind == 1:
        return write_manifest(root, mutated(manifest, rng))
    if path.name == "zarr.json":
        path.write_text(json.dumps(mutated(json.loads(path.read_text()), rng)))
    else:
        flip_bytes(path, rng)
    return write_manifest(
        root, {**manifest, "files": list_files(root, [COUNTS, TRUTH, PHOTON_TRUTH, RADIANCE])}
    )


def read_all(root: Path) -> None:
    """Everything that can be read of a dataset."""
    dataset = open_dataset(root)
    for budget in dataset.budgets:
        dataset.at_budget(budget)
    assert 0 <= dataset.counts.total < 1 << 63
    assert dataset.truth is None or dataset.truth.z_mm.size
    if dataset.views is not None:
        dataset.views.view(0, 0)


@pytest.mark.parametrize("number", [60, pytest.param(5000, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore")
def test_hostile_datasets_are_refused_or_read(tmp_path: Path, number: int) -> None:
    whole, refused = make_dataset(tmp_path / "whole"), 0
    for step in range(number):
        root = tmp_path / "scratch"
        shutil.rmtree(root, ignore_errors=True)
        shutil.copytree(whole, root)
        make_hostile(root, random.Random(step))
        try:
            read_all(root)
        except InputError as fault:
            refused += 1
            assert "\n" not in str(fault)  # noqa: PT017
            assert str(root) in str(fault)  # noqa: PT017
    assert refused > number / 2
