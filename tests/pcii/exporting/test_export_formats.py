"""What is exported comes back by readers that know nothing of this package, and nothing is half written."""

import json
import os
from dataclasses import asdict

import imageio.v3
import numpy as np
import OpenEXR
import png
import pytest
from PIL import Image
from rendered_planes import view, write_planes
from stored_datasets import DENSE, GRID, IDS, Z_MM, flip_a_bit, largest_file, make_dataset, one_sentence
from twins import unit_grid

import pcii
from pcii.core.array_labels import COUNTS_LABELS
from pcii.exchange.written_pixels import write_png
from pcii.exporting.export_formats import WRITERS, export_dataset
from pcii.io.collection_layout import COLLECTION_FOLDER, index_row, write_index
from pcii.io.dataset_layout import COUNTS, MANIFEST, RADIANCE, TRUTH, read_manifest, write_manifest
from pcii.io.zarr_groups import write_arrays_safely
from pcii.store.file_list import list_files


def dataset_of(root, dense, **members):
    """A dataset of counts alone."""
    root.mkdir()
    grid = unit_grid(*dense.shape)
    write_arrays_safely(root / COUNTS, {"dense": dense}, COUNTS_LABELS)
    manifest = {"grid": asdict(grid), "cfa": None, "files": list_files(root, [COUNTS])}
    write_manifest(root, manifest | members)
    return root


def radiance_of(dataset):
    views = pcii.open_dataset(dataset).views
    assert views is not None
    return views.radiance


def numbers_of(path):
    """Numbers of a PNG and its bits, as the file says."""
    width, height, rows, facts = png.Reader(filename=str(path)).asDirect()
    return np.array([list(row) for row in rows]).reshape(height, width, -1), facts["bitdepth"]


def test_events_come_back_with_numpy_alone(tmp_path):
    out = pcii.export_dataset(make_dataset(tmp_path / "data"), "events", tmp_path / "out")
    assert [path.name for path in out.iterdir()] == ["events.npz"]
    with np.load(out / "events.npz", allow_pickle=False) as stored:
        arrays = dict(stored)
    counts = np.zeros(GRID.shape_KLHW, dtype=int)
    np.add.at(counts, tuple(arrays[name] for name in "klij"), arrays["n"])
    np.testing.assert_array_equal(counts, DENSE)
    grid = {name: arrays[name] for name in asdict(GRID)}
    assert {name: value.tolist() for name, value in grid.items()} == {
        name: list(value) if isinstance(value, tuple) else value for name, value in asdict(GRID).items()
    }
    assert str(arrays["cfa"]) == "GRBG"
    np.testing.assert_array_equal(arrays["truth_z_mm"], Z_MM)
    np.testing.assert_array_equal(arrays["truth_object_id"], IDS)
    assert arrays["object_keys"].tolist() == [1]
    assert arrays["object_names"].tolist() == ["ball"]
    assert arrays["photon_z_mm"].tolist() == [540.0] * DENSE.sum()


@pytest.mark.parametrize(("most", "bits"), [(0, 8), (255, 8), (256, 16), (65535, 16)])
def test_counts_come_back_from_png_to_the_photon(tmp_path, most, bits):
    dense = np.arange(2 * 11 * 3 * 4).reshape(2, 11, 3, 4) * most // (2 * 11 * 12 - 1)
    out = export_dataset(dataset_of(tmp_path / "data", dense), "saii", tmp_path / "out")
    assert sorted(path.name for path in out.iterdir()) == ["counts"]
    camera = json.loads((out / "counts" / "camera.json").read_text())
    assert {name: camera[name] for name in ("rows", "cols", "height", "width", "bits")} == {
        **{"rows": 2, "cols": 11, "height": 3, "width": 4},
        "bits": bits,
    }
    assert camera["full_scale"] == 2**bits - 1
    for k, l in np.ndindex(2, 11):
        numbers, found = numbers_of(out / "counts" / f"{k:02d}_{l:02d}.png")
        assert found == bits
        np.testing.assert_array_equal(numbers[..., 0], dense[k, l])


def test_more_photons_than_16_bits_hold_are_refused(tmp_path):
    data = dataset_of(tmp_path / "data", np.full((1, 1, 2, 2), 65536))
    assert "65536 photons" in one_sentence(lambda: export_dataset(data, "saii", tmp_path / "out"), data)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data"]


