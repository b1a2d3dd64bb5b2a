"""The truth on disk: what a recipe asks for, and nothing else."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
import zarr
from tiny import TINY_RECIPE

from pcii.metrics import TrueFocus
from pcii.store import TRUTH, open_dataset
from pcii.types import FocalPlanes
from simgen.dataset import generate
from simgen.spec import Recipe

pytestmark = pytest.mark.renders
PLANES = {"z_mm": [540, 620]}


def make(out: Path, **products: object) -> zarr.Group:
    recipe = TINY_RECIPE | {"products": {"counts": False} | products, "analysis": PLANES}
    generate(Recipe.model_validate(recipe), Path(), out)
    return zarr.open_group(out / TRUTH, mode="r")


def array(group: zarr.Group, name: str) -> np.ndarray:
    return np.asarray(group[name][...])  # type: ignore[index]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("truth") / "whole"
    make(out, visibility=True, view_truth=True)
    return out


def test_every_pass_is_there_and_opens(whole: Path) -> None:
    dataset = open_dataset(whole)
    truth: Any = dataset.truth
    assert (truth.normal.shape, truth.normal.dtype) == ((64, 60, 3), np.float32)
    assert not truth.normal.flags.writeable
    assert truth.visible_views.max() == 6
    assert (truth.visible_views > 0).mean() > 0.99
    assert (truth.coverage[truth.object_id > 0] < 1).any()
    group = zarr.open_group(whole / TRUTH, mode="r")
    assert group.attrs["in_focus_z_mm"] == [540.0, 620.0]
    masks = TrueFocus(FocalPlanes.at_depths(dataset.grid, [540.0, 620.0]), truth).by_pixel
    np.testing.assert_array_equal(array(group, "in_focus"), masks)
    assert masks.any()
    work = {entry["what"]: entry["saved"] for entry in dataset.manifest["skipped"]}
    assert 0 < work["visibility of some points"] < 6 * 64 * 60


def test_passes_of_views_are_each_views_own(whole: Path, tmp_path: Path) -> None:
    group = zarr.open_group(whole / TRUTH, mode="r")
    depth, normal = array(group, "view_z_mm"), array(group, "view_normal")
    ids, coverage = array(group, "view_object_id"), array(group, "view_coverage")
    assert depth.shape == ids.shape == coverage.shape == (2, 3, 64, 60)
    assert normal.shape == (2, 3, 64, 60, 3)
    hit = np.isfinite(depth)
    np.testing.assert_allclose(np.linalg.norm(normal[hit], axis=-1), 1, atol=1e-5)
    # A camera further right sees the same object further LEFT.
    middle = [np.argwhere(ids[0, l] == 1)[:, 1].mean() for l in range(3)]
    assert middle[0] > middle[1] > middle[2]


@pytest.mark.parametrize(
    ("products", "arrays"),
    [
        ({}, {"z_mm", "object_id", "normal", "coverage", "in_focus"}),
        ({"truth": False, "view_truth": ["normal", "z_mm"]}, {"view_normal", "view_z_mm"}),
        ({"truth": False, "view_truth": ["coverage"]}, {"view_coverage"}),
    ],
)
def test_only_what_is_asked_for_is_kept(products: dict, arrays: set[str], tmp_path: Path) -> None:
    assert set(make(tmp_path / "out", **products).array_keys()) == arrays


def test_true_and_false_are_all_passes_and_none() -> None:
    every = ("z_mm", "object_id", "normal", "coverage")
    for value, passes in ((True, every), (False, ()), (["normal"], ("normal",))):
        recipe = Recipe.model_validate(TINY_RECIPE | {"products": {"view_truth": value}})
        assert recipe.products.view_truth == passes


def test_xarray_opens_the_truth_with_named_axes_and_units(whole: Path) -> None:
    truth = xarray.open_zarr(whole / TRUTH, consolidated=False)
    assert set(truth.sizes) == {"row", "col", "axis", "plane", "camera_row", "camera_col"}
    assert all(set(array.attrs) == {"unit", "meaning", "units", "long_name"} for array in truth.values())
    assert truth.z_mm.attrs["unit"] == "mm"
    np.testing.assert_array_equal(truth.z_mm.values, open_dataset(whole).truth.z_mm)  # type: ignore[union-attr]
    assert truth.view_z_mm.isel(camera_row=0, camera_col=1).sizes == {"row": 64, "col": 60}
