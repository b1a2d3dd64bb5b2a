"""The folder of results: what comes back, through failures, damage and other writers."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from stored_datasets import flip_a_bit, largest_file, one_sentence
from twins import unit_grid

from pcii.app import load_estimates, save_result
from pcii.app.results import writing
from pcii.sections import reconstruct
from pcii.store import RESULTS, RESULTS_FOLDER, Dataset, DatasetManifest, verify
from pcii.types import DepthMap, Light, PhotonCounts, Segmented

GRID = unit_grid(2, 2, 6, 7)
Z = np.array([0.5, 1.0])


def dataset_of(tmp_path: Path, identity: str = "a") -> Dataset:
    counts = PhotonCounts.from_dense(np.random.default_rng(3).poisson(0.3, GRID.shape_KLHW), GRID)
    members = {"identity": identity, "grid": asdict(GRID), "cfa": None, "files": {}}
    dataset = Dataset(tmp_path / "data", DatasetManifest.model_validate(members))
    vars(dataset)["counts"] = counts  # the place where the property keeps what it has read
    return dataset


def masks_of(dataset: Dataset, photons: np.ndarray | None = None) -> Segmented:
    masks = np.random.default_rng(4).random((2, 6, 7)) < 0.5
    return Segmented(masks, "by-hand", reconstruct(dataset.counts, Z), photon_in_focus=photons)


def depth_of(z_mm: float) -> DepthMap:
    return DepthMap(np.full((6, 7), z_mm), np.full((6, 7), 0.5))


def save(out: Path, dataset: Dataset, z_mm: float, *, whole: bool = False) -> None:
    with writing(out, dataset, whole=whole) as folder:
        save_result(folder, depth_of(z_mm))


def z_of(out: Path, dataset: Dataset) -> float:
    _, depth = load_estimates(out, dataset)
    assert depth is not None
    return float(depth.z_mm[0, 0])


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """Masks, a depth map and a file, which were written one after the other."""
    out, dataset = tmp_path / "out", dataset_of(tmp_path)
    save(out, dataset, 0.7)
    with writing(out, dataset) as folder:
        save_result(folder, masks_of(dataset))
        (folder / "note.txt").write_text("looked at")
    return out


def test_masks_and_photons_come_back_as_they_were(tmp_path: Path) -> None:
    dataset = dataset_of(tmp_path)
    for photons in (None, np.random.default_rng(4).random((2, dataset.counts.events.n.size)) < 0.5):
        with writing(tmp_path / "out", dataset) as folder:
            save_result(folder, masks_of(dataset, photons))
        (focus,), depth = load_estimates(tmp_path / "out", dataset)
        assert (depth, focus.method) == (None, "by-hand")
        np.testing.assert_array_equal(focus.in_focus, masks_of(dataset).in_focus)
        np.testing.assert_array_equal(focus.photon_in_focus, photons)


def test_folders_of_other_things_are_refused(saved: Path, tmp_path: Path) -> None:
    dataset, other = dataset_of(tmp_path), dataset_of(tmp_path, "b")
    assert "of another dataset or light" in one_sentence(lambda: save(saved, other, 1), saved)
    assert "of another dataset or light" in one_sentence(lambda: load_estimates(saved, other), saved)
    darker = replace(dataset, choice=Light(1))
    assert "of another dataset or light" in one_sentence(lambda: save(saved, darker, 1), saved)
    assert "dataset itself" in one_sentence(lambda: save(dataset.path, dataset, 1), dataset.path)
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("years of work")
    assert "this is a file" in one_sentence(lambda: save(thesis, dataset, 1), thesis)
    thesis.rename(saved / "thesis.tex")
    assert "holds thesis.tex" in one_sentence(lambda: save(saved, dataset, 1, whole=True), saved)
    assert (saved / "thesis.tex").read_text() == "years of work"


def test_new_results_replace_those_of_their_name_or_all(saved: Path, tmp_path: Path) -> None:
    dataset = dataset_of(tmp_path)
    save(saved, dataset, 0.9)
    assert z_of(saved, dataset) == 0.9
    assert (saved / "note.txt").read_text() == "looked at"
    assert len(load_estimates(saved, dataset)[0]) == 1
    files = {path.relative_to(saved).as_posix() for path in saved.rglob("*") if path.is_file()}
    assert set(RESULTS_FOLDER.read(saved)["files"]) == files - {RESULTS}
    assert verify(saved) == len(files) - 1
    save(saved, dataset, 1.1, whole=True)
    assert [path.name for path in sorted(saved.iterdir())] == ["depth.zarr", RESULTS]
    assert z_of(saved, dataset) == 1.1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]  # no lock, nothing temporary


def test_a_failure_leaves_what_was_there(saved: Path, tmp_path: Path) -> None:
    def fail() -> None:
        with writing(saved, dataset_of(tmp_path)) as folder:
            save_result(folder, depth_of(0.9))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert verify(saved) > 0
    assert z_of(saved, dataset_of(tmp_path)) == 0.7
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_a_second_writer_is_refused_and_what_a_kill_left_is_no_obstacle(tmp_path: Path) -> None:
    out, dataset = tmp_path / "out", dataset_of(tmp_path)
    (tmp_path / ".out.lock").touch()
    (tmp_path / ".out.abc.tmp" / "depth.zarr").mkdir(parents=True)
    with writing(out, dataset) as folder:
        assert "another run writes here" in one_sentence(lambda: save(out, dataset, 2), out)
        save_result(folder, depth_of(1))
    assert z_of(out, dataset) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("part", ["segmented_by-hand.zarr", "depth.zarr"])
def test_damage_is_found_on_reading(saved: Path, tmp_path: Path, part: str) -> None:
    file = largest_file(saved, part)
    flip_a_bit(file, 99)
    assert "SHA-256" in one_sentence(lambda: load_estimates(saved, dataset_of(tmp_path)), file)
    file.unlink()  # a missing chunk is no empty mask
    assert "missing" in one_sentence(lambda: load_estimates(saved, dataset_of(tmp_path)), file)


def test_xarray_opens_results_with_named_axes_and_units(tmp_path: Path) -> None:
    dataset, out = dataset_of(tmp_path), tmp_path / "out"
    focus = masks_of(dataset, np.ones((2, dataset.counts.events.n.size), bool))
    with writing(out, dataset) as folder:
        save_result(folder, focus.sections)
        save_result(folder, focus)
        save_result(folder, DepthMap(np.full((6, 7), np.nan), np.zeros((6, 7)), hot_pixels=3))
    assert xarray.open_zarr(out / "depth.zarr", consolidated=False).attrs["hot_pixels"] == 3
    for path in out.glob("*.zarr"):
        arrays = xarray.open_zarr(path, consolidated=False)
        assert all({"units", "long_name"} <= set(array.attrs) for array in arrays.values())
        assert {"row", "col"} <= set(arrays.sizes)
    sections = xarray.open_zarr(out / "sections.zarr", consolidated=False)
    assert (sections.z_mm.dims, sections.z_mm.attrs["units"]) == (("plane",), "mm")
    np.testing.assert_array_equal(sections.counts, focus.sections.counts)
    assert int((sections.counts == 0).sum()) > 0  # zeros stay zeros, and are not taken for missing values