def test_radiance_below_0_is_not_cut_off(tmp_path):
    radiance = np.ones((*GRID.shape_KLHW, 3), np.float32)
    radiance[1, 2, 3, 4, 0] = -0.25
    data = pcii.save_dataset(tmp_path / "data", pcii.Views(radiance, GRID)).path
    assert "down to -0.25" in one_sentence(lambda: export_dataset(data, "saii", tmp_path / "out"), data)


@pytest.mark.parametrize("cfa", [None, "RGGB"])
def test_radiance_comes_back_from_png_to_half_a_step(tmp_path, cfa):
    grid = unit_grid(2, 3, 6, 8, pitch_mm=(9.0, 5.0), shear_px=(1.5, -2.0))
    data = write_planes(tmp_path / "data", grid, cfa, radiance_unit="lamps")
    out = export_dataset(data, "saii", tmp_path / "out") / "radiance"
    camera = json.loads((out / "camera.json").read_text())
    assert {name: camera[name] for name in asdict(grid)} == json.loads(json.dumps(asdict(grid)))
    assert (camera["optical_axis_px"], camera["unit"], camera["cfa"]) == ([3.5, 2.5], "lamps", cfa)
    stored_views = radiance_of(data)
    for k, l in np.ndindex(2, 3):
        numbers, bits = numbers_of(out / f"{k:02d}_{l:02d}.png")
        stored = np.asarray(stored_views[k, l])
        assert (bits, numbers.shape) == (16, stored.shape)
        if cfa is None:
            np.testing.assert_array_equal(stored, view(grid, k, l).astype(np.float32))
        half_a_step = camera["full_scale"] / 65535 / 2
        np.testing.assert_allclose(numbers / 65535 * camera["full_scale"], stored, atol=1.001 * half_a_step)


def test_exr_holds_radiance_photons_and_depth_bit_for_bit(tmp_path):
    out = export_dataset(make_dataset(tmp_path / "data"), "exr", tmp_path / "out")
    with OpenEXR.File(str(out / "views.exr"), separate_channels=True) as file:
        parts = {part.name(): part for part in file.parts}
        assert list(parts) == [*(f"k0{k}_l0{l}" for k in range(2) for l in range(3)), "virtual_centre"]
        for k, l in np.ndindex(2, 3):
            part = parts[f"k0{k}_l0{l}"]
            channels = {name: channel.pixels for name, channel in part.channels.items()}
            assert sorted(channels) == ["B", "G", "R", "photons"]
            np.testing.assert_array_equal(channels["photons"], DENSE[k, l])
            assert channels["photons"].dtype == np.uint32
            for name in "RGB":
                np.testing.assert_array_equal(channels[name], np.full((4, 5), 3 * k + l, np.float32))
            # OpenEXR's matrices are for row vectors: the camera's place goes to the origin.
            place = [(l - 1) * GRID.pitch_mm[0], (k - 0.5) * GRID.pitch_mm[1], 0, 1]
            np.testing.assert_array_equal(place @ part.header["worldToCamera"], [0, 0, 0, 1])
            comments = json.loads(part.header["comments"])
            assert comments["grid"] == json.loads(json.dumps(asdict(GRID)))
            assert (comments["cfa"], comments["objects"]) == ("GRBG", {"1": "ball"})
        centre = {name: channel.pixels for name, channel in parts["virtual_centre"].channels.items()}
        np.testing.assert_array_equal(centre["Z"], Z_MM)
        np.testing.assert_array_equal(centre["objectId"], IDS)


def test_exr_keeps_a_mosaic_as_luminance(tmp_path):
    grid = unit_grid(1, 2, 4, 6)
    data = write_planes(tmp_path / "data", grid, "BGGR")
    out = export_dataset(data, "exr", tmp_path / "out")
    with OpenEXR.File(str(out / "views.exr"), separate_channels=True) as file:
        pixels = file.parts[1].channels["Y"].pixels
        np.testing.assert_array_equal(pixels, radiance_of(data)[0, 1][..., 0])


@pytest.mark.parametrize("format", WRITERS)
def test_an_export_has_the_same_bytes_every_time(tmp_path, format):
    data = make_dataset(tmp_path / "data", frames=8)
    contents = []
    for name in ("first", "second"):
        out = export_dataset(data, format, tmp_path / name)
        files = sorted(path for path in out.rglob("*") if path.is_file())
        contents.append([(path.relative_to(out), path.read_bytes()) for path in files])
    assert contents[0] == contents[1]


