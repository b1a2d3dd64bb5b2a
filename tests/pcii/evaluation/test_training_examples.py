"""Examples to train on: poses keep geometry and colours, light is thinned exactly, splits are apart."""

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcii
from pcii import Collection, Dataset, InputError, PhotonCounts, Truth
from pcii.types import colour_index

OPTICS = pcii.Optics(pitch_mm=(4.64, 5.6), focal_mm=50.0, pixel_mm=0.4, shear_px=(1, 2))
GRID = OPTICS.grid((3, 4, 24, 32))
Z_MM = (100.0, 200.0)
BUDGET = 3000.0


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """A red square at 100 mm before even blue light at 200 mm: green pixels count nothing."""
    colours, rng = colour_index(24, 32, "GRBG"), np.random.default_rng(2)
    dense = rng.poisson(4.0, GRID.shape_KLHW) * (colours == 2)
    rows, cols = pcii.FocalPlanes.at_depths(GRID, Z_MM[:1]).nearest_shifts_px()
    for k, l in np.ndindex(3, 4):
        i, j = 8 - rows[0, k], 12 - cols[0, l]  # whole shifts bring it to rows 8 to 15, columns 12 to 19
        dense[k, l, i : i + 8, j : j + 8] = 200 * (colours[i : i + 8, j : j + 8] == 0)
    z_mm, object_id = np.full((24, 32), Z_MM[1], np.float32), np.zeros((24, 32), np.int16)
    z_mm[8:16, 12:20], object_id[8:16, 12:20] = Z_MM[0], 1
    out = tmp_path_factory.mktemp("data") / "square"
    counts = PhotonCounts.from_dense(dense.astype(np.uint16), GRID, cfa="GRBG")
    truth = Truth(z_mm, object_id, {1: "square"})
    return pcii.save_dataset(out, counts, truth, z_range_mm=Z_MM, photon_budget=BUDGET)


def test_parts_and_poses_keep_geometry_and_colours(dataset: Dataset) -> None:
    fields = "sections", "counts", "evidence", "truth"
    found = pcii.examples([dataset], fields, planes=Z_MM, crop_px=(16, 16), poses=True, seed=1)
    shapes, squares = set(), []
    for found.epoch in range(40):
        example = found[0]
        shapes.add(example["counts"].shape)
        assert example["sections"].shape == (2, 3, 16, 16)
        assert example["evidence"].shape == (2, 8, 8)
        square = example["object_id"] == 1
        squares.append(int(square.sum()))
        red, green, blue = example["sections"][0]
        # The fault: cameras, or their colours, that are not mirrored and transposed with the picture.
        assert not green.any()
        assert not red[~square].any()
        assert not blue[square].any()
        assert (red[square] > 0).mean() > 0.9
        np.testing.assert_array_equal(example["plane"], np.where(square, 0, 1))
        np.testing.assert_array_equal(example["in_focus"][0], square)
    assert shapes == {(3, 4, 16, 16), (4, 3, 16, 16)}
    assert {*squares} == {32, 64}


def test_whole_films_are_mirrored_alone(dataset: Dataset) -> None:
    found = pcii.examples([dataset], ("counts",), poses=True)
    assert {found[0]["counts"].shape for _ in range(10)} == {(3, 4, 24, 32)}
    plain = pcii.examples([dataset], ("counts",))
    np.testing.assert_array_equal(plain[0]["counts"], dataset.counts.dense)


def test_a_single_plane_has_what_lies_in_it(dataset: Dataset) -> None:
    example = pcii.examples([dataset], ("truth",), planes=Z_MM[:1])[0]
    np.testing.assert_array_equal(example["plane"], np.where(example["object_id"] == 1, 0, -1))


@pytest.mark.parametrize("shape", [(1, 6), (6, 1), (1, 1)])
@pytest.mark.parametrize("cfa", ["GRBG", "BGGR"])
def test_a_film_one_pixel_wide_keeps_its_colours(tmp_path: Path, shape: tuple[int, int], cfa: str) -> None:
    grid, red = OPTICS.grid((2, 2, *shape)), colour_index(*shape, cfa) == 0
    dense = np.broadcast_to(red, grid.shape_KLHW).astype(int)
    made = pcii.save_dataset(tmp_path / "d", PhotonCounts.from_dense(dense, grid, cfa=cfa), z_range_mm=Z_MM)
    found = pcii.examples([made], ("sections",), poses=True, seed=1)
    for found.epoch in range(8):
        assert not found[0]["sections"][:, 1:].any()  # neither green nor blue


def test_light_is_thinned_anew(dataset: Dataset) -> None:
    found = pcii.examples([dataset], ("counts",), photons=(300, 300))
    totals = np.array([found[0]["counts"].sum() for _ in range(60)])
    expected = dataset.counts.total * 300 / BUDGET
    spread = np.sqrt(expected * (1 - 300 / BUDGET))
    assert abs(totals.mean() - expected) < 5 * spread / np.sqrt(totals.size)
    assert 0.6 * spread < totals.std() < 1.6 * spread
    kept = found[0]["counts"]
    assert (kept <= dataset.counts.dense).all()
    wide = pcii.examples([dataset], ("counts",), photons=(30, 1e6), seed=4)
    assert max(wide[0]["counts"].sum() for wide.epoch in range(8)) == dataset.counts.total
    dim = pcii.examples([dataset], ("counts",), photons=(30, 1000), seed=4)
    first, again = dim[0]["counts"], dim[-1]["counts"]
    np.testing.assert_array_equal(first, again)
    dim.epoch = 1
    assert first.sum() != dim[0]["counts"].sum()


def rows_of(scenes: int, seeds: int) -> tuple[dict[str, Any], ...]:
    return tuple(
        {"scene": "drawn", "scene_number": number, "seed": seed, "split": "train", "path": "-", "values": {}}
        for number in range(scenes)
        for seed in range(seeds)
    )


@pytest.mark.parametrize(("by", "scenes", "seeds"), [("scene", 300, 2), ("seed", 1, 600)])
def test_splits_are_apart(by: Any, scenes: int, seeds: int) -> None:
    collection, shares = Collection(Path(), ("seed",), rows_of(scenes, seeds)), (0.5, 0.3, 0.2)
    parts = []
    for split, share in zip(("train", "validation", "test"), shares, strict=True):
        chosen = pcii.examples(collection, split=split, shares=shares, by=by).datasets
        assert isinstance(chosen, Collection)
        assert len(chosen) == pytest.approx(share * len(collection), rel=0.2)
        parts.append({row["scene_number" if by == "scene" else "seed"] for row in chosen.rows})
    assert all(not one & other for one, other in combinations(parts, 2))
    assert len(set.union(*parts)) == max(scenes, seeds)
    assert len(pcii.examples(collection, split="train")) == len(collection)  # its own


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"fields": ("light",)}, "fields: expected some of counts, sections, evidence, truth"),
        ({"photons": (300, 30)}, "photons: expected the least and the most"),
        ({"photons": (5000, 6000)}, "has 3000 photons per view, fewer than"),
        ({"crop_px": (18, 16)}, "crop_px: expected multiples of 4"),
        ({"split": "train"}, "shares: missing"),
        ({"split": "train", "shares": (1, 1, 1)}, "shares: expected three shares that sum to 1"),
        ({"split": "train", "shares": (0, 0, 1)}, "no dataset is in the split train"),
    ],
)
def test_what_cannot_be_is_refused(dataset: Dataset, options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        pcii.examples([dataset], **options)[0]
