"""Datasets on disk: what is read back, and which faults are errors."""

from pathlib import Path

import numpy as np
import pytest
import xarray
import zarr
from stored_datasets import (
    DENSE,
    GRID,
    IDS,
    Z_MM,
    flip_a_bit,
    largest_file,
    make_dataset,
    one_sentence,
)

from pcii.base.safe_files import write_bytes_safely
from pcii.store.dataset import open_dataset
from pcii.store.dataset_layout import (
    COUNTS,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    radiance_name,
    read_exr,
    read_manifest,
    write_exr_safely,
    write_manifest,
)
from pcii.store.file_list import check_file, list_files
from pcii.store.zarr_groups import new_array
from pcii.types.array_labels import COUNTS_LABELS
from pcii.types.photon_counts import PhotonCounts

# A dataset, read back


@pytest.mark.parametrize("sparse", [True, False])
def test_a_dataset_is_read_as_it_was_written(tmp_path, sparse):
    dataset = open_dataset(make_dataset(tmp_path / "d", sparse=sparse))
    assert dataset.grid == GRID
    assert dataset.counts.is_sparse == sparse
    expected = PhotonCounts.from_dense(DENSE, GRID, cfa="GRBG").events
    for name in "klijn":
        np.testing.assert_array_equal(getattr(dataset.counts.events, name), getattr(expected, name))
    assert dataset.truth is not None
    np.testing.assert_array_equal(dataset.truth.z_mm, Z_MM)
    np.testing.assert_array_equal(dataset.truth.object_id, IDS)
    assert dataset.truth.names == {1: "ball"}
    assert dataset.views is not None
    np.testing.assert_array_equal(dataset.views.view(1, 2), np.full((4, 5, 3), 5.0))


def test_what_a_dataset_does_not_have_is_none_or_refused(tmp_path):
    root = make_dataset(tmp_path / "d", files={})
    dataset = open_dataset(root)
    assert dataset.truth is None
    assert dataset.views is None
    assert "no photon counts" in one_sentence(lambda: dataset.counts, root)


@pytest.mark.parametrize(
    ("part", "sparse", "axes"),
    [
        (COUNTS, True, {"event"}),
        (COUNTS, False, {"camera_row", "camera_col", "row", "col"}),
        (PHOTON_TRUTH, True, {"photon"}),
        (TRUTH, True, {"row", "col"}),
    ],
)
def test_xarray_opens_every_group_with_named_axes_and_units(tmp_path, part, sparse, axes):
    opened = xarray.open_zarr(make_dataset(tmp_path / "d", sparse=sparse) / part, consolidated=False)
    assert set(opened.sizes) == axes
    assert all(set(array.attrs) == {"unit", "meaning", "units", "long_name"} for array in opened.values())


# Damage


def cut(file):
    file.write_bytes(file.read_bytes()[:-1])


@pytest.mark.parametrize("part", [COUNTS, TRUTH, RADIANCE])
@pytest.mark.parametrize(("damage", "words"), [(cut, "truncated"), (Path.unlink, "missing")])
def test_a_file_that_is_cut_or_lost_is_found_on_opening(tmp_path, part, damage, words):
    root = make_dataset(tmp_path / "d")
    file = largest_file(root, part)
    damage(file)  # a deleted Zarr chunk would read as zeros
    assert words in one_sentence(lambda: open_dataset(root), file)


@pytest.mark.parametrize(
    ("part", "read"),
    [(COUNTS, lambda d: d.counts), (TRUTH, lambda d: d.truth), (RADIANCE, lambda d: d.views.view(1, 2))],
)
def test_a_flipped_bit_is_found_on_reading(tmp_path, part, read):
    root = make_dataset(tmp_path / "d")
    file = root / radiance_name(1, 2) if part == RADIANCE else largest_file(root, part)
    flip_a_bit(file, 1234)
    dataset = open_dataset(root)
    assert "SHA-256" in one_sentence(lambda: read(dataset), file)


def test_damage_to_one_part_leaves_the_others_readable(tmp_path):
    root = make_dataset(tmp_path / "d")
    flip_a_bit(largest_file(root, TRUTH), 100)
    assert open_dataset(root).counts.total == DENSE.sum()


def test_checking_without_content_trusts_the_size(tmp_path):
    write_bytes_safely(tmp_path / "a.bin", b"abcd")
    entry = list_files(tmp_path, ["a.bin"])["a.bin"]
    flip_a_bit(tmp_path / "a.bin", 3)
    check_file(tmp_path, "a.bin", entry, "again", content=False)
    one_sentence(lambda: check_file(tmp_path, "a.bin", entry, "again", content=True), tmp_path / "a.bin")


