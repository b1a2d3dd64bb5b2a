"""What `simgen export` writes comes back as it was."""

import re
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stored_datasets import DENSE, GRID, make_dataset, one_sentence
from twins import unit_grid

import pcii
from pcii.app.commands import app
from pcii.core.truth import Truth
from pcii.importing.exported_files import import_exported


@pytest.fixture
def dataset(tmp_path: Path) -> pcii.Dataset:
    return pcii.open_dataset(make_dataset(tmp_path / "made"))


def the_truth(found: Truth | None) -> Truth:
    assert found is not None
    return found


def test_events_come_back(dataset: pcii.Dataset, tmp_path: Path) -> None:
    folder = pcii.export_dataset(dataset, "events", tmp_path / "out")
    found = import_exported(folder)
    (counts,) = found.images
    assert isinstance(counts, pcii.PhotonCounts)
    assert (counts.grid, counts.cfa) == (dataset.grid, "GRBG")
    for name in "klijn":
        assert np.array_equal(getattr(counts.events, name), getattr(dataset.counts.events, name))
    truth, known = the_truth(found.truth), the_truth(dataset.truth)
    assert np.array_equal(truth.z_mm, known.z_mm)
    assert np.array_equal(truth.object_id, known.object_id)
    assert truth.names == known.names
    assert truth.photons is not None
    assert known.photons is not None
    assert np.array_equal(truth.photons.z_mm, known.photons.z_mm)
    assert np.array_equal(truth.photons.j, known.photons.j)
    assert (found.z_mm, found.z_range_mm, found.photon_budget) == ((540,), (450, 750), 10)


@pytest.mark.parametrize("format", ["events"])
def test_objects_with_large_numbers_stay_apart(tmp_path: Path, format) -> None:
    object_id = np.arange(20).reshape(4, 5) + 10**9 - 20
    truth = Truth(np.full((4, 5), 540.0), object_id, {int(key): f"no. {key}" for key in object_id.flat})
    counts = pcii.PhotonCounts.from_dense(DENSE, GRID)
    made = pcii.save_dataset(tmp_path / "made", counts, truth)
    again = the_truth(import_exported(pcii.export_dataset(made, format, tmp_path / "out")).truth)
    assert np.array_equal(again.object_id, object_id)
    assert again.names == truth.names


@pytest.mark.parametrize("format", ["events"])
def test_the_command_needs_no_options_for_them(dataset: pcii.Dataset, tmp_path: Path, format: str) -> None:
    folder = pcii.export_dataset(dataset, format, tmp_path / "out")  # pyright: ignore[reportArgumentType]
    again = imported(folder, tmp_path / "again")
    assert again.grid == dataset.grid
    assert again.analysis == dataset.analysis
    assert again.budgets == dataset.budgets
    assert again.counts.total == dataset.counts.total
    assert (again.views is None) == (format == "events")
    assert np.array_equal(the_truth(again.truth).z_mm, the_truth(dataset.truth).z_mm)
    other = imported(folder, tmp_path / "other", "--z-mm", "600", "--z-range-mm", "500", "700")
    assert other.analysis == {"z_mm": [600], "z_range_mm": [500, 700]}
    with pytest.raises(pcii.InputError, match="has photon counts already"):
        imported(folder, tmp_path / "fewer", "--photons", "5")


def imported(folder: Path, out: Path, *options: str) -> pcii.Dataset:
    app(["import", str(folder), "-o", str(out), *options], result_action="return_value")
    return pcii.open_dataset(out)


@pytest.mark.parametrize("format", ["hci", "events"])
def test_cameras_that_files_tell_are_not_doubted(tmp_path: Path, capsys, format) -> None:
    noise = np.random.default_rng(1).poisson(0.1, (3, 3, 48, 48))  # nothing fits, by any cameras
    counts = pcii.PhotonCounts.from_dense(noise, unit_grid(3, 3, 48, 48))
    made = pcii.save_dataset(tmp_path / "made", (counts, pcii.Views(noise[..., None], counts.grid)))
    again = imported(pcii.export_dataset(made, format, tmp_path / "out"), tmp_path / "again")
    assert again.grid == counts.grid
    assert "warning" not in capsys.readouterr().out


def without(path: Path, name: str) -> None:
    """Drop an array from an archive."""
    with zipfile.ZipFile(path) as archive:
        members = {member: archive.read(member) for member in archive.namelist() if member != f"{name}.npy"}
    with zipfile.ZipFile(path, "w") as archive:
        for member, content in members.items():
            archive.writestr(member, content)


@pytest.mark.parametrize(
    "name", ["cfa", "n", "pitch_mm", "object_names", "truth_object_id", "photon_object_id"]
)
def test_an_archive_that_lacks_an_array_is_refused(dataset: pcii.Dataset, tmp_path: Path, name: str) -> None:
    file = pcii.export_dataset(dataset, "events", tmp_path / "out") / "events.npz"
    without(file, name)
    assert name in one_sentence(lambda: import_exported(tmp_path / "out"), file)


@pytest.mark.parametrize("damage", ["truncated", "text"])
def test_a_damaged_file_is_refused(dataset: pcii.Dataset, tmp_path: Path, damage: str) -> None:
    file = tmp_path / "views.exr"
    file.write_bytes((dataset.path / "radiance" / "view_00_00.exr").read_bytes())
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2] if damage == "truncated" else b"no picture")
    one_sentence(lambda: import_exported(file), file)


def test_another_exr_file_is_refused(dataset: pcii.Dataset) -> None:
    one_view = dataset.path / "radiance" / "view_00_00.exr"
    assert "do not say which cameras" in one_sentence(lambda: import_exported(one_view), one_view)


def changed(file: Path, **changes: Any) -> Path:
    """The archive with other arrays."""
    with np.load(file) as archive:
        arrays: dict[str, Any] = dict(archive)
    np.savez(file, **arrays | changes)
    return file


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"analysis_z_mm": [-1.0]}, "z_mm: a depth must be a finite number above 0 mm"),
        ({"analysis_z_range_mm": [700, 600]}, "z_range_mm: expected two depths in mm, near and far"),
        ({"photon_budget": -1.0}, "photon_budget: expected photons, above 0"),
    ],
)
def test_depths_and_budgets_that_cannot_be_are_refused(dataset, tmp_path: Path, changes, words) -> None:
    file = changed(pcii.export_dataset(dataset, "events", tmp_path / "out") / "events.npz", **changes)
    assert words in one_sentence(lambda: import_exported(file), file)


def large_views(dataset: pcii.Dataset, root: Path) -> Path:
    """Few photons of views that are large."""
    return changed(pcii.export_dataset(dataset, "events", root) / "events.npz", height=10_000, width=10_000)


def many_photons(dataset: pcii.Dataset, root: Path) -> Path:
    """More photons in a pixel than there are rows of origins."""
    n = dataset.counts.events.n.copy()
    n[0] = 10_000_000
    return changed(pcii.export_dataset(dataset, "events", root) / "events.npz", n=n)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (large_views, "unpack to 763 MiB of memory, and at most 512"),
        (many_photons, "expected as many depths as photons"),
    ],
)
def test_what_is_too_large_is_refused_before_memory_is_taken(dataset, tmp_path: Path, make, words) -> None:
    file = make(dataset, tmp_path / "out")
    tracemalloc.start()
    message = one_sentence(lambda: import_exported(file), file)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert re.search(words, message), message
    assert peak < 8e6  # half of what the least of these would take
