"""The folder of results: what comes back, through kills, damage and other writers."""

import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import xarray
from stored_datasets import flip_a_bit, largest_file, one_sentence
from twins import unit_grid

from pcii.app.results import LOCK, Results
from pcii.base.errors import InputError
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import Dataset
from pcii.store.folders import RESULTS, read_results
from pcii.store.manifests import DatasetManifest
from pcii.store.verification import verify
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.photon_counts import PhotonCounts

GRID = unit_grid(2, 2, 6, 7)
Z = np.array([0.5, 1.0])


def dataset_of(tmp_path: Path, rate: float, identity: str = "a") -> Dataset:
    counts = PhotonCounts.from_dense(np.random.default_rng(3).poisson(rate, GRID.shape_KLHW), GRID)
    members = {"identity": identity, "grid": asdict(GRID), "cfa": None, "files": {}}
    dataset = Dataset(tmp_path, DatasetManifest.model_validate(members))
    vars(dataset)["counts"] = counts  # the place where the property keeps what it has read
    return dataset


def masks_of(dataset: Dataset, photons: np.ndarray | None = None) -> Segmented:
    masks = np.random.default_rng(4).random((2, 6, 7)) < 0.5
    return Segmented(masks, "by-hand", reconstruct(dataset.counts, Z), photon_in_focus=photons)


@pytest.fixture
def saved(tmp_path: Path) -> Results:
    """Masks, a depth map and a file in tmp_path / "out"."""
    results = Results(tmp_path / "out", dataset_of(tmp_path, 0.3))
    with results.writing():
        results.save_segmented(masks_of(results.dataset))
        results.save_depth(DepthMap(np.full((6, 7), 0.7), np.full((6, 7), 0.5)))
        with results.replacing("note.txt") as path:
            path.write_text("looked at")
    return results


@pytest.mark.parametrize("has_photons", [True, False])
def test_masks_and_photons_come_back_as_they_were(tmp_path: Path, has_photons: bool) -> None:
    dataset = dataset_of(tmp_path, 0.3)
    rng = np.random.default_rng(4)
    kept = rng.random((2, dataset.counts.events.n.size)) < 0.5 if has_photons else None
    with Results(tmp_path / "out", dataset).writing() as results:
        results.save_segmented(masks_of(dataset, kept))
    (found,) = results.load_segmented()
    assert found.method == "by-hand"
    np.testing.assert_array_equal(found.in_focus, masks_of(dataset).in_focus)
    if kept is None:
        assert found.photon_in_focus is None
    else:
        assert found.photon_in_focus is not None
        np.testing.assert_array_equal(found.photon_in_focus, kept)


def test_photons_of_other_counts_are_refused(tmp_path: Path) -> None:
    dataset = dataset_of(tmp_path, 0.3)
    kept = np.ones((2, dataset.counts.events.n.size), dtype=bool)
    with Results(tmp_path / "out", dataset).writing() as results:
        results.save_segmented(masks_of(dataset, kept))
    with pytest.raises(InputError, match=r"photon_in_focus is of other counts"):
        Results(tmp_path / "out", dataset_of(tmp_path, 0.6)).load_segmented()


def test_results_of_another_dataset_or_of_nothing_are_refused(saved: Results, tmp_path: Path) -> None:
    other = Results(saved.path, dataset_of(tmp_path, 0.3, identity="b"))
    assert "of another dataset" in one_sentence(other.check, saved.path)
    with pytest.raises(InputError, match="of another dataset"), other.writing():
        pytest.fail("written to")
    assert "dataset itself" in one_sentence(Results(tmp_path, saved.dataset).check, tmp_path)


def test_every_file_is_listed_and_verified(saved: Results) -> None:
    files = {path.relative_to(saved.path).as_posix() for path in saved.path.rglob("*") if path.is_file()}
    assert set(read_results(saved.path)["files"]) == files - {RESULTS}
    assert verify(saved.path) == len(files) - 1


