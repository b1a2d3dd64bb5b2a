"""Datasets on disk: what comes back, whose folder it is, which faults are errors, and groups of arrays."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
import zarr
from command_runs import run_pcii
from hostile_names import NAMES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from markdown_it import MarkdownIt
from stored_datasets import (
    DENSE,
    GRID,
    IDS,
    Z_MM,
    flip_a_bit,
    largest_file,
    list_datasets,
    make_dataset,
    one_sentence,
    rewrite_manifest,
)
from twins import unit_grid

import pcii
from pcii.base import InputError
from pcii.store import (
    CARD,
    COUNTS,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    SAMPLE,
    TRUTH,
    Label,
    Terms,
    list_files,
    open_dataset,
    radiance_name,
    read_array,
    read_exr,
    read_part,
    save_dataset,
    verify,
    write_arrays_safely,
    write_card,
    write_exr_safely,
    write_licence,
)
from pcii.store import LICENCE as LICENCE_FILE
from pcii.types import Light, PhotonCounts, PhotonTruth, Truth, Views


def test_what_a_dataset_does_not_have_is_none_or_refused_and_other_members_are_kept(tmp_path):
    root = make_dataset(tmp_path / "d", files={}, mine={"a": [1]})
    dataset = open_dataset(root)
    assert dataset.truth is None
    assert dataset.views is None
    assert "no photon counts" in one_sentence(lambda: dataset.counts, root)
    assert "has no budget 3; there are none" in one_sentence(lambda: dataset.at_light(Light(3)), root)
    assert dataset.manifest["mine"] == {"a": [1]}


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


@pytest.mark.parametrize(
    ("part", "read"),
    [(COUNTS, lambda d: d.counts), (TRUTH, lambda d: d.truth), (RADIANCE, lambda d: d.views.view(1, 2))],
)
def test_damage_is_found_on_opening_or_on_reading_and_leaves_other_parts_readable(tmp_path, part, read):
    root = make_dataset(tmp_path / "d")
    file = root / radiance_name(1, 2) if part == RADIANCE else largest_file(root, part)
    flip_a_bit(file, 1234)
    dataset = open_dataset(root)
    assert "SHA-256" in one_sentence(lambda: read(dataset), file)
    assert part == COUNTS or dataset.counts.total == DENSE.sum()
    file.write_bytes(file.read_bytes()[:-1])
    assert "truncated" in one_sentence(lambda: open_dataset(root), file)
    file.unlink()  # a deleted Zarr chunk would read as zeros
    assert "missing" in one_sentence(lambda: open_dataset(root), file)


ENTRY = {"bytes": 1, "sha256": "0" * 64}
WRONG = [
    ({"cfa": "GRGB"}, "cfa: "),
    ({"analysis": {"z_mm": [-5.0]}}, "analysis.z_mm.0: "),
    ({"files": ...}, "files: "),
    ({"files": {"../secret": ENTRY}}, "a path inside the folder"),
    ({"files": {radiance_name(0, 1): ENTRY}}, f"files: {radiance_name(0, 0)} is missing"),
    ({"packed": ["truth.zarr/zarr.json"]}, "files: arrays.zip is missing"),
]


@pytest.mark.parametrize(("members", "words"), WRONG, ids=[ascii(members) for members, _ in WRONG])
def test_a_wrong_or_absent_member_of_a_manifest_is_named(tmp_path, members, words):
    root = make_dataset(tmp_path / "d")
    rewrite_manifest(root, **members)
    assert words in one_sentence(lambda: open_dataset(root), root / MANIFEST)


def test_an_archive_that_is_none_is_refused(tmp_path):
    root = make_dataset(tmp_path / "d")
    (root / "arrays.zip").write_bytes(b"PK")
    packed = [f"{COUNTS}/dense/zarr.json"]
    rewrite_manifest(root, packed=packed, files=list_files(root, ["arrays.zip"]))
    dataset = open_dataset(root)
    assert "cannot be read" in one_sentence(lambda: dataset.counts, root / "arrays.zip")


def test_radiance_of_another_size_is_refused(tmp_path):
    root = make_dataset(tmp_path / "d")
    wrong = root / radiance_name(1, 2)
    write_exr_safely(wrong, np.zeros((40, 50, 3), dtype=np.float32))
    rewrite_manifest(root, files=list_files(root, [COUNTS, TRUTH, RADIANCE]))
    views: Any = open_dataset(root).views
    assert "expected an image (4, 5, 3)" in one_sentence(lambda: views.view(1, 2), wrong)


def test_radiance_is_read_view_by_view_or_by_numpy(tmp_path):
    views: Any = open_dataset(make_dataset(tmp_path / "d")).views
    expected = np.broadcast_to(np.arange(6.0).reshape(2, 3, 1, 1, 1), (2, 3, 4, 5, 3))
    for dtype in (np.float32, np.float64):
        whole = np.asarray(views.radiance, dtype=dtype)
        assert whole.dtype == dtype
        np.testing.assert_array_equal(whole, expected)
    with pytest.raises(pcii.InputError, match=r"radiance: read one of 2 x 3 views by \[k, l\]"):
        views.radiance[0]


@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 7, 3)])
def test_radiance_comes_back_in_its_channels_and_in_single_precision(tmp_path, shape):
    path, image = tmp_path / "a.exr", np.random.default_rng(0).random(shape).astype(np.float32)
    image[0, 0, 0] = 1e6  # beyond half precision
    write_exr_safely(path, image)
    again = read_exr(path)
    assert again.dtype == np.float32
    np.testing.assert_array_equal(again, image)
    path.write_bytes(b"v/1\x01" + bytes(50))
    assert "cannot be read" in one_sentence(lambda: read_exr(path), path)


def test_the_sample_is_small_and_whole_and_has_all_that_an_analysis_uses() -> None:
    files = [file for file in SAMPLE.rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) < 2_000_000
    assert verify(SAMPLE) == len(files) - 2  # but for the manifest and README.md
    data: Any = pcii.sample()
    assert data.truth.photons is not None
    assert data.views is not None
    # 25 views of 2000 photons, Poisson: a standard deviation of 224.
    assert abs(data.counts.total - 25 * 2000) < 5 * 224


def test_a_copy_is_a_dataset_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "copy"
    assert run_pcii("sample", "-o", out) == 0
    assert verify(out) == verify(SAMPLE)
    assert run_pcii("sample", "-o", out) == 2
    assert f"error: {out}: holds something else; name a new or empty folder" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.renders
def test_the_sample_is_what_its_recipe_gives(tmp_path: Path) -> None:
    import simgen

    recipe = simgen.load_recipe("sample")
    simgen.generate(recipe, tmp_path / "again")
    again: Any = pcii.open_dataset(tmp_path / "again")
    sample: Any = pcii.sample()
    assert sample.manifest.recipe == recipe.recipe.model_dump(mode="json", exclude={"publication"})
    assert sample.manifest["scene"] == again.manifest["scene"]
    if again.manifest.files == sample.manifest.files:
        return
    # Another renderer or processor: the same geometry but for pixels on an outline, and other photons of the
    # same rate.
    same = again.truth.object_id == sample.truth.object_id
    assert same.mean() > 0.999
    np.testing.assert_allclose(again.truth.z_mm[same], sample.truth.z_mm[same], rtol=1e-4)
    for k, l in np.ndindex(5, 5):
        totals = [int(data.counts.view(k, l).sum()) for data in (again, sample)]
        assert abs(totals[0] - totals[1]) < 5 * np.sqrt(2 * 2000)


LIGHT = np.random.default_rng(1).random((*GRID.shape_KLHW, 3)).astype(np.float32)
COUNTED = PhotonCounts.from_dense(DENSE, GRID, cfa="GRBG")
EVENTS = COUNTED.events
PHOTONS = PhotonTruth(
    **{name: getattr(EVENTS, name).repeat(EVENTS.n) for name in "klij"},
    object_id=np.arange(COUNTED.total) % 2,
    z_mm=np.full(COUNTED.total, 540.0, np.float32),
)
MAPS = {
    "normal": np.zeros((4, 5, 3), np.float32),
    "coverage": np.ones((4, 5), np.float32),
    "visible_views": np.full((4, 5), 6, np.uint16),
}
SAVED_TRUTH = Truth(Z_MM, IDS, {1: "ball"}, photons=PHOTONS, unscored=frozenset({1}), **MAPS)


@pytest.mark.parametrize("sparse", [True, False])
def test_what_is_saved_is_opened(tmp_path: Path, sparse: bool) -> None:
    events = PhotonCounts.from_events(*(getattr(EVENTS, name) for name in "klijn"), GRID, cfa="GRBG")
    images = (Views(LIGHT, GRID), events if sparse else COUNTED)
    texts: dict[str, Any] = {"title": "Mine", "licence": "CC0", "citation": "Me", "origin": "a camera"}
    depths: dict[str, Any] = {"z_mm": [540, 620], "z_range_mm": (450, 750), "photon_budget": 10}
    saved = save_dataset(tmp_path / "d", images, SAVED_TRUTH, **depths, **texts)
    with pytest.raises(InputError, match="holds something else"):
        save_dataset(tmp_path / "d", images)
    dataset: Any = open_dataset(tmp_path / "d")
    assert dataset.manifest == saved.manifest
    assert (dataset.grid, dataset.cfa, dataset.light.photons) == (GRID, "GRBG", 10)
    assert dataset.counts.is_sparse == sparse
    np.testing.assert_array_equal(dataset.counts.dense, DENSE)
    assert dataset.views.cfa is None
    np.testing.assert_array_equal(np.asarray(dataset.views.radiance), LIGHT)
    for name in ("z_mm", "object_id", "names", "normal", "coverage", "visible_views", "unscored"):
        np.testing.assert_array_equal(getattr(dataset.truth, name), getattr(SAVED_TRUTH, name))
    for name in ("k", "l", "i", "j", "object_id", "z_mm"):
        np.testing.assert_array_equal(getattr(dataset.truth.photons, name), getattr(PHOTONS, name))
    assert dataset.analysis == {"z_mm": [540, 620], "z_range_mm": [450, 750]}
    assert {name: dataset.manifest[name] for name in texts} == texts
    assert verify(tmp_path / "d") > 10


@pytest.mark.parametrize("most", [0, 1, 256, 70_000, 1 << 39])
def test_counts_of_any_number_and_share_of_pixels_come_back(tmp_path: Path, most: int) -> None:
    grid = unit_grid(2, 2, 20, 20)
    dense = np.zeros(grid.shape_KLHW, np.int64)
    dense[1, 0, 3, 4] = most
    for name, array in (("events", dense), ("dense", dense + np.arange(20))):
        dataset = save_dataset(tmp_path / "new" / name, PhotonCounts.from_dense(array, grid))
        np.testing.assert_array_equal(dataset.counts.dense, array)
        assert dataset.has(f"{COUNTS}/dense") == (name == "dense")


def test_the_identity_follows_from_the_content(tmp_path: Path) -> None:
    first = save_dataset(tmp_path / "a", COUNTED, title="one", z_mm=500).manifest["identity"]
    assert save_dataset(tmp_path / "b", COUNTED, title="two").manifest["identity"] == first
    others = [
        (PhotonCounts.from_dense(DENSE + 1, GRID, cfa="GRBG"), None),
        (PhotonCounts.from_dense(DENSE, GRID), None),
        (PhotonCounts.from_dense(DENSE, replace(GRID, pitch_mm=(2.0, 1.0)), cfa="GRBG"), None),
        (COUNTED, Truth(Z_MM, IDS, {1: "ball"})),
        (COUNTED, Truth(Z_MM, IDS, {1: "cube"})),
        (COUNTED, Truth(Z_MM, IDS, {1: "ball"}, unscored=frozenset({1}))),
    ]
    saved = [save_dataset(tmp_path / f"{n}", *other) for n, other in enumerate(others)]
    assert len({first, *(dataset.manifest["identity"] for dataset in saved)}) == 7


OTHER = unit_grid(2, 3, 4, 5, pitch_mm=(2.0, 2.0))
BRIGHT = np.full((*GRID.shape_KLHW, 1), 1e300)
SHUFFLED = replace(PHOTONS, j=PHOTONS.j[::-1].copy())
NAN_LAST = LIGHT.copy()
NAN_LAST[1, 2, 0, 0, 0] = np.nan


@pytest.mark.parametrize(
    ("images", "options", "words"),
    [
        ((COUNTED, Views(LIGHT, OTHER)), {}, "different camera grids"),
        (Views(BRIGHT, GRID), {}, r"view \(0, 0\) is too bright"),
        ((COUNTED, Views(NAN_LAST, GRID)), {}, r"view \(1, 2\) holds NaN"),
        (COUNTED, {"z_range_mm": (750, 450)}, "z_range_mm: near must be less than far"),
        (COUNTED, {"truth": Truth(Z_MM[:3], IDS[:3], {1: "a"})}, r"truth: expected .* of \(4, 5\)"),
        (COUNTED, {"truth": replace(SAVED_TRUTH, photons=SHUFFLED)}, "not those of the counts"),
        (COUNTED, {"view_z_mm": np.full(GRID.shape_KLHW, np.nan)}, "view_z_mm: expected depths of"),
    ],
)
def test_what_does_not_go_together_is_refused_in_a_sentence(tmp_path: Path, images, options, words) -> None:
    with pytest.raises(InputError, match=words) as caught:
        save_dataset(tmp_path / "d", images, **options)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_depths_of_every_view_are_kept_with_and_without_a_virtual_centre(tmp_path: Path) -> None:
    z_mm = np.arange(1, DENSE.size + 1).reshape(DENSE.shape) * 1.5
    z_mm[0, 1, 2, 3] = np.inf
    for name, truth in (("both", SAVED_TRUTH), ("alone", None)):
        save_dataset(tmp_path / name, COUNTED, truth, view_z_mm=z_mm, radiance_unit="cd/m^2")
        dataset = open_dataset(tmp_path / name)
        np.testing.assert_array_equal(dataset.truth_array("view_z_mm"), z_mm.astype(np.float32))
        assert (dataset.truth is None) == (truth is None)
        assert dataset.manifest["radiance_unit"] == "cd/m^2"
        assert verify(tmp_path / name) > 2


TERMS = Terms("CC-BY-4.0", ("Ada", "Grace"), "Ada and Grace, Photons, 2026", "https://example.org/photons")


def make_pair(root: Path) -> Path:
    """Two datasets by hand that differ in their budget."""
    root.mkdir()
    budgets, common = {"budget_10": 10.0, "budget_20": 20.0}, {"scene": "by hand", "seed": 3}
    for name, budget in budgets.items():
        recipe = common | {"photons": {"budget": budget}}
        make_dataset(root / name, recipe=recipe, identity=name, photons={"total": 5})
    values = {name: {"photons.budget": budget} for name, budget in budgets.items()}
    return list_datasets(root, values, recipe=common)


@pytest.mark.parametrize("make", [make_dataset, make_pair])
def test_a_card_is_short_and_a_run_that_was_killed_leaves_none(tmp_path, make):
    root = make(tmp_path / "data")
    write_card(root, TERMS)
    text = (root / CARD).read_text()
    assert len(text.splitlines()) <= 30
    write_licence(root, TERMS)
    for words in ("CC-BY-4.0", "Ada, Grace", TERMS.citation, TERMS.url):
        assert words in text
        assert words in (root / LICENCE_FILE).read_text()
    if make is make_pair:
        assert text.startswith("# by hand\n")  # the scene, where no title is stated
        assert "2 datasets, which differ in photons.budget" in text
    (root / f".{CARD}.abcd1234.tmp").write_text("# Half a ca")
    with pytest.raises(InputError, match="not listed in"):
        verify(root)
    write_card(root, TERMS)
    assert verify(root)
    assert (root / CARD).read_text() == text


def test_a_card_follows_the_data_and_the_terms_alone(tmp_path):
    root, other = make_dataset(tmp_path / "data"), make_dataset(tmp_path / "other")
    rewrite_manifest(other, timings_s={"photons": 9.5})
    for folder in (root, other):
        write_card(folder, Terms())
    assert (root / CARD).read_bytes() == (other / CARD).read_bytes()
    text = (root / CARD).read_text()
    assert "Licence: none is stated." in text  # what nobody has said
    before = (root / MANIFEST).read_bytes()
    write_card(root, TERMS)
    assert (root / MANIFEST).read_bytes() == before
    assert "none is stated" not in (root / CARD).read_text()
    (root / CARD).write_text("# My own words")
    write_card(root, TERMS)
    assert (root / CARD).read_text() == "# My own words"


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_names_with_markup_appear_as_plain_text_in_cards(tmp_path, name):
    root = make_dataset(tmp_path / "data", title=name, objects={"1": name}, recipe={"scene": name})
    for address in (name, f"https://example.org/{name}", f"javascript://{name}"):
        write_card(root, Terms(address, (name,), name, address))
        page = MarkdownIt("gfm-like", {"html": True, "linkify": False}).render((root / CARD).read_text())
        assert {*re.findall(r"<(\w+)", page)} <= {"h1", "p", "code", "pre", "a", "blockquote"}
        assert all(link.startswith("https://") for link in re.findall('href="([^"]*)', page))


Y = Label(("step",), "three numbers", "mm")
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
    files = read_part(tmp_path, list_files(tmp_path, ["a.zarr"]), "a.zarr/x")
    ours = read_array(tmp_path, "a.zarr/x", files, x, {})
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
    metadata = json.loads((path / "zarr.json").read_text())
    (path / "zarr.json").write_text(json.dumps(metadata | change))
    assert "cannot be read" in one_sentence(read, path)
