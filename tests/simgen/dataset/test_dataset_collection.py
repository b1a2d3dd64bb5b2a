"""Collections: each dataset is what it would be alone, whoever makes it; resumed, shared, extended."""

import multiprocessing
import shutil
import threading
import time
from pathlib import Path

import pytest
from digests import digest
from tiny import GRID_2_X_3

from pcii.base import Executor, InputError, WorkerLostError, command_line, locked
from pcii.store import CARD, COLLECTION, INDEX, MARKER, open_collection, open_dataset, provenance, verify
from simgen.app import commands as cli
from simgen.dataset import dataset_collection, generate, generate_collection
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
    assert command_line.run(cli.app, ["generate", str(recipe_file), "-o", str(out), "--seeds", "3"]) == 0
    return out


def sweep_of(recipe_file: Path, seeds: int = 3, *overrides: str) -> Sweep:
    return load_sweep(str(recipe_file), overrides, seeds=seeds)


def digest_of_all(collection: Path) -> dict[str, dict[str, str]]:
    rows = open_collection(collection).rows
    return {row["path"]: digest(collection / row["path"]) for row in rows}


def test_the_index_says_what_the_manifests_say(collection: Path) -> None:
    opened = open_collection(collection)
    names = [f"budget_{budget}_seed_{seed}" for budget in (100, 200) for seed in (7, 8, 9)]
    assert [row["path"] for row in opened.rows] == names
    assert {entry.name for entry in collection.iterdir()} == {COLLECTION, INDEX, CARD, *names}
    for row, dataset in zip(opened.rows, opened, strict=True):
        recipe = dataset.manifest["recipe"]
        assert row["values"] == {"photons.budget": recipe["photons"]["budget"], "seed": recipe["seed"]}
        assert row["photons"] == dataset.counts.total
    assert verify(collection) > 6


def test_each_dataset_is_what_its_recipe_alone_gives(
    recipe_file: Path, collection: Path, tmp_path: Path
) -> None:
    recipe, near = load_recipe(str(recipe_file), ["seed=9", "photons.budget=200"])
    manifest = generate(recipe, near, tmp_path / "alone")
    assert digest(tmp_path / "alone") == digest(collection / "budget_200_seed_9")
    assert open_dataset(collection / "budget_200_seed_9").manifest["identity"] == manifest["identity"]


def test_what_is_finished_is_left_alone_and_what_is_missing_is_made(
    recipe_file: Path, collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "copy"
    shutil.copytree(collection, out)
    names, original = list[str](), dataset_collection.make
    monkeypatch.setattr(
        dataset_collection, "make", lambda *args: names.append(args[1].name) or original(*args)
    )
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
    assert command_line.run(cli.app, command) == 0
    (out / "seed_8").mkdir()
    (out / "seed_8" / "notes.txt").write_text("mine")
    assert command_line.run(cli.app, [*command[:-1], "3"]) == 1
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
    assert digest_of_all(out) == digest_of_all(collection)
