"""A dataset of 2 x 3 views of 4 x 5 pixels, and ways to damage it."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twins import unit_grid

from pcii.base import InputError
from pcii.store import (
    COLLECTION_FOLDER,
    DATASET_FOLDER,
    MANIFEST,
    index_row,
    read_manifest,
    save_dataset,
    write_index,
)
from pcii.types import PhotonCounts, PhotonTruth, Truth, Views

GRID = unit_grid(2, 3, 4, 5)
Z_MM = np.where(np.arange(20).reshape(4, 5) % 3, 540.0, np.inf)
IDS = np.where(np.isfinite(Z_MM), 1, 0)
DENSE = np.random.default_rng(0).poisson(0.5, size=GRID.shape_KLHW)


def make_dataset(root: Path, *, sparse: bool = True, frames: int | None = None, **overrides: Any) -> Path:
    """A finished dataset of counts, truth and radiance; `overrides` are members of its manifest.

    Of so many binary `frames`, which it keeps, the photons of a pixel are in the first ones.
    """
    k, l, i, j = np.nonzero(DENSE)
    n = DENSE[k, l, i, j]
    frame = None if frames is None else np.concatenate([np.arange(photons) for photons in n])
    readout = {} if frames is None else {"frames": frames, "bits": 1, "frame": frame}
    counts = PhotonCounts.from_dense(DENSE, GRID, cfa="GRBG")
    if sparse:
        counts = PhotonCounts.from_events(k, l, i, j, n, GRID, cfa="GRBG", **readout)
    places = {name: column.repeat(n) for name, column in zip("klij", (k, l, i, j), strict=True)}
    origins = PhotonTruth(**places, object_id=np.ones(n.sum(), int), z_mm=np.full(n.sum(), 540.0, np.float32))
    light = np.broadcast_to(np.arange(6.0).reshape(2, 3, 1, 1, 1), (*GRID.shape_KLHW, 3))
    images, truth = (counts, Views(light, GRID)), Truth(Z_MM, IDS, {1: "ball"}, photons=origins)
    depths: dict[str, Any] = {"z_mm": [540.0], "z_range_mm": (450.0, 750.0), "photon_budget": 10.0}
    save_dataset(root, images, truth, title="by hand", **depths)
    rewrite_manifest(root, **overrides)
    return root


def list_datasets(root: Path, values: Mapping[str, Mapping[str, Any]], **common: Any) -> Path:
    """Make a collection of datasets: `values` of swept fields by their folders, `common` of its document."""
    rows = [
        index_row(name, fields, read_manifest(root / name), root / name / MANIFEST)
        for name, fields in values.items()
    ]
    COLLECTION_FOLDER.write(root, {"fields": [*rows[0]["values"]], **common})
    write_index(root, rows)
    return root


def one_sentence(action: Callable[[], object], path: Path) -> str:
    """The message of the `InputError` that `action` raises, checked to be one line that names the path."""
    with pytest.raises(InputError) as caught:
        action()
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def largest_file(root: Path, part: str) -> Path:
    """The largest file of a part of the dataset."""
    return max((p for p in (root / part).rglob("*") if p.is_file()), key=lambda p: (p.stat().st_size, p.name))


def flip_a_bit(path: Path, bit: int) -> None:
    """Flip one bit of a file, counted from its first."""
    content = bytearray(path.read_bytes())
    content[bit // 8 % len(content)] ^= 1 << bit % 8
    path.write_bytes(content)


def rewrite_manifest(root: Path, **members: Any) -> None:
    """Write a manifest again with other members; one that is `...` is left out."""
    manifest = json.loads((root / MANIFEST).read_text()) | members
    DATASET_FOLDER.write(
        root, {name: value for name, value in manifest.items() if value is not ... and name != "sha256"}
    )
