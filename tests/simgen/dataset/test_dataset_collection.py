"""Collections and a benchmark: each dataset is what it would be alone; resumed, shared, certified."""

import json
import multiprocessing
import shutil
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from command_runs import run_simgen
from digests import digest
from small_benchmark import SCENE, written
from tiny import GRID_2_X_3

import pcii
from pcii.base import Executor, InputError, WorkerLostError, locked
from pcii.store import (
    CARD,
    CERTIFICATE,
    COLLECTION,
    CROISSANT,
    INDEX,
    LICENCE,
    MARKER,
    hash_file,
    hash_json,
    open_collection,
    open_dataset,
    provenance,
    verify,
)
from simgen.dataset import (
    Definition,
    certify,
    dataset_collection,
    generate,
    generate_collection,
    load_definition,
    make_benchmark,
)
from simgen.dataset.benchmark_making import BenchmarkSeries, compare
from simgen.spec import Sweep, load_recipe, load_sweep

pytestmark = pytest.mark.renders
TOML = f'scene = "plain_pair"\nseed = 7\n{GRID_2_X_3}[photons]\nbudget = [100, 200]\n'


@pytest.fixture(scope="module")
def recipe_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    path.write_text(TOML)
    return path


@pytest.fixture(scope="module")
def collection(recipe_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("collection") / "six"
    assert run_simgen("generate", recipe_file, "-o", out, "--seeds", "3") == 0
    return out


def sweep_of(recipe_file: Path, seeds: int = 3, *overrides: str) -> Sweep:
    return load_sweep(str(recipe_file), overrides, seeds=seeds)


def test_the_index_is_that_of_manifests_and_each_dataset_is_what_its_recipe_alone_gives(
    recipe_file: Path, collection: Path, tmp_path: Path
) -> None:
    opened = open_collection(collection)
    names = [f"budget_{budget}_seed_{seed}" for budget in (100, 200) for seed in (7, 8, 9)]
    assert [row["path"] for row in opened.rows] == names
    assert {entry.name for entry in collection.iterdir()} == {COLLECTION, INDEX, CARD, *names}
    for row, dataset in zip(opened.rows, opened, strict=True):
        recipe = dataset.manifest["recipe"]
        assert row["values"] == {"photons.budget": recipe["photons"]["budget"], "seed": recipe["seed"]}
        assert row["photons"] == dataset.counts.total
    assert verify(collection) > 6
    recipe, near = load_recipe(str(recipe_file), ["seed=9", "photons.budget=200"])
    manifest = generate(recipe, near, tmp_path / "alone")
    assert digest(tmp_path / "alone") == digest(collection / "budget_200_seed_9")
    assert open_dataset(collection / "budget_200_seed_9").manifest["identity"] == manifest["identity"]


def test_what_is_finished_is_left_alone_and_what_is_missing_is_made(
    recipe_file: Path, collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "copy"
    shutil.copytree(collection, out)
    names, make = list[str](), dataset_collection.make
    monkeypatch.setattr(dataset_collection, "make", lambda *args: names.append(args[1].name) or make(*args))
    assert generate_collection(sweep_of(recipe_file), out) == []
    assert names == []
    assert (out / INDEX).read_bytes() == (collection / INDEX).read_bytes()
    shutil.rmtree(out / "budget_100_seed_8")
    assert generate_collection(sweep_of(recipe_file, 4), out) == []
    assert names == ["budget_100_seed_8", "budget_100_seed_10", "budget_200_seed_10"]
    assert digest(out / "budget_100_seed_8") == digest(collection / "budget_100_seed_8")
    assert len(open_collection(out)) == 8
    # Fewer values leave the others in the folder, and in the index.
    assert generate_collection(sweep_of(recipe_file, 1), out) == []
    assert len(open_collection(out)) == 8


def test_a_dataset_that_cannot_be_made_holds_up_no_other(
    recipe_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    command = ["generate", str(recipe_file), "-o", str(out), "--set", "photons.budget=100", "--seeds", "1"]
    assert run_simgen(*command) == 0
    (out / "seed_8").mkdir()
    (out / "seed_8" / "notes.txt").write_text("mine")
    assert run_simgen(*command[:-1], "3") == 1
    output = capsys.readouterr()
    assert "2 of 3 datasets are finished" in output.out
    assert "seed_8: holds something else" in output.err
    assert [row["seed"] for row in open_collection(out).rows] == [7, 9]


def test_what_is_not_this_collection_is_refused(
    recipe_file: Path, collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    for sweep, out, message in (
        (sweep_of(recipe_file, 3, "grid.cols=2"), collection, "collection of another recipe"),
        (load_sweep(str(recipe_file)), collection, "another recipe"),
        (sweep_of(recipe_file), collection / "budget_100_seed_7", "holds a single dataset"),
        (sweep_of(recipe_file), tmp_path / "file", "this is a file"),
    ):
        with pytest.raises(InputError, match=message):
            generate_collection(sweep, out)
    recipe, near = load_recipe(str(recipe_file), ["photons.budget=5"])
    with pytest.raises(InputError, match="holds something else"):
        generate(recipe, near, collection)
    (tmp_path / "busy").mkdir()
    lock = locked(tmp_path / "busy" / dataset_collection.LOCK, tmp_path / "busy")
    with lock, pytest.raises(InputError, match="another run writes here"):
        generate_collection(sweep_of(recipe_file), tmp_path / "busy")
    original = provenance.version
    monkeypatch.setattr(provenance, "version", lambda name: "9.9" if name == "mitsuba" else original(name))
    with pytest.raises(InputError, match=r"holds the collection of other software.* is now 9\.9"):
        generate_collection(sweep_of(recipe_file, 4), collection)


def test_the_same_command_goes_on_to_the_same_bytes_after_a_worker_was_killed(
    recipe_file: Path, collection: Path, tmp_path: Path
) -> None:
    out, killed = tmp_path / "two", list[int | None]()

    def kill() -> None:
        while not list(out.glob(f"*/{MARKER}")):
            time.sleep(0.005)
        worker = multiprocessing.active_children()[0]
        killed.append(worker.pid)
        worker.kill()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    with pytest.raises(WorkerLostError):
        generate_collection(sweep_of(recipe_file), out, Executor(workers=2))
    killer.join(timeout=10)
    assert killed
    assert generate_collection(sweep_of(recipe_file), out) == []
    for row in open_collection(collection).rows:
        assert digest(out / row["path"]) == digest(collection / row["path"])


@pytest.fixture
def made(small_benchmark: Path) -> tuple[Definition, Path, Path]:
    """A definition, its file, and the benchmark, which is published as it is."""
    return *written(small_benchmark.parent), small_benchmark


def published_certificate(file: Path) -> dict[str, Any]:
    """The certificate that lies beside a definition."""
    return json.loads(file.with_suffix(f".{CERTIFICATE}").read_text())


def test_it_is_a_collection_of_photons_frames_and_full_light(made: tuple[Definition, Path, Path]) -> None:
    collection = pcii.open_collection(made[2])
    of_pair = "photons_1", "photons_2", "photons_3", "frames_1", "full-light"
    of_wall = "photons_1", "photons_2", "photons_3", "full-light"
    paths = [*(f"pair_{name}" for name in of_pair), *(f"wall_{name}" for name in of_wall)]
    assert [row["path"] for row in collection.rows] == paths
    assert len(collection[[row["values"]["half"] == "test" for row in collection.rows]]) == 4
    photons, frames, bright = collection[0], collection[3], collection[4]
    assert [*map(str, photons.lights)] == ["30", "1000", "3000"]
    assert [*map(str, collection[1].lights)] == ["30", "1000"]
    assert (frames.counts.readout.frames, frames.counts.readout.bits) == (200, 1)
    assert bright.views is not None
    assert not bright.has_counts
    verify(made[2])
    folders = [made[2], *(dataset.path for dataset in collection)]
    for file in (CARD, LICENCE):
        assert all("CC-BY-4.0" in (folder / file).read_text() for folder in folders)
    assert (made[2] / CARD).read_text().startswith("# two scenes\n")
    described = json.loads((made[2] / CROISSANT).read_text())
    assert described["license"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    assert described["distribution"][0]["sha256"] == hash_file(made[2] / INDEX)


def test_making_it_in_two_steps_gives_the_published_bytes(
    made: tuple[Definition, Path, Path], tmp_path: Path
) -> None:
    definition, file, published = made
    make_benchmark(definition, file, tmp_path / "again", half="test")
    for name in ("photons_2", "photons_3", "full-light"):
        shutil.copytree(published / f"pair_{name}", tmp_path / "again" / f"pair_{name}")
    make_benchmark(definition, file, tmp_path / "again")  # the rest
    verdict = certify(definition, file, tmp_path / "again")
    assert (verdict.compared, verdict.same_bytes, verdict.problems) == (9, 9, ())
    assert json.loads((tmp_path / "again" / CERTIFICATE).read_text())["verdict"] == verdict.sentence()
    assert "A collection of 9 datasets" in (tmp_path / "again" / CARD).read_text()
    verify(tmp_path / "again")


def test_other_draws_of_the_same_light_are_fine_and_other_light_is_not(
    made: tuple[Definition, Path, Path],
) -> None:
    published = published_certificate(made[1])["datasets"]
    first, second = published["pair_photons_2"], published["pair_photons_3"]
    verdict = compare({"x": first}, {"x": second})
    assert (verdict.same_bytes, verdict.problems) == (0, ())
    assert verdict.least_p > 1e-3
    assert "draws of the same light" in verdict.sentence()
    (problem,) = compare({"x": published["wall_photons_2"]}, {"x": first}).problems
    assert problem.startswith("x: its photons lie elsewhere")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": []}, "seeds: expected at least one, each once"),
        ({"photons_per_view": [300, 30]}, "photons_per_view: expected growing numbers"),
        ({"scene": [SCENE | {"name": "a"}, SCENE | {"name": "a"}]}, "scene: expected a name of its own"),
    ],
)
def test_bad_definitions_are_refused(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        written(tmp_path, **changes)


def test_scenes_that_are_not_there_are_named(
    made: tuple[Definition, Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["benchmark", "make", str(made[1]), "-o", str(tmp_path / "x"), "--scene", "pear"]
    assert run_simgen(*arguments) == 2
    assert "small has no 'pear'; did you mean 'pair'?" in capsys.readouterr().err
    assert run_simgen(*arguments[:-1], "pair", "--half", "test") == 2
    assert "none of these scenes is in the test half" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_the_benchmark_that_ships_has_24_scenes_of_seven_kinds_in_equal_halves() -> None:
    definition, file = load_definition("pcii-bench-1")
    halves = [scene.half for scene in definition.scene]
    assert (len(halves), halves.count("test")) == (24, 12)
    assert len({scene.kind for scene in definition.scene}) == 7
    series = BenchmarkSeries(definition, file.parent.parent)
    assert len(series) == 24 * 4 + 4
    published = published_certificate(file)
    assert published["definition_sha256"] == hash_json(definition.model_dump(mode="json"))  # it never changes
    assert [series.folder(number) for number in range(len(series))] == [*published["datasets"]]
    for number in range(len(series)):
        recipe = series.recipe(number)
        is_brighter = recipe.seed == 1 and recipe.scene not in ("glass", "drawn_shiny")
        assert recipe.photons.budget == (100_000 if is_brighter else 10_000)
        assert recipe.grid.height == recipe.grid.width == 1024
