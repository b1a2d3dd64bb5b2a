"""Radiance on disk: one view at a time, or all of it as an array."""

from pathlib import Path

import numpy as np
import pytest
from tiny_datasets import GRID

from pcii.base.errors import InputError
from pcii.store.dataset import Dataset, open_dataset
from pcii.store.dataset_layout import RADIANCE, radiance_name, write_exr_safely, write_manifest
from pcii.store.file_list import list_files
from pcii.types.images import Views

SHAPE = (*GRID.shape_KLHW, 3)
WHOLE = np.random.default_rng(1).random(SHAPE).astype(np.float32)


@pytest.fixture
def dataset(tmp_path: Path) -> Dataset:
    for k, l in np.ndindex(*SHAPE[:2]):
        write_exr_safely(tmp_path / radiance_name(k, l), WHOLE[k, l])
    keys = ("rows", "cols", "pitch_mm", "focal_mm", "pixel_mm", "height", "width")
    manifest = {
        "grid": {name: getattr(GRID, name) for name in keys},
        "cfa": None,
        "radiance_channels": 3,
        "files": list_files(tmp_path, [RADIANCE]),
    }
    write_manifest(tmp_path, manifest)
    return open_dataset(tmp_path)


@pytest.fixture
def views(dataset: Dataset) -> Views:
    assert dataset.views is not None
    return dataset.views


def test_numpy_gets_all_views(views: Views) -> None:
    whole = np.asarray(views.radiance)
    assert (whole.shape, whole.dtype) == (SHAPE, np.float32)
    np.testing.assert_array_equal(whole, WHOLE)
    np.testing.assert_array_equal(views.radiance[1, 0], WHOLE[1, 0])
    double = np.asarray(views.radiance, dtype=np.float64)
    assert double.dtype == np.float64
    np.testing.assert_array_equal(double, WHOLE)
    assert np.mean(np.array(views.radiance)) == pytest.approx(WHOLE.mean())


def test_what_is_on_disk_is_not_in_memory_without_a_copy(views: Views) -> None:
    with pytest.raises(ValueError, match="only a copy"):
        np.asarray(views.radiance, copy=False)


@pytest.mark.parametrize("index", [0, (0,), (0, 1, 2), (2, 0), (0, -1), (slice(None), 0), ..., (0, 0.5)])
def test_an_error_for_other_indices_says_how_to_read_views(views: Views, index: object) -> None:
    with pytest.raises(InputError, match=r"radiance: read one view of 2 x 2 by \[k, l\], or all by numpy"):
        views.radiance[index]
