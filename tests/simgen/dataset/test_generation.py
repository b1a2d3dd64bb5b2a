"""Datasets: the same bytes again, resuming, refusing what is not ours, and reuse between datasets."""

import fcntl
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
import zarr
from digests import digest
from lit_scenes import EVENLY, card
from stored_datasets import flip_a_bit, one_sentence
from tiny import GRID_2_X_2, TINY_RECIPE
from zarr.storage import ZipStore

from pcii.base import InputError, silent
from pcii.store import ARRAYS, MANIFEST, MARKER, RADIANCE, TRUTH, open_dataset, provenance, verify
from simgen.cameras import rig_of
from simgen.dataset import Prepared, generate, generation, prepare
from simgen.dataset.generation import Reuse, make
from simgen.renderer import render_view
from simgen.spec import Recipe, load_recipe

pytestmark = pytest.mark.renders
TINY = TINY_RECIPE | {
    "seed": 3,
    "photons": {"budget": 200},
    "render": {"samples_per_pixel": 2},
    "products": {"radiance": "mosaic", "view_truth": True},
}


def recipe(**changes: object) -> Recipe:
    return Recipe.model_validate(TINY | changes)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tiny") / "made"
    generate(recipe(), Path(), out)
    return out


def test_a_dataset_explains_itself_and_agrees_with_its_recipe(made: Path) -> None:
    manifest = json.loads((made / MANIFEST).read_text())
    assert manifest["objects"] == {"1": "ball", "2": "bird"}
    assert set(manifest["timings_s"]) >= {"truth", "radiance"}
    assert manifest["backend"]["variant"]
    assert {"what", "why", "saved", "unit"} == set(manifest["skipped"][0])
    assert set(manifest["files"]) == set(digest(made))
    assert not (made / MARKER).exists()
    assert verify(made) == len(manifest["files"])
    dataset: Any = open_dataset(made)
    assert (dataset.grid.shape_KLHW, dataset.cfa) == ((2, 3, 64, 60), "GRBG")
    # Six views of 200 photons: a Poisson total, within 5 standard deviations.
    assert abs(dataset.counts.total - 1200) < 5 * np.sqrt(1200)
    assert set(np.unique(dataset.truth.object_id)) == {0, 1, 2}
    assert dataset.views.view(1, 2).shape == (64, 60, 1)


def test_fewer_samples_of_the_background_are_said_with_what_they_saved(tmp_path: Path) -> None:
    render = {"samples_per_pixel": 4, "background_samples_per_pixel": 1}
    manifest = generate(recipe(render=render), Path(), tmp_path / "sparse")
    (saved,) = (entry["saved"] for entry in manifest["skipped"] if "no object can be seen" in entry["what"])
    assert 0 < saved < 3 * 6 * 64 * 60


def test_what_is_packed_is_the_same_and_is_read_as_any_other(made: Path, tmp_path: Path) -> None:
    packed = tmp_path / "packed"
    generate(recipe(products={"profile": "training"}), Path(), packed)
    assert {path.name for path in packed.iterdir()} == {MANIFEST, ARRAYS}
    assert verify(packed) == 1
    whole, dataset = open_dataset(made), open_dataset(packed)
    np.testing.assert_array_equal(dataset.counts.dense, whole.counts.dense)
    truth: Any = dataset.truth
    assert truth.photons is None
    np.testing.assert_array_equal(truth.z_mm, whole.truth_array("z_mm"))
    np.testing.assert_array_equal(dataset.truth_array("in_focus"), whole.truth_array("in_focus"))
    stored = zarr.open_group(ZipStore(packed / ARRAYS, mode="r"), path=TRUTH, mode="r")
    assert sorted(stored.array_keys()) == ["in_focus", "object_id", "z_mm"]
    flip_a_bit(packed / ARRAYS, 5000)
    one_sentence(lambda: open_dataset(packed).counts, packed / ARRAYS)


def test_the_same_recipe_gives_the_same_bytes_and_another_seed_other_photons_of_the_same_truth(
    made: Path, tmp_path: Path
) -> None:
    generate(recipe(), Path(), tmp_path / "again")
    assert digest(tmp_path / "again") == digest(made)
    generate(recipe(seed=4), Path(), tmp_path / "other")
    ours, theirs = open_dataset(made), open_dataset(tmp_path / "other")
    np.testing.assert_array_equal(ours.truth_array("z_mm"), theirs.truth_array("z_mm"))
    assert (ours.counts.dense != theirs.counts.dense).any()


