"""Datasets written from Python: what comes back, whose folder it is, and what is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stored_datasets import DENSE, GRID, IDS, Z_MM
from twins import unit_grid

from pcii.base import InputError
from pcii.store import COUNTS, open_dataset, save_dataset, verify
from pcii.types import PhotonCounts, PhotonTruth, Truth, Views

LIGHT = np.random.default_rng(1).random((*GRID.shape_KLHW, 3)).astype(np.float32)
COUNTED = PhotonCounts.from_dense(DENSE, GRID, cfa="GRBG")
EVENTS = COUNTED.events
PHOTONS = PhotonTruth(
    **{name: getattr(EVENTS, name).repeat(EVENTS.n) for name in "klij"},
    object_id=np.arange(COUNTED.total) % 2,
    z_mm=np.full(COUNTED.total, 540.0, np.float32),
)
NORMAL = np.zeros((4, 5, 3), np.float32)
TRUTH = Truth(
    Z_MM,
    IDS,
    {1: "ball"},
    photons=PHOTONS,
    normal=NORMAL,
    coverage=np.ones((4, 5), np.float32),
    visible_views=np.full((4, 5), 6, np.uint16),
    unscored=frozenset({1}),
)


def same_counts(one: PhotonCounts, other: PhotonCounts) -> bool:
    return all(np.array_equal(getattr(one.events, name), getattr(other.events, name)) for name in "klijn")


@pytest.mark.parametrize("sparse", [True, False])
def test_what_is_saved_is_opened(tmp_path: Path, sparse: bool) -> None:
    counts = COUNTED
    if sparse:
        counts = PhotonCounts.from_events(*(getattr(EVENTS, name) for name in "klijn"), GRID, cfa="GRBG")
    images = (Views(LIGHT, GRID), counts)
    texts: dict[str, Any] = {"title": "Mine", "licence": "CC0", "citation": "Me", "origin": "a camera"}
    depths: dict[str, Any] = {"z_mm": [540, 620], "z_range_mm": (450, 750), "photon_budget": 10}
    saved = save_dataset(tmp_path / "d", images, TRUTH, **depths, **texts)
    dataset = open_dataset(tmp_path / "d")
    assert dataset.manifest == saved.manifest
    assert (dataset.grid, dataset.cfa, dataset.light.photons) == (GRID, "GRBG", 10)
    assert dataset.counts.is_sparse == sparse
    assert same_counts(dataset.counts, COUNTED)
    assert dataset.views is not None
    assert dataset.views.cfa is None
    np.testing.assert_array_equal(np.asarray(dataset.views.radiance), LIGHT)
    assert dataset.truth is not None
    for name in ("z_mm", "object_id", "names", "normal", "coverage", "visible_views", "unscored"):
        np.testing.assert_array_equal(getattr(dataset.truth, name), getattr(TRUTH, name))
    assert dataset.truth.photons is not None
    for name in ("k", "l", "i", "j", "object_id", "z_mm"):
        np.testing.assert_array_equal(getattr(dataset.truth.photons, name), getattr(PHOTONS, name))
    assert dataset.analysis == {"z_mm": [540, 620], "z_range_mm": [450, 750]}
    assert {name: dataset.manifest[name] for name in texts} == texts
    assert verify(tmp_path / "d") > 10


@pytest.mark.parametrize("most", [0, 1, 256, 70_000, 1 << 39])
def test_counts_of_any_number_and_share_of_pixels_come_back(tmp_path: Path, most: int) -> None:
    grid = unit_grid(2, 2, 20, 20)
    dense = np.zeros(grid.shape_KLHW, np.int64)
    dense[1, 0, 3, 4] = most
    for name, array in (("events", dense), ("dense", dense + np.arange(20))):
        dataset = save_dataset(tmp_path / "new" / name, PhotonCounts.from_dense(array, grid))
        np.testing.assert_array_equal(dataset.counts.dense, array)
        assert dataset.has(f"{COUNTS}/dense") == (name == "dense")


def test_the_identity_follows_from_the_content(tmp_path: Path) -> None:
    first = save_dataset(tmp_path / "a", COUNTED, title="one", z_mm=500).manifest["identity"]
    assert save_dataset(tmp_path / "b", COUNTED, title="two").manifest["identity"] == first
    others = [
        (PhotonCounts.from_dense(DENSE + 1, GRID, cfa="GRBG"), None),
        (PhotonCounts.from_dense(DENSE, GRID), None),
        (PhotonCounts.from_dense(DENSE, replace(GRID, pitch_mm=(2.0, 1.0)), cfa="GRBG"), None),
        (COUNTED, Truth(Z_MM, IDS, {1: "ball"})),
        (COUNTED, Truth(Z_MM, IDS, {1: "cube"})),
        (COUNTED, Truth(Z_MM, IDS, {1: "ball"}, unscored=frozenset({1}))),
    ]
    saved = [save_dataset(tmp_path / f"{n}", *other) for n, other in enumerate(others)]
    assert len({first, *(dataset.manifest["identity"] for dataset in saved)}) == 7


OTHER = unit_grid(2, 3, 4, 5, pitch_mm=(2.0, 2.0))
BRIGHT = np.full((*GRID.shape_KLHW, 1), 1e300)
SHUFFLED = replace(PHOTONS, j=PHOTONS.j[::-1].copy())
NAN_LAST = LIGHT.copy()
NAN_LAST[1, 2, 0, 0, 0] = np.nan


@pytest.mark.parametrize(
    ("images", "options", "words"),
    [
        ((COUNTED, Views(LIGHT, OTHER)), {}, "different camera grids"),
        (Views(BRIGHT, GRID), {}, r"view \(0, 0\) is too bright"),
        ((COUNTED, Views(NAN_LAST, GRID)), {}, r"view \(1, 2\) holds NaN"),
        (COUNTED, {"z_range_mm": (750, 450)}, "z_range_mm: expected two depths"),
        (COUNTED, {"truth": Truth(Z_MM[:3], IDS[:3], {1: "a"})}, r"truth: expected .* of \(4, 5\)"),
        (COUNTED, {"truth": replace(TRUTH, photons=SHUFFLED)}, "not those of the counts"),
        (COUNTED, {"view_z_mm": np.full(GRID.shape_KLHW, np.nan)}, "view_z_mm: expected depths of"),
    ],
)
def test_what_does_not_go_together_is_refused_in_a_sentence(tmp_path: Path, images, options, words) -> None:
    with pytest.raises(InputError, match=words) as caught:
        save_dataset(tmp_path / "d", images, **options)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_depths_of_every_view_are_kept_with_and_without_a_virtual_centre(tmp_path: Path) -> None:
    z_mm = np.arange(1, DENSE.size + 1).reshape(DENSE.shape) * 1.5
    z_mm[0, 1, 2, 3] = np.inf
    for name, truth in (("both", TRUTH), ("alone", None)):
        save_dataset(tmp_path / name, COUNTED, truth, view_z_mm=z_mm, radiance_unit="cd/m^2")
        dataset = open_dataset(tmp_path / name)
        np.testing.assert_array_equal(dataset.truth_array("view_z_mm"), z_mm.astype(np.float32))
        assert (dataset.truth is None) == (truth is None)
        assert dataset.manifest["radiance_unit"] == "cd/m^2"
        assert verify(tmp_path / name) > 2
