"""A dataset of 2 x 3 views of 4 x 5 pixels as `simgen` lays it out, and ways to damage it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twins import unit_grid

from pcii.base import InputError
from pcii.store import (
    COUNTS,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    list_files,
    radiance_name,
    write_arrays_safely,
    write_exr_safely,
    write_manifest,
)
from pcii.store.dataset_layout import FRAME
from pcii.types import COUNTS_LABELS, PHOTON_TRUTH_LABELS, TRUTH_LABELS

GRID = unit_grid(2, 3, 4, 5)
Z_MM = np.where(np.arange(20).reshape(4, 5) % 3, 540.0, np.inf)
IDS = np.where(np.isfinite(Z_MM), 1, 0)
DENSE = np.random.default_rng(0).poisson(0.5, size=GRID.shape_KLHW)


def make_dataset(root: Path, *, sparse: bool = True, frames: int | None = None, **overrides: Any) -> Path:
    """A finished dataset of counts, truth and radiance; `overrides` are members of its manifest.

    Of so many binary `frames`, which it keeps, the photons of a pixel are in the first ones.
    """
    root.mkdir()
    k, l, i, j = np.nonzero(DENSE)
    events = {"k": k, "l": l, "i": i, "j": j, "n": DENSE[k, l, i, j]}
    if frames is not None:
        events[FRAME] = np.concatenate([np.arange(n) for n in events["n"]])
        overrides |= {"frames": frames, "bits": 1}
    write_arrays_safely(root / COUNTS, events if sparse else {"dense": DENSE}, COUNTS_LABELS)
    write_arrays_safely(root / TRUTH, {"z_mm": Z_MM, "object_id": IDS}, TRUTH_LABELS)
    photons = int(DENSE.sum())
    origins = {"object_id": np.ones(photons, np.int16), "z_mm": np.full(photons, 540.0, np.float32)}
    write_arrays_safely(root / PHOTON_TRUTH, origins, PHOTON_TRUTH_LABELS)
    for a, b in np.ndindex(GRID.rows, GRID.cols):
        write_exr_safely(root / radiance_name(a, b), np.full((4, 5, 3), 3 * a + b, dtype=np.float32))
    names = ("rows", "cols", "pitch_mm", "focal_mm", "pixel_mm", "height", "width")
    manifest = {
        "title": "by hand",
        "grid": {name: getattr(GRID, name) for name in names},
        "cfa": "GRBG",
        "objects": {"1": "ball"},
        "analysis": {"z_mm": [540.0], "z_range_mm": [450.0, 750.0]},
        "recipe": {"photons": {"scope": "view", "budget": 10.0, "nested": []}},
        "radiance_channels": 3,
        "files": list_files(root, [COUNTS, TRUTH, PHOTON_TRUTH, RADIANCE]),
    }
    write_manifest(root, {**manifest, **overrides})
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
    write_manifest(
        root, {name: value for name, value in manifest.items() if value is not ... and name != "sha256"}
    )
