"""What `simgen export` writes comes back as it was."""

import json
import re
import tracemalloc
import zipfile
from dataclasses import asdict
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
from pcii.pictures import picture_files


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


def test_parts_of_an_exr_file_come_back(dataset: pcii.Dataset, tmp_path: Path) -> None:
    folder = pcii.export_dataset(dataset, "exr", tmp_path / "out")
    found = import_exported(folder / "views.exr")
    views, counts = found.images
    assert isinstance(views, pcii.Views)
    assert isinstance(counts, pcii.PhotonCounts)
    assert views.grid == counts.grid == dataset.grid
    assert dataset.views is not None
    for k, l in np.ndindex(2, 3):
        assert np.array_equal(views.view(k, l), dataset.views.view(k, l))
        assert np.array_equal(counts.view(k, l), dataset.counts.view(k, l))
    truth, known = the_truth(found.truth), the_truth(dataset.truth)
    assert np.array_equal(truth.z_mm, known.z_mm)
    assert truth.names == known.names
    assert (found.z_mm, found.z_range_mm, found.photon_budget) == ((540,), (450, 750), 10)


@pytest.mark.parametrize("format", ["events", "exr"])
def test_objects_with_large_numbers_stay_apart(tmp_path: Path, format) -> None:
    object_id = np.arange(20).reshape(4, 5) + 10**9 - 20
    truth = Truth(np.full((4, 5), 540.0), object_id, {int(key): f"no. {key}" for key in object_id.flat})
    counts = pcii.PhotonCounts.from_dense(DENSE, GRID)
    made = pcii.save_dataset(tmp_path / "made", counts, truth)
    again = the_truth(import_exported(pcii.export_dataset(made, format, tmp_path / "out")).truth)
    assert np.array_equal(again.object_id, object_id)
    assert again.names == truth.names


def test_exr_refuses_depths_that_it_would_round(tmp_path: Path) -> None:
    truth = Truth(np.full((4, 5), 540.1), np.zeros((4, 5), int), {})
    path = pcii.save_dataset(tmp_path / "made", pcii.PhotonCounts.from_dense(DENSE, GRID), truth).path
    assert "more digits" in one_sentence(lambda: pcii.export_dataset(path, "exr", tmp_path / "out"), path)
    events = import_exported(pcii.export_dataset(path, "events", tmp_path / "events"))
    assert np.array_equal(the_truth(events.truth).z_mm, truth.z_mm)


@pytest.mark.parametrize("format", ["events", "exr"])
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


@pytest.mark.parametrize("format", ["hci", "events", "exr"])
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
    file = pcii.export_dataset(dataset, "exr", tmp_path / "out") / "views.exr"
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


def larger_parts(dataset: pcii.Dataset, root: Path) -> Path:
    """Pixels of zeros, of which its cameras have 4 x 5."""
    import OpenEXR

    root.mkdir()
    header = {"comments": json.dumps({"grid": asdict(dataset.grid)}), "compression": OpenEXR.ZIP_COMPRESSION}
    with OpenEXR.File([OpenEXR.Part(header, {"Y": np.zeros((2000, 2000), "f4")}, name="k00_l00")]) as file:
        file.write(str(root / "views.exr"))
    return root / "views.exr"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (large_views, "unpack to 763 MiB of memory, and at most 512"),
        (many_photons, "expected as many depths as photons"),
        (larger_parts, r"part k00_l00: expected \(4, 5\) pixels, got \(2000, 2000\)"),
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


def test_parts_that_unpack_to_much_are_refused(dataset, tmp_path: Path, monkeypatch) -> None:
    file = pcii.export_dataset(dataset, "exr", tmp_path / "out") / "views.exr"
    monkeypatch.setattr(picture_files, "UNPACKED_BYTES", 2000)  # 26 channels of 20 pixels are 2080 bytes
    monkeypatch.setattr(picture_files, "MOST_GROWTH", 0)
    assert "unpack to" in one_sentence(lambda: import_exported(file), file)
