"""Groups of arrays: exact, labelled, and safe to read when a stranger wrote them."""

import json

import numpy as np
import pytest
import zarr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from stored_datasets import flip_a_bit, one_sentence

from pcii.store import Label, list_files, read_array, read_part, write_arrays_safely

Y = Label(("step",), "three numbers", "mm")
METADATA = "zarr.json"
MAP = Label(("row", "col"), "a map")

shapes = hnp.array_shapes(min_dims=0, max_dims=5, min_side=0, max_side=4)
dtypes = st.sampled_from([np.int32, np.int64, np.uint8, np.uint16, np.float32, np.float64, np.bool_])


@given(array=dtypes.flatmap(lambda dtype: hnp.arrays(dtype, shapes)))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_arrays_of_any_shape_come_back_to_the_bit(tmp_path, array):
    folder = tmp_path / "a.zarr"  # written over, again and again
    x = Label(tuple(f"axis_{n}" for n in range(array.ndim)), "anything")
    write_arrays_safely(folder, {"x": array, "y": np.arange(3)}, {"x": x, "y": Y}, {"why": "test"})
    group = zarr.open_group(folder, mode="r", zarr_format=3)
    assert sorted(group.array_keys()) == ["x", "y"]
    assert dict(group.attrs) == {"why": "test"}
    ours = read_array(
        tmp_path, "a.zarr/x", read_part(tmp_path, list_files(tmp_path, ["a.zarr"]), "a.zarr/x"), x, {}
    )
    for stored in (np.asarray(group["x"][...]), ours):  # type: ignore[index]
        assert (stored.dtype, stored.shape) == (array.dtype, array.shape)
        assert stored.tobytes() == array.tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["a.zarr"]


@pytest.fixture
def stored(tmp_path):
    """A map of 3 x 4 on disk, and a way to read it with the list of files as it is then."""
    write_arrays_safely(tmp_path / "a.zarr", {"x": np.zeros((3, 4))}, {"x": MAP})

    def read(**sizes):
        files = read_part(tmp_path, list_files(tmp_path, ["a.zarr"]), "a.zarr/x")
        return read_array(tmp_path, "a.zarr/x", files, MAP, sizes)

    return tmp_path / "a.zarr" / "x", read


def test_shapes_are_the_grids_chunks_of_zeros_are_there_and_none_may_lack_or_be_damaged(stored):
    path, read = stored
    np.testing.assert_array_equal(read(row=3, col=4), np.zeros((3, 4)))
    assert "expected a shape of (3, 5), got (3, 4)" in one_sentence(lambda: read(row=3, col=5), path)
    chunk = next(file for file in (path / "c").rglob("*") if file.is_file())
    flip_a_bit(chunk, 70)
    assert "cannot be read" in one_sentence(read, path)
    chunk.unlink()
    assert "expected 1 chunks, the manifest lists 0" in one_sentence(read, path)


CHANGES = [
    {"shape": [200_000_000, 4]},
    {"data_type": "object"},
    {"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [1 << 30, 1]}}},
    {"codecs": [{"name": "numcodecs.pickle"}]},
]


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_metadata_that_are_not_ours_are_refused_in_one_sentence(stored, change):
    path, read = stored
    metadata = json.loads((path / METADATA).read_text())
    (path / METADATA).write_text(json.dumps(metadata | change))
    assert "cannot be read" in one_sentence(read, path)