def test_a_file_that_the_manifest_does_not_list_is_refused(tmp_path):
    root = make_dataset(tmp_path / "d")
    assert "lists no other.bin" in one_sentence(lambda: open_dataset(root).check("other.bin"), root)


# Manifests


@pytest.mark.parametrize("name", ["grid", "cfa", "files"])
def test_a_manifest_that_lacks_a_field_is_refused_by_its_name(tmp_path, name):
    root = make_dataset(tmp_path / "d")
    manifest = read_manifest(root)
    del manifest[name]
    write_manifest(root, manifest)
    assert f"{name}: " in one_sentence(lambda: open_dataset(root), root / MANIFEST)


ENTRY = {"bytes": 1, "sha256": "0" * 64}
WRONG = [
    ({"cfa": "GRGB"}, "cfa: "),
    ({"grid": {"rows": 1}}, "grid.cols: "),
    ({"grid": 3}, "grid: "),
    ({"objects": {"one": "ball"}}, "objects.one: "),
    ({"objects": {"1": 3}}, "objects.1: "),
    ({"objects": {"1\n": "ball"}}, "objects.1"),
    ({"analysis": {"z_mm": [-5.0]}}, "analysis.z_mm.0: "),
    ({"analysis": {"z_range_mm": [5.0]}}, "analysis.z_range_mm: "),
    ({"recipe": {"photons": {"nested": ["few"]}}}, "recipe.photons.nested.0: "),
    ({"radiance_channels": 2}, "radiance_channels: "),
    ({"timings_s": {"truth": "long"}}, "timings_s.truth: "),
    ({"title": ["a"]}, "title: "),
    ({"files": []}, "files: "),
    ({"files": {"../secret": ENTRY}}, "a path inside the folder"),
    ({"files": {"/etc/passwd": ENTRY}}, "a path inside the folder"),
    ({"files": {"a\0b": ENTRY}}, "a path inside the folder"),
    ({"files": {"a": ENTRY | {"bytes": -1}}}, "files.a.bytes: "),
    ({"files": {"a": ENTRY | {"sha256": "no"}}}, "files.a.sha256: "),
    ({"files": {"a": {}}}, "files.a.bytes: "),
]


@pytest.mark.parametrize(("members", "words"), WRONG, ids=[ascii(members) for members, _ in WRONG])
def test_a_wrong_member_of_a_manifest_is_named(tmp_path, members, words):
    root = make_dataset(tmp_path / "d", **members)
    assert words in one_sentence(lambda: open_dataset(root), root / MANIFEST)


def test_what_no_manifest_lists_is_not_read(tmp_path):
    root = make_dataset(tmp_path / "d")
    group = zarr.open_group(root / COUNTS, mode="a", zarr_format=3)
    new_array(group, "dense", DENSE.shape, DENSE.dtype, COUNTS_LABELS["dense"])[...] = DENSE + 7
    counts = open_dataset(root).counts
    assert counts.is_sparse
    assert counts.total == DENSE.sum()


def test_radiance_of_unknown_channels_is_refused(tmp_path):
    root = make_dataset(tmp_path / "d", radiance_channels=None)
    dataset = open_dataset(root)
    assert dataset.counts.total == DENSE.sum()
    assert "radiance_channels: missing" in one_sentence(lambda: dataset.views, root / MANIFEST)


def test_radiance_of_another_size_is_refused_by_its_header(tmp_path):
    root = make_dataset(tmp_path / "d")
    wrong = root / radiance_name(1, 2)
    write_exr_safely(wrong, np.zeros((40, 50, 3), dtype=np.float32))
    manifest = read_manifest(root)
    write_manifest(root, manifest | {"files": list_files(root, [COUNTS, TRUTH, RADIANCE])})
    views = open_dataset(root).views
    assert views is not None
    assert "expected an image (4, 5, 3)" in one_sentence(lambda: views.view(1, 2), wrong)


# Radiance


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("size", [(1, 1), (3, 7)])
def test_radiance_comes_back_in_its_channels_and_in_single_precision(tmp_path, channels, size):
    image = np.random.default_rng(0).random((*size, channels)).astype(np.float32)
    image[0, 0, 0] = 1e6  # beyond half precision
    write_exr_safely(tmp_path / "a.exr", image)
    again = read_exr(tmp_path / "a.exr")
    assert again.dtype == np.float32
    np.testing.assert_array_equal(again, image)
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("content", [b"", b"not an image", b"v/1\x01" + bytes(50)])
def test_what_is_no_exr_is_refused(tmp_path, content):
    (tmp_path / "a.exr").write_bytes(content)
    assert "cannot be read" in one_sentence(lambda: read_exr(tmp_path / "a.exr"), tmp_path / "a.exr")
