"""A benchmark of two small scenes: made, resumed, certified, and compared with other datasets."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from small_benchmark import SCENE, written

import pcii
from pcii.base import InputError, command_line
from pcii.store import CARD, CERTIFICATE, CROISSANT, INDEX, LICENCE, hash_file, hash_json, verify
from simgen.app import commands
from simgen.dataset import Definition, certify, load_definition, make_benchmark
from simgen.dataset.benchmark_making import BenchmarkSeries, compare

pytestmark = pytest.mark.renders


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
    assert command_line.run(commands.app, arguments) == 2
    assert "small has no 'pear'; did you mean 'pair'?" in capsys.readouterr().err
    assert command_line.run(commands.app, [*arguments[:-1], "pair", "--half", "test"]) == 2
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
