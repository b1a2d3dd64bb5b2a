"""What the folder of results gives back."""

from pathlib import Path

import numpy as np
import pytest
from twins import unit_grid

from pcii import results
from pcii.dataset import Dataset
from pcii.errors import InputError
from pcii.photon_counts import PhotonCounts
from pcii.reconstruct import reconstruct
from pcii.types import Segmented

GRID = unit_grid(2, 2, 6, 7)
Z = np.array([0.5, 1.0])


def dataset_of(tmp_path: Path, rate: float) -> Dataset:
    counts = PhotonCounts.from_dense(np.random.default_rng(3).poisson(rate, GRID.shape_KLHW), GRID)
    dataset = Dataset(tmp_path, {}, GRID, None)
    vars(dataset)["counts"] = counts  # the place where the property keeps what it has read
    return dataset


@pytest.mark.parametrize("tells", [True, False])
def test_masks_and_photons_come_back_as_they_were(tmp_path: Path, tells: bool) -> None:
    dataset = dataset_of(tmp_path, 0.3)
    rng = np.random.default_rng(4)
    kept = rng.random((2, dataset.counts.events.n.size)) < 0.5 if tells else None
    masks = rng.random((2, 6, 7)) < 0.5
    sections = reconstruct(dataset.counts, Z)
    results.save_segmented(tmp_path, Segmented(Z, masks, "by-hand", sections, photon_in_focus=kept))
    (found,) = results.load_segmented(tmp_path, dataset)
    assert found.method == "by-hand"
    np.testing.assert_array_equal(found.in_focus, masks)
    if kept is None:
        assert found.photon_in_focus is None
    else:
        assert found.photon_in_focus is not None
        np.testing.assert_array_equal(found.photon_in_focus, kept)


def test_photons_of_other_counts_are_refused(tmp_path: Path) -> None:
    dataset = dataset_of(tmp_path, 0.3)
    kept = np.ones((2, dataset.counts.events.n.size), dtype=bool)
    sections = reconstruct(dataset.counts, Z)
    masks = np.zeros((2, 6, 7), dtype=bool)
    results.save_segmented(tmp_path, Segmented(Z, masks, "by-hand", sections, photon_in_focus=kept))
    with pytest.raises(InputError, match=r"photon_in_focus is of other counts"):
        results.load_segmented(tmp_path, dataset_of(tmp_path, 0.6))