def test_a_killed_run_is_resumed_to_the_same_bytes(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, views = tmp_path / "killed", list[object]()

    def dies_at_the_fourth(*args: object, **kwargs: object) -> np.ndarray:
        views.append(args[2:4])
        if len(views) == 4:
            raise KeyboardInterrupt
        return render_view(*args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr("simgen.dataset.rendered_views.render_view", dies_at_the_fourth)
    with pytest.raises(KeyboardInterrupt):
        generate(recipe(), Path(), out)
    assert not (out / MANIFEST).exists()
    with pytest.raises(InputError, match="unfinished; the same"):
        open_dataset(out)
    (out / RADIANCE / ".view_00_00.exr.1.tmp").touch()  # what a kill in mid-write leaves
    generate(recipe(), Path(), out)
    assert len(views) == 4 + 3
    assert digest(out) == digest(made)


def test_a_finished_dataset_is_left_alone_and_one_that_another_run_writes(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Prepared, "render_scene", lambda _: pytest.fail("rendered again"))
    before = (made / MANIFEST).stat().st_mtime_ns
    generate(recipe(), Path(), made)
    with pytest.raises(InputError, match="of another recipe or scene"):
        generate(recipe(seed=99), Path(), made)
    assert (made / MANIFEST).stat().st_mtime_ns == before
    with (tmp_path / MARKER).open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="another run writes here"):
            generate(recipe(), Path(), tmp_path)


def test_a_scene_that_cannot_be_loaded_leaves_no_folder_behind(tmp_path: Path) -> None:
    for folder in ("scene", "empty"):
        (tmp_path / folder).mkdir()
    values = {"title": "bad", "lights": [EVENLY], "objects": [card(500, 9.0, {"texture": "a.png"})]}
    (tmp_path / "scene" / "scene.toml").write_text(tomli_w.dumps(values))
    (tmp_path / "scene" / "a.png").write_text("no picture")
    for out in (tmp_path / "new" / "deep" / "out", tmp_path / "empty"):
        with pytest.raises(InputError, match="not a PNG"):
            generate(recipe(scene=str(tmp_path / "scene")), Path(), out)
    assert not (tmp_path / "new").exists()
    assert list((tmp_path / "empty").iterdir()) == []


def test_what_other_software_made_is_refused_and_untouched(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object, **__: object) -> np.ndarray:
        raise KeyboardInterrupt

    out, original = tmp_path / "begun", provenance.version
    monkeypatch.setattr("simgen.dataset.rendered_views.render_view", killed)
    with pytest.raises(KeyboardInterrupt):
        generate(recipe(), Path(), out)
    monkeypatch.setattr(provenance, "version", lambda name: "9.9" if name == "mitsuba" else original(name))
    before = digest(out)
    for folder, what in ((made, "holds the dataset"), (out, "holds the unfinished dataset")):
        with pytest.raises(InputError, match=f"{what} of other software.*mitsuba .* is now 9.9"):
            generate(recipe(), Path(), folder)
    assert digest(out) == before
    assert verify(made) > 0


def test_much_light_is_rendered_and_little_is_not(made: Path, tmp_path: Path) -> None:
    generate(recipe(scene="empty", photons={"budget": 3000}), Path(), tmp_path / "bright")
    bright: Any = open_dataset(tmp_path / "bright")
    dim: Any = open_dataset(made)
    assert bright.manifest["photons"]["method"] == "dense"
    assert abs(bright.counts.total - 18e3) < 5 * np.sqrt(18e3)
    assert bright.manifest["photons"]["rendering_noise"] < 0.01
    assert bright.truth.photons is None
    photons = dim.manifest["photons"]
    assert (photons["method"], photons["kept"]) == ("thinning", dim.counts.total)
    assert dim.truth.photons.z_mm.shape == (dim.counts.total,)


def test_errors_of_cameras_are_kept_as_truth_and_nowhere_else(made: Path, tmp_path: Path) -> None:
    errors = {"position_sd_mm": (1.0, 2.0, 0.5), "rotation_sd_deg": (0.2, 0.1, 0.3), "pitch_error": 0.01}
    wrong = recipe(grid=TINY["grid"] | {"errors": errors})
    generate(wrong, Path(), tmp_path / "wrong")
    assert open_dataset(tmp_path / "wrong").grid == open_dataset(made).grid
    truth, rig = zarr.open_group(tmp_path / "wrong" / TRUTH, mode="r"), rig_of(wrong.grid, wrong.seed)
    np.testing.assert_array_equal(np.asarray(truth["camera_position_mm"]), rig.position_mm)
    np.testing.assert_array_equal(np.asarray(truth["camera_rotation"]), rig.rotation)
    off, perfect = digest(tmp_path / "wrong"), digest(made)
    same = {name for name in perfect if off[name] == perfect[name]}
    assert any(name.startswith(f"{TRUTH}/z_mm/c/") for name in same)  # the virtual centre has no errors
    assert not any(name.startswith((f"{TRUTH}/view_z_mm/c/", RADIANCE)) for name in same)


TOML = f'scene = "plain_pair"\nseed = 3\n{GRID_2_X_2}[photons]\nbudget = 100\n'
ERRORS = "grid.errors={position_sd_mm=[1.0,1.0,0.5]}"
OTHERS = [["photons.budget=300"], [ERRORS, "seed=4"], ["analysis.z_mm=[500.0]"], ["grid.pitch_mm=[9.0,18.0]"]]
OTHERS.append(["scene=two_objects"])


@pytest.fixture
def recipe_file(tmp_path: Path) -> str:
    path = tmp_path / "tiny.toml"
    path.write_text(TOML)
    return str(path)


@pytest.mark.parametrize("others", [[["scene=two_objects"]], pytest.param(OTHERS, marks=pytest.mark.slow)])
def test_datasets_are_the_same_whatever_was_made_before(
    others: list[list[str]], recipe_file: str, tmp_path: Path
) -> None:
    reuse, alone = Reuse(), tmp_path / "alone"
    for number, overrides in enumerate([[], *others, []]):
        recipe, near = load_recipe(recipe_file, overrides)
        make(prepare(recipe, near), tmp_path / f"reused {number}", silent, reuse)
        if not (alone / str(overrides)).exists():
            generate(recipe, near, alone / str(overrides))
        assert digest(tmp_path / f"reused {number}") == digest(alone / str(overrides)), overrides


def test_only_what_depends_on_a_change_is_made_again(
    recipe_file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    works: list[str] = []

    def watch(owner: Any, name: str) -> None:
        work = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *args: works.append(name) or work(*args))

    watch(Prepared, "render_scene")
    watch(Prepared, "plan")
    watch(generation, "write_truth")
    reuse = Reuse()
    make(prepare(*load_recipe(recipe_file)), tmp_path / "first", silent, reuse)
    assert sorted(works) == ["plan", "render_scene", "write_truth"]
    works.clear()
    make(prepare(*load_recipe(recipe_file, [ERRORS])), tmp_path / "second", silent, reuse)
    assert sorted(works) == ["plan", "write_truth"]


def test_an_asset_that_changes_is_read_again(recipe_file: str, tmp_path: Path) -> None:
    scene = tmp_path / "mine"
    scene.mkdir()
    thing = card(500, 0, {"reflectance": [0.5, 0.5, 0.5]}) | {"shape": {"type": "mesh", "file": "card.obj"}}
    values = {"title": "one card", "objects": [thing], "lights": [EVENLY]}
    (scene / "scene.toml").write_text(tomli_w.dumps(values))
    reuse, digests = Reuse(), set[str]()
    for size in (30, 60):
        corners = "\n".join(f"v {x * size} {y * size} 0" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        (scene / "card.obj").write_text(f"{corners}\nf 1 2 3\nf 1 3 4\n")
        recipe, near = load_recipe(recipe_file, [f"scene={scene}"])
        make(prepare(recipe, near), tmp_path / f"of {size}", silent, reuse)
        digests.add(str(digest(tmp_path / f"of {size}")))
    assert len(digests) == 2
