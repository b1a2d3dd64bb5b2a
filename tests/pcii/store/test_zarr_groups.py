"""Groups of arrays: exact, labelled, and safe to read when a stranger wrote them."""

import json
import os

import numcodecs.zstd
import numpy as np
import pytest
import zarr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from property_settings import at_least
from stored_datasets import one_sentence

from pcii.store.file_list import list_files
from pcii.store.zarr_groups import (
    CHUNK_ELEMENTS,
    METADATA,
    chunk_shape,
    read_array,
    unpacked_bytes,
    write_arrays_safely,
)
from pcii.types.array_labels import Label

Y = Label(("step",), "three numbers", "mm")
MAP = Label(("row", "col"), "a map")

shapes = hnp.array_shapes(min_dims=0, max_dims=5, min_side=0, max_side=4)
dtypes = st.sampled_from([np.int32, np.int64, np.uint8, np.uint16, np.float32, np.float64, np.bool_])


@given(array=dtypes.flatmap(lambda dtype: hnp.arrays(dtype, shapes)))
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_arrays_of_any_shape_come_back_to_the_bit(tmp_path, array):
    folder = tmp_path / "a.zarr"  # written over, again and again
    x = Label(tuple(f"axis_{n}" for n in range(array.ndim)), "anything")
    write_arrays_safely(folder, {"x": array, "y": np.arange(3)}, {"x": x, "y": Y}, {"why": "test"})
    group = zarr.open_group(folder, mode="r", zarr_format=3)
    assert sorted(group.array_keys()) == ["x", "y"]
    assert dict(group.attrs) == {"why": "test"}
    ours = read_array(tmp_path, "a.zarr/x", list_files(tmp_path, ["a.zarr"]), x, {}, "again")
    for stored in (np.asarray(group["x"][...]), ours):  # type: ignore[index]
        assert (stored.dtype, stored.shape) == (array.dtype, array.shape)
        assert stored.tobytes() == array.tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["a.zarr"]


def test_an_array_says_what_it_is(tmp_path):
    write_arrays_safely(tmp_path / "a.zarr", {"y": np.arange(3)}, {"y": Y})
    stored = zarr.open_array(tmp_path / "a.zarr" / "y", mode="r")
    assert stored.metadata.dimension_names == ("step",)  # type: ignore[union-attr]
    conventional = {"units": "mm", "long_name": "three numbers"}
    assert dict(stored.attrs) == {"unit": "mm", "meaning": "three numbers"} | conventional


def test_arrays_without_the_names_of_the_conventions_are_read(tmp_path):
    write_arrays_safely(tmp_path / "a.zarr", {"y": np.arange(3)}, {"y": Y})
    path = tmp_path / "a.zarr" / "y" / METADATA
    metadata = json.loads(path.read_text())
    metadata["attributes"] = {"unit": "mm", "meaning": "three numbers"}
    path.write_text(json.dumps(metadata))
    found = read_array(tmp_path, "a.zarr/y", list_files(tmp_path, ["a.zarr"]), Y, {}, "again")
    np.testing.assert_array_equal(found, [0, 1, 2])


@given(st.lists(st.integers(0, 3000), max_size=5).map(tuple))
@at_least(200)
def test_chunks_fit_the_array_and_the_limit(shape):
    chunks = chunk_shape(shape)
    assert len(chunks) == len(shape)
    assert all(1 <= chunk <= max(size, 1) for chunk, size in zip(chunks, shape, strict=True))
    assert np.prod(chunks, dtype=object) <= CHUNK_ELEMENTS


def test_one_view_of_the_paper_is_one_chunk():
    assert chunk_shape((10, 10, 1024, 1024)) == (1, 1, 1024, 1024)


def test_a_failed_write_of_arrays_leaves_the_old_ones_and_no_scraps(tmp_path, monkeypatch):
    folder = tmp_path / "a.zarr"
    write_arrays_safely(folder, {"y": np.arange(4)}, {"y": Y})

    def disk_is_full(handle):
        raise OSError("disk is full")

    monkeypatch.setattr(os, "fsync", disk_is_full)
    with pytest.raises(OSError, match=r"disk is full"):
        write_arrays_safely(folder, {"y": np.zeros(4)}, {"y": Y})
    assert [p.name for p in tmp_path.iterdir()] == ["a.zarr"]
    np.testing.assert_array_equal(zarr.open_group(folder, mode="r")["y"][...], np.arange(4))  # type: ignore[index]


