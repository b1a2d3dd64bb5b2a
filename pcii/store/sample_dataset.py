"""The sample dataset that comes with the package, for trying things without a renderer."""

import shutil
from pathlib import Path

from pcii.base.safe_files import new_folder_safely
from pcii.store.dataset import Dataset, open_dataset
from pcii.store.folder_kind import check_free

SAMPLE = Path(__file__).resolve().parents[1] / "_shipped" / "sample"


def sample() -> Dataset:
    """A small dataset of the paper's ball and bird, with photon counts, truth and radiance.

    It is that of `data_recipes/sample.toml`: 5 x 5 views of 96 x 144 pixels, GRBG, 2000 photons in each. It
    is read where the package is installed; `pcii sample -o DIR` copies it.

    >>> dataset = sample()
    >>> dataset.grid.shape_KLHW, dataset.cfa, dataset.analysis["z_mm"]
    ((5, 5, 96, 144), 'GRBG', [540.0, 620.0])
    >>> dataset.truth.names
    {1: 'ball', 2: 'bird'}
    """
    return open_dataset(SAMPLE)


def copy_sample(out: Path) -> None:
    """Copy the sample dataset to the folder `out`; raises `InputError` unless that is new or empty."""
    check_free(out, "dataset")
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as new:
        shutil.copytree(SAMPLE, new, dirs_exist_ok=True)
