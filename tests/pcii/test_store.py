import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from twins import unit_grid

from pcii import store
from pcii.dataset import open_dataset
from pcii.errors import InputError
from pcii.photon_counts import PhotonCounts
from pcii.store import (
    COUNTS,
    FORMAT,
    FORMAT_VERSION,
    MANIFEST,
    RADIANCE,
    TRUTH,
    check_file,
    list_files,
    radiance_name,
    read_exr,
    read_manifest,
    sweep_temporaries,
    write_arrays_safely,
    write_bytes_safely,
    write_exr_safely,
    write_json_safely,
)

GRID = unit_grid(2, 3, 4, 5)
Z_MM = np.where(np.arange(20).reshape(4, 5) % 3, 540.0, np.inf)
IDS = np.where(np.isfinite(Z_MM), 1, 0)
DENSE = np.random.default_rng(0).poisson(0.5, size=GRID.shape_KLHW)


def make_dataset(root: Path, *, sparse: bool = True, **overrides: Any) -> Path:
    """A finished dataset of counts, truth and radiance, as `simgen` lays it out."""
    root.mkdir()
    k, l, i, j = np.nonzero(DENSE)
    events = {"k": k, "l": l, "i": i, "j": j, "n": DENSE[k, l, i, j]}
    write_arrays_safely(root / COUNTS, events if sparse else {"dense": DENSE}, {})
    write_arrays_safely(root / TRUTH, {"z_mm": Z_MM, "object_id": IDS}, {})
    for a, b in np.ndindex(GRID.rows, GRID.cols):
        write_exr_safely(root / radiance_name(a, b), np.full((4, 5, 3), 3 * a + b, dtype=np.float32))
    manifest = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "grid": {
            name: getattr(GRID, name)
            for name in ("rows", "cols", "pitch_mm", "focal_mm", "pixel_mm", "height", "width")
        },
        "cfa": "GRBG",
        "objects": {"1": "ball"},
        "radiance_channels": 3,
        "files": list_files(root, [COUNTS, TRUTH, RADIANCE]),
    }
    write_json_safely(root / MANIFEST, {**manifest, **overrides})
    return root


def one_sentence(action: Callable[[], object], path: Path) -> str:
    """The message of the `InputError` that `action` raises, checked to be one line that names the path."""
    with pytest.raises(InputError) as caught:
        action()
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def largest_file(root: Path, part: str) -> Path:
    return max((p for p in (root / part).rglob("*") if p.is_file()), key=lambda p: (p.stat().st_size, p.name))