# Arrays of strangers


@pytest.fixture
def stored(tmp_path):
    """A map of 3 x 4 on disk, and a way to read it with the list of files as it is then."""
    write_arrays_safely(tmp_path / "a.zarr", {"x": np.zeros((3, 4))}, {"x": MAP})

    def read(**sizes):
        files = list_files(tmp_path, ["a.zarr"])
        return read_array(tmp_path, "a.zarr/x", files, MAP, sizes, "make it again")

    return tmp_path / "a.zarr" / "x", read


def test_chunks_of_zeros_are_there_and_none_may_lack(stored):
    path, read = stored
    np.testing.assert_array_equal(read(row=3, col=4), np.zeros((3, 4)))
    next(file for file in (path / "c").rglob("*") if file.is_file()).unlink()
    assert "chunks are expected" in one_sentence(read, path)


def test_a_shape_that_the_camera_grid_does_not_have_is_refused(stored):
    path, read = stored
    assert "shape: expected (3, 5), got (3, 4)" in one_sentence(lambda: read(row=3, col=5), path / METADATA)


CHANGES = [
    ({"shape": [200_000_000, 4]}, "chunk_grid: "),
    ({"shape": [3]}, "shape: "),
    ({"shape": [3, -4]}, "shape: "),
    ({"shape": [3, True]}, "shape: "),
    ({"shape": "34"}, "shape: "),
    ({"data_type": "object"}, "data_type: "),
    ({"data_type": ["float64"]}, "data_type: "),
    ({"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [1 << 30, 1]}}}, "chunk_grid: "),
    ({"codecs": [{"name": "numcodecs.pickle"}]}, "codecs: "),
    ({"codecs": 3}, "codecs: "),
    ({"node_type": "group"}, "node_type: "),
    ({"zarr_format": 2}, "zarr_format: "),
    ({"storage_transformers": [{"name": "x"}]}, "storage_transformers: "),
    ({"chunk_key_encoding": {"name": "v2"}}, "chunk_key_encoding: "),
]


@pytest.mark.parametrize(("change", "words"), CHANGES, ids=[str(change) for change, _ in CHANGES])
def test_metadata_that_are_not_ours_are_refused_before_zarr_reads_them(stored, change, words, monkeypatch):
    path, read = stored
    metadata = json.loads((path / METADATA).read_text())
    (path / METADATA).write_text(json.dumps(metadata | change))
    monkeypatch.setattr(zarr, "open_array", lambda *_, **__: pytest.fail("read by Zarr"))
    assert words in one_sentence(read, path / METADATA)


ODD = [{"fill_value": value} for value in ("NaN of another kind", [1], {"a": 1})]
ODD += [{"codecs": [{"name": "bytes"}, {"name": "zstd", "configuration": {"\n": 3}}, {"name": "crc32c"}]}]


@pytest.mark.parametrize("odd", ODD, ids=ascii)
def test_what_zarr_cannot_make_sense_of_is_one_sentence(stored, odd):
    path, read = stored
    metadata = json.loads((path / METADATA).read_text())
    (path / METADATA).write_text(json.dumps(metadata | odd))
    assert "make it again" in one_sentence(read, path)


def test_a_chunk_that_unpacks_to_more_than_it_may_is_refused(stored):
    path, read = stored
    bomb = numcodecs.zstd.Zstd().encode(bytes(1 << 26))
    assert len(bomb) < 1 << 13
    chunk = next(file for file in (path / "c").rglob("*") if file.is_file())
    chunk.write_bytes(bytes(bomb) + b"crc.")
    assert "not a chunk of 96 bytes" in one_sentence(read, chunk)


@pytest.mark.parametrize("size", [0, 1, 255, 256, 257, 65_791, 65_792, 1 << 20])
def test_the_unpacked_size_is_that_of_the_content(tmp_path, size):
    (tmp_path / "chunk").write_bytes(bytes(numcodecs.zstd.Zstd().encode(os.urandom(size))))
    assert unpacked_bytes(tmp_path / "chunk") == size


NO_FRAMES = [b"", b"\x28\xb5\x2f\xfd", b"not a frame at all", b"\x28\xb5\x2f\xfd\x00abcdef"]


@pytest.mark.parametrize("content", NO_FRAMES)
def test_a_header_without_a_size_has_none(tmp_path, content):
    (tmp_path / "chunk").write_bytes(content)
    assert unpacked_bytes(tmp_path / "chunk") is None