@pytest.mark.parametrize("format", WRITERS)
def test_only_a_new_or_empty_folder_is_written(tmp_path, format):
    data = make_dataset(tmp_path / "data", frames=8)
    full, empty = tmp_path / "full", tmp_path / "empty"
    full.mkdir()
    empty.mkdir()
    (full / "precious.txt").write_text("mine")
    one_sentence(lambda: export_dataset(data, format, full), full)
    one_sentence(lambda: export_dataset(data, format, full / "precious.txt"), full / "precious.txt")
    inside = data / "export"
    one_sentence(lambda: export_dataset(data, format, inside), inside)
    assert [path.name for path in full.iterdir()] == ["precious.txt"]
    assert any(export_dataset(data, format, empty).iterdir())
    assert any(export_dataset(data, format, tmp_path / "new" / "folder").iterdir())


@pytest.mark.parametrize(
    ("format", "kept"), [("hci", [TRUTH]), ("saii", [TRUTH]), ("events", [TRUTH, RADIANCE]), ("exr", [])]
)
def test_a_dataset_that_lacks_what_is_needed_is_refused_in_a_sentence(tmp_path, format, kept):
    files = pcii.open_dataset(make_dataset(tmp_path / "whole")).manifest["files"]
    part = {name: entry for name, entry in files.items() if name.split("/")[0] in kept}
    data = make_dataset(tmp_path / "data", files=part)
    one_sentence(lambda: export_dataset(data, format, tmp_path / "out"), data)
    assert not (tmp_path / "out").exists()


@pytest.fixture
def collection(tmp_path):
    """Two datasets, by their seeds."""
    root = tmp_path / "sweep"
    root.mkdir()
    rows = []
    for seed in (1, 2):
        recipe = {"scene": "two", "seed": seed, "photons": {"scope": "view", "budget": 10.0, "nested": []}}
        path = make_dataset(root / f"seed_{seed}", frames=8, recipe=recipe, identity=f"no. {seed}")
        rows.append(index_row(path.name, {"seed": seed}, read_manifest(path), path / MANIFEST))
    COLLECTION_FOLDER.write(root, {"fields": ["seed"]})
    write_index(root, rows)
    return root


@pytest.mark.parametrize("format", WRITERS)
def test_a_collection_is_exported_dataset_by_dataset(collection, tmp_path, format):
    out = export_dataset(collection, format, tmp_path / "out", budget=10)
    assert sorted(path.name for path in out.iterdir()) == ["seed_1", "seed_2"]
    single = export_dataset(collection / "seed_2", format, tmp_path / "single" / "seed_2")
    assert contents(out / "seed_2") == contents(single)
    part = export_dataset(pcii.open_collection(collection).where(seed=2), format, tmp_path / "part")
    assert contents(part) == contents(single.parent)


def contents(root):
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_a_collection_is_exported_as_a_whole_or_not_at_all(collection, tmp_path):
    one_sentence(lambda: export_dataset(collection, "events", collection / "out"), collection / "out")
    damaged = largest_file(collection / "seed_2", COUNTS)
    flip_a_bit(damaged, 80)
    one_sentence(lambda: export_dataset(collection, "events", tmp_path / "out"), damaged)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep"]
    write_index(collection, [])
    assert "no finished" in one_sentence(
        lambda: export_dataset(collection, "hci", tmp_path / "o"), collection
    )


def test_an_unknown_format_is_refused(tmp_path):
    with pytest.raises(pcii.InputError, match="format: there is no 'tiff'"):
        export_dataset(make_dataset(tmp_path / "data"), "tiff", tmp_path / "out")  # type: ignore[arg-type]


def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch):
    data = make_dataset(tmp_path / "data")

    def disk_is_full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", disk_is_full)
    with pytest.raises(OSError, match="out"):
        export_dataset(data, "events", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_other_decoders_read_the_png_files_too(tmp_path):
    numbers = np.random.default_rng(0).integers(0, 65536, (5, 7))
    write_png(tmp_path / "grey.png", numbers.astype(np.uint16))
    np.testing.assert_array_equal(np.array(Image.open(tmp_path / "grey.png")), numbers)
    colours = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    write_png(tmp_path / "colours.png", colours)
    np.testing.assert_array_equal(imageio.v3.imread(tmp_path / "colours.png"), colours)