def test_what_is_written_anew_takes_the_place_of_the_old(saved: Results) -> None:
    with saved.writing():
        saved.save_depth(DepthMap(np.full((6, 7), 0.9), np.full((6, 7), 0.1)))
        with saved.replacing("note.txt") as path:
            path.write_text("again")
    found = saved.load_depth()
    assert found is not None
    assert (found.z_mm == 0.9).all()
    assert (saved.path / "note.txt").read_text() == "again"
    assert verify(saved.path) > 0
    assert not [path.name for path in saved.path.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("part", ["segmented_by-hand.zarr", "depth.zarr"])
def test_damage_is_found_on_reading(saved: Results, part: str) -> None:
    file = largest_file(saved.path, part)
    read = saved.load_depth if part == "depth.zarr" else saved.load_segmented
    flip_a_bit(file, 99)
    assert "SHA-256" in one_sentence(read, file)
    file.unlink()  # a missing chunk is no empty mask
    assert "missing" in one_sentence(read, file)


def test_masks_that_no_list_names_are_not_read(saved: Results) -> None:
    with Results(saved.path.with_name("other"), saved.dataset).writing() as other:
        other.save_segmented(masks_of(saved.dataset))
    stray = saved.path / "segmented_stray.zarr"
    (other.path / "segmented_by-hand.zarr").rename(stray)
    assert [found.method for found in saved.load_segmented()] == ["by-hand"]
    assert "segmented_stray.zarr/" in one_sentence(lambda: verify(saved.path), saved.path)


# Writes a depth map of 2, where one of 1 is, and dies at the n-th change that it makes to a folder.
KILLED = """
import os, shutil, sys
from pathlib import Path
import numpy as np
sys.path[:0] = sys.argv[2:]
from test_results import GRID, dataset_of
from pcii.app.results import Results
from pcii.types.estimates import DepthMap
import zarr, zarr.codecs

root = Path(sys.argv[1])
def write(out, value, steps):
    results, done = Results(out, dataset_of(root, 0.3)), 0
    def count(event, arguments):
        nonlocal done
        if event in ("os.rename", "os.remove", "os.rmdir", "os.mkdir"):
            done += 1
            if done == steps:
                os._exit(9)
    sys.addaudithook(count)
    with results.writing():
        results.save_depth(DepthMap(np.full((6, 7), value), np.full((6, 7), 0.5)))
    os._exit(0)

def forked(*arguments):
    child = os.fork()
    if not child:
        write(*arguments)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

assert forked(root / "first", 1.0, 0) == 0
for steps in range(1, 1000):
    out = root / f"killed-{steps}"
    shutil.copytree(root / "first", out)
    if forked(out, 2.0, steps) == 0:
        break
"""


def test_a_kill_at_any_moment_leaves_the_old_map_none_or_the_new_one(tmp_path: Path) -> None:
    here = Path(__file__).resolve().parent
    paths = [str(here), str(here.parent), str(here.parents[2])]
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), *paths], check=True, timeout=300)
    outs = sorted(tmp_path.glob("killed-*"))
    assert len(outs) > 15
    values: list[float | None] = []
    for out in outs:
        results = Results(out, dataset_of(tmp_path, 0.3))
        found = results.load_depth()
        values.append(None if found is None else float(found.z_mm[0, 0]))
        with results.writing():  # the next command goes on from there
            results.save_depth(DepthMap(np.full((6, 7), 3.0), np.full((6, 7), 0.5)))
        assert [path.name for path in sorted(out.iterdir())] == ["depth.zarr", RESULTS]
        assert verify(out) > 0
    assert {1.0, 2.0} <= set(values) <= {None, 1.0, 2.0}


def test_a_lock_that_a_kill_left_is_no_obstacle(saved: Results) -> None:
    (saved.path / LOCK).touch()
    with saved.writing():
        saved.save_depth(DepthMap(np.full((6, 7), 0.9), np.full((6, 7), 0.1)))
    assert verify(saved.path) > 0


def test_xarray_opens_results_with_named_axes_and_units(tmp_path):
    dataset = dataset_of(tmp_path, 0.3)
    focus = masks_of(dataset, np.ones((2, dataset.counts.events.n.size), bool))
    with Results(tmp_path / "out", dataset).writing() as results:
        folders = [
            results.save_sections(focus.sections),
            results.save_segmented(focus),
            results.save_depth(DepthMap(np.full((6, 7), np.nan), np.zeros((6, 7)))),
        ]
    for folder in folders:
        opened = xarray.open_zarr(folder, consolidated=False)
        assert all({"units", "long_name"} <= set(array.attrs) for array in opened.values())
        assert {"row", "col"} <= set(opened.sizes)
    sections = xarray.open_zarr(folders[0], consolidated=False)
    assert (sections.z_mm.dims, sections.z_mm.attrs["units"]) == (("plane",), "mm")
    np.testing.assert_array_equal(sections.counts, focus.sections.counts)
    assert int((sections.counts == 0).sum()) > 0  # zeros stay zeros, and are not taken for missing values