def flip_a_bit(path: Path, bit: int) -> None:
    content = bytearray(path.read_bytes())
    content[bit // 8 % len(content)] ^= 1 << bit % 8
    path.write_bytes(content)


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
    assert "no counts" in one_sentence(lambda: dataset.counts, root)


# Damage


@pytest.mark.parametrize("part", [COUNTS, TRUTH, RADIANCE])
def test_a_truncated_file_is_found_on_opening(tmp_path, part):
    root = make_dataset(tmp_path / "d")
    file = largest_file(root, part)
    file.write_bytes(file.read_bytes()[:-1])
    assert "truncated" in one_sentence(lambda: open_dataset(root), file)


@pytest.mark.parametrize("part", [COUNTS, TRUTH, RADIANCE])
def test_a_missing_file_is_found_on_opening(tmp_path, part):
    root = make_dataset(tmp_path / "d")
    file = largest_file(root, part)
    file.unlink()  # a deleted Zarr chunk would read as zeros
    assert "missing" in one_sentence(lambda: open_dataset(root), file)


@pytest.mark.parametrize("bit", [0, 77, 1234, 4321])
@pytest.mark.parametrize(
    ("part", "read"),
    [(COUNTS, lambda d: d.counts), (TRUTH, lambda d: d.truth), (RADIANCE, lambda d: d.views.view(1, 2))],
)
def test_a_flipped_bit_is_found_on_reading(tmp_path, part, read, bit):
    root = make_dataset(tmp_path / "d")
    file = root / radiance_name(1, 2) if part == RADIANCE else largest_file(root, part)
    flip_a_bit(file, bit)
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
    check_file(tmp_path, "a.bin", entry, content=False)
    one_sentence(lambda: check_file(tmp_path, "a.bin", entry, content=True), tmp_path / "a.bin")


def test_a_file_that_the_manifest_does_not_list_is_refused(tmp_path):
    root = make_dataset(tmp_path / "d")
    assert "lists no other.bin" in one_sentence(lambda: open_dataset(root).check("other.bin"), root)


# Manifests


def test_no_folder_and_no_manifest_are_told_apart(tmp_path):
    assert "no such dataset folder" in one_sentence(lambda: open_dataset(tmp_path / "no"), tmp_path / "no")
    assert "not a finished dataset" in one_sentence(lambda: open_dataset(tmp_path), tmp_path)


@pytest.mark.parametrize("content", [b"", b"{", b'{"format": ', b"\xff\xfe\x00", b"not json"])
def test_a_manifest_that_is_not_json_is_refused(tmp_path, content):
    (tmp_path / MANIFEST).write_bytes(content)
    assert "not valid JSON" in one_sentence(lambda: read_manifest(tmp_path), tmp_path / MANIFEST)


@pytest.mark.parametrize("content", ["[]", "3", "null", "{}", '{"format": "something else"}'])
def test_a_manifest_of_something_else_is_refused(tmp_path, content):
    (tmp_path / MANIFEST).write_text(content)
    assert "not the manifest" in one_sentence(lambda: read_manifest(tmp_path), tmp_path / MANIFEST)


@pytest.mark.parametrize("version", [0, 2, None, "1"])
def test_a_format_version_of_another_release_is_refused(tmp_path, version):
    root = make_dataset(tmp_path / "d", format_version=version)
    message = one_sentence(lambda: open_dataset(root), root / MANIFEST)
    assert repr(version) in message


@pytest.mark.parametrize("name", ["grid", "cfa", "files"])
def test_a_manifest_that_lacks_a_field_is_refused_by_its_name(tmp_path, name):
    root = make_dataset(tmp_path / "d")
    manifest = json.loads((root / MANIFEST).read_text())
    del manifest[name]
    write_json_safely(root / MANIFEST, manifest)
    assert name in one_sentence(lambda: open_dataset(root), root / MANIFEST)


def test_a_manifest_with_a_bad_grid_or_pattern_is_refused(tmp_path):
    root = make_dataset(tmp_path / "d", cfa="GRGB")
    with pytest.raises(InputError, match=r"^cfa: "):
        open_dataset(root)
    manifest = json.loads((root / MANIFEST).read_text())
    manifest.update(cfa="GRBG", grid={**manifest["grid"], "rows": 0})
    write_json_safely(root / MANIFEST, manifest)
    with pytest.raises(InputError, match=r"^rows: "):
        open_dataset(root)


# Arrays

shapes = hnp.array_shapes(min_dims=0, max_dims=5, min_side=0, max_side=4)
dtypes = st.sampled_from([np.int32, np.int64, np.uint8, np.uint16, np.float32, np.float64, np.bool_])


@given(array=dtypes.flatmap(lambda dtype: hnp.arrays(dtype, shapes)))
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_arrays_of_any_shape_come_back_to_the_bit(tmp_path, array):
    folder = tmp_path / "a.zarr"  # written over, again and again
    write_arrays_safely(folder, {"x": array, "y": np.arange(3)}, {"why": "test"})
    group = zarr.open_group(folder, mode="r", zarr_format=3)
    stored = np.asarray(group["x"][...])  # type: ignore[index]
    assert (stored.dtype, stored.shape) == (array.dtype, array.shape)
    assert stored.tobytes() == array.tobytes()
    assert sorted(group.array_keys()) == ["x", "y"]
    assert dict(group.attrs) == {"why": "test"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.zarr"]


@given(st.lists(st.integers(0, 3000), max_size=5).map(tuple))
@settings(max_examples=200, deadline=None)
def test_chunks_fit_the_array_and_the_limit(shape):
    chunks = store._chunks(shape)
    assert len(chunks) == len(shape)
    assert all(1 <= chunk <= max(size, 1) for chunk, size in zip(chunks, shape, strict=True))
    assert np.prod(chunks, dtype=object) <= store.CHUNK_ELEMENTS


def test_one_view_of_the_paper_is_one_chunk():
    assert store._chunks((10, 10, 1024, 1024)) == (1, 1, 1024, 1024)


def test_a_failed_write_of_arrays_leaves_the_old_ones_and_no_scraps(tmp_path, monkeypatch):
    folder = tmp_path / "a.zarr"
    write_arrays_safely(folder, {"x": np.arange(4)}, {})
    monkeypatch.setattr(os, "fsync", disk_is_full)
    with pytest.raises(OSError, match=r"disk is full"):
        write_arrays_safely(folder, {"x": np.zeros(4)}, {})
    assert [p.name for p in tmp_path.iterdir()] == ["a.zarr"]
    np.testing.assert_array_equal(zarr.open_group(folder, mode="r")["x"][...], np.arange(4))  # type: ignore[index]


# Files


def disk_is_full(handle: int) -> None:
    raise OSError("disk is full")


def test_a_file_is_whole_under_its_name_and_leaves_no_temporary(tmp_path):
    path = tmp_path / "new" / "folder" / "a.bin"
    for content in (b"", b"first", b"second, longer"):
        write_bytes_safely(path, content)
        assert path.read_bytes() == content
        assert [p.name for p in path.parent.iterdir()] == ["a.bin"]
    assert path.stat().st_mode & 0o777 == 0o644


def test_a_failed_write_leaves_the_old_content_and_no_temporary(tmp_path, monkeypatch):
    path = tmp_path / "a.bin"
    write_bytes_safely(path, b"old")
    monkeypatch.setattr(os, "fsync", disk_is_full)
    with pytest.raises(OSError, match=r"disk is full"):
        write_bytes_safely(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_json_refuses_what_json_cannot_say_and_keeps_the_old_file(tmp_path, bad):
    path = tmp_path / "a.json"
    write_json_safely(path, {"z_mm": 540})
    with pytest.raises(ValueError, match=r"JSON compliant"):
        write_json_safely(path, {"z_mm": bad})
    assert json.loads(path.read_text()) == {"z_mm": 540}


def test_a_killed_runs_scraps_are_swept_and_the_rest_is_kept(tmp_path):
    root = make_dataset(tmp_path / "d")
    (root / ".manifest.json.x1.tmp").write_bytes(b"half")
    (root / f".{COUNTS}.x2.tmp").mkdir()
    (root / f".{COUNTS}.x2.tmp" / "chunk").write_bytes(b"half")
    (root / RADIANCE / ".view_00_00.exr.7.tmp").write_bytes(b"half")
    sweep_temporaries(root)
    assert [p.name for p in root.rglob("*.tmp")] == []
    assert open_dataset(root).counts.total == DENSE.sum()


def test_files_are_listed_by_their_place_in_the_dataset(tmp_path):
    write_bytes_safely(tmp_path / "b" / "c.bin", b"abc")
    write_bytes_safely(tmp_path / "a.bin", b"")
    listed = list_files(tmp_path, ["b", "a.bin"])
    # The SHA-256 of nothing and of "abc" are those of the standard's examples.
    assert listed["a.bin"]["bytes"] == 0
    assert listed["a.bin"]["sha256"].startswith("e3b0c44298fc1c14")
    assert listed["b/c.bin"]["bytes"] == 3
    assert listed["b/c.bin"]["sha256"].startswith("ba7816bf8f01cfea")
    assert len(listed) == 2


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
