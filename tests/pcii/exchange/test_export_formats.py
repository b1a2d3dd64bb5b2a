"""What is exported is read by programs that know nothing of this package, and nothing is half written."""

import json
import shutil
import tarfile
from dataclasses import asdict

import numpy as np
import pytest
from stored_datasets import DENSE, GRID, IDS, Z_MM, flip_a_bit, largest_file, make_dataset, one_sentence

import pcii
from pcii.store import (
    COLLECTION_FOLDER,
    COUNTS,
    MANIFEST,
    RADIANCE,
    TRUTH,
    index_row,
    read_manifest,
    write_index,
)

FORMATS = ("hci", "nerfstudio", "photoncube", "events")


def test_events_are_read_by_numpy_alone(tmp_path):
    data = make_dataset(tmp_path / "data", frames=8)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "precious.txt").write_text("mine")
    for folder in (tmp_path / "full", data / "export"):
        one_sentence(lambda folder=folder: pcii.export_dataset(data, "events", folder), folder)
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["precious.txt"]
    out = pcii.export_dataset(data, "events", tmp_path / "new" / "folder")
    assert [path.name for path in out.iterdir()] == ["events.npz"]
    with np.load(out / "events.npz", allow_pickle=False) as stored:
        arrays = dict(stored)
    counts = np.zeros(GRID.shape_KLHW, dtype=int)
    np.add.at(counts, tuple(arrays[name] for name in "klij"), arrays["n"])
    np.testing.assert_array_equal(counts, DENSE)
    grid = {name: arrays[name].tolist() for name in asdict(GRID)}
    assert grid == json.loads(json.dumps(asdict(GRID)))
    scalars = {name: arrays[name].item() for name in ("cfa", "frames", "bits", "photon_budget")}
    assert scalars == {"cfa": "GRBG", "frames": 8, "bits": 1, "photon_budget": 10}
    np.testing.assert_array_equal(arrays["frame"], np.concatenate([np.arange(n) for n in arrays["n"]]))
    assert (arrays["analysis_z_mm"], arrays["analysis_z_range_mm"].tolist()) == ([540], [450, 750])
    np.testing.assert_array_equal(arrays["truth_z_mm"], Z_MM)
    np.testing.assert_array_equal(arrays["truth_object_id"], IDS)
    assert arrays["object_keys"].tolist() == [1]
    assert arrays["object_names"].tolist() == ["ball"]
    assert arrays["photon_z_mm"].tolist() == [540.0] * DENSE.sum()


@pytest.mark.parametrize(
    ("format", "kept"), [("hci", [TRUTH]), ("nerfstudio", [TRUTH]), ("events", [TRUTH, RADIANCE])]
)
def test_a_dataset_that_lacks_what_is_needed_is_refused(tmp_path, format, kept):
    files = pcii.open_dataset(make_dataset(tmp_path / "whole")).manifest["files"]
    part = {name: entry for name, entry in files.items() if name.split("/")[0] in kept}
    data = make_dataset(tmp_path / "data", files=part)
    one_sentence(lambda: pcii.export_dataset(data, format, tmp_path / "out"), data)
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def collection(tmp_path_factory):
    """Two datasets, by their seeds."""
    root = tmp_path_factory.mktemp("collections") / "sweep"
    root.mkdir()
    rows = []
    for seed in (1, 2):
        recipe = {"scene": "two", "seed": seed, "photons": {"scope": "view", "budget": 10.0, "nested": []}}
        path = make_dataset(root / f"seed_{seed}", frames=8, recipe=recipe, identity=f"no. {seed}")
        rows.append(index_row(path.name, {"seed": seed}, read_manifest(path), path / MANIFEST))
    COLLECTION_FOLDER.write(root, {"fields": ["seed"]})
    write_index(root, rows)
    return root


def contents(root):
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.mark.parametrize("format", FORMATS)
def test_datasets_of_a_collection_have_the_same_bytes_as_each_by_itself(collection, tmp_path, format):
    out = pcii.export_dataset(collection, format, tmp_path / "out", budget=10)
    assert sorted(path.name for path in out.iterdir()) == ["seed_1", "seed_2"]
    single = pcii.export_dataset(collection / "seed_2", format, tmp_path / "single" / "seed_2")
    assert contents(out / "seed_2") == contents(single)
    part = pcii.export_dataset(pcii.open_collection(collection)[1:], format, tmp_path / "part")
    assert contents(part) == contents(single.parent)


def test_shards_have_every_dataset_once_with_its_row(collection, tmp_path):
    out = pcii.export_dataset(collection, "webdataset", tmp_path / "out", budget=10)
    rows = pcii.open_collection(collection).rows
    with tarfile.open(out / "all-000000.tar") as shard:
        shard.extractall(tmp_path / "members", filter="data")
    contents = {path.name: path.read_bytes() for path in (tmp_path / "members").iterdir()}
    assert sorted(contents) == [f"{n:06d}.{kind}" for n in range(len(rows)) for kind in ("json", "npz")]
    for n, row in enumerate(rows):
        assert json.loads(contents[f"{n:06d}.json"])["path"] == row["path"]
        single = pcii.export_dataset(collection / row["path"], "events", tmp_path / row["path"], budget=10)
        assert contents[f"{n:06d}.npz"] == (single / "events.npz").read_bytes()
    again = pcii.export_dataset(collection, "webdataset", tmp_path / "again", budget=10)
    assert (again / "all-000000.tar").read_bytes() == (out / "all-000000.tar").read_bytes()
    single = collection / "seed_2"
    one_sentence(lambda: pcii.export_dataset(single, "webdataset", tmp_path / "one"), single)


def test_a_collection_is_exported_as_a_whole_or_not_at_all(collection, tmp_path):
    collection = shutil.copytree(collection, tmp_path / "sweep")
    one_sentence(lambda: pcii.export_dataset(collection, "events", collection / "out"), collection / "out")
    damaged = largest_file(collection / "seed_2", COUNTS)
    flip_a_bit(damaged, 80)
    one_sentence(lambda: pcii.export_dataset(collection, "events", tmp_path / "out"), damaged)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep"]
    write_index(collection, [])
    message = one_sentence(lambda: pcii.export_dataset(collection, "hci", tmp_path / "out"), collection)
    assert "no finished dataset" in message
