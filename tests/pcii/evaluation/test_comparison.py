"""Evaluations of made-up methods, every figure by hand; killed, shared, and refused."""

import json
import shutil
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import numba as nb
import numpy as np
import pytest
from slow_clock import SlowClock
from stored_datasets import flip_a_bit, rewrite_manifest
from tiny_datasets import NESTED, OWN, by_count, two_rows, write_dataset

from pcii.app import commands as cli
from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.base.executor import Executor
from pcii.evaluation import evaluation_pages
from pcii.evaluation.comparison import evaluate, find_datasets
from pcii.evaluation.rows import all_rows, append_row, claim_rows
from pcii.evaluation.summary import summarise
from pcii.evaluation.tables import overview
from pcii.removal.methods import METHODS
from pcii.store.dataset import open_dataset
from pcii.store.dataset_layout import MANIFEST, TRUTH, read_manifest
from pcii.store.folders import EVALUATION, ROWS
from pcii.store.verification import verify
from pcii.types.estimates import DepthMap

HITS = {3: (6, 10), 4: (8, 10), 5: (7, 10)}  # of ten pixels, by seed: at the own budget and the nested one
FAKES = ("by count", "two rows")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Makes the fake methods known; every call of one is noted."""
    noted: list[str] = []
    for method in (by_count, two_rows):
        name = method.__name__.replace("_", " ")

        def noting(counts: Any, z_mm: Any, name: str = name, method: Any = method) -> Any:
            noted.append(name)
            return method(counts, z_mm)

        monkeypatch.setitem(METHODS, name, noting)
    return noted


def write_series(folder: Path) -> Path:
    for seed, (own, nested) in HITS.items():
        write_dataset(folder / f"seed_{seed}", seed, {NESTED: nested, OWN: own})
    return folder


@pytest.fixture
def series(tmp_path: Path) -> Path:
    return write_series(tmp_path / "data")


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The fake methods compared on the series, and the folder of the evaluation."""
    folder = tmp_path_factory.mktemp("evaluated")
    with pytest.MonkeyPatch.context() as patch:
        for name, method in zip(FAKES, (by_count, two_rows), strict=True):
            patch.setitem(METHODS, name, method)
        return evaluate([write_series(folder / "data")], folder / "out", methods=FAKES), folder / "out"


def result_of(evaluation: dict[str, Any], budget: float, method: str) -> dict[str, Any]:
    rows = evaluation["groups"][0]["results"]
    return next(row for row in rows if (row["budget"], row["method"]) == (budget, method))


def rows_of(out: Path) -> list[dict[str, Any]]:
    with all_rows(out) as rows:
        return rows


def test_every_figure_by_hand(evaluated: tuple[dict[str, Any], Path]) -> None:
    evaluation, out = evaluated
    (group,) = evaluation["groups"]
    assert (group["title"], group["scene"], group["datasets"]) == ("by hand", "by hand", 3)
    written = json.loads((out / EVALUATION).read_text())
    assert {name: written[name] for name in evaluation} == evaluation
    assert verify(out) == len({ROWS, "evaluation.html", "evaluation.md"})
    result = result_of(evaluation, OWN, "by count")
    near, far = result["planes"]
    # 0.6, 0.8, 0.7 of the near object: mean 0.7, half width 4.302653 * 0.1 / sqrt(3) = 0.248414.
    assert near["z_mm"] == 1.0
    assert near["object"]["iou"]["n"] == result["seeds"] == 3
    assert near["object"]["iou"]["mean"] == pytest.approx(0.7)
    assert near["object"]["iou"]["interval"] == pytest.approx([0.451586, 0.948414], abs=1e-6)
    assert near["object"]["precision"] == {"n": 3, "mean": 1.0, "interval": [1.0, 1.0]}
    assert near["object"]["photon_recall"] is None  # these photons have no known origin
    assert far["object"]["iou"]["mean"] == 1.0
    # Over both planes 0.8, 0.9, 0.85; the points of each object are in focus at its plane alone.
    assert result["object"]["iou"]["mean"] == pytest.approx(0.85)
    assert result["object"]["iou"]["interval"] == pytest.approx([0.725793, 0.974207], abs=1e-6)
    assert result["pixel"]["iou"] == result["object"]["iou"]
    # Of 24 pixels the near object is 10, the far one 0, in every dataset.
    rows = result_of(evaluation, OWN, "two rows")
    assert rows["object"]["iou"]["mean"] == pytest.approx(10 / 24 / 2)
    assert rows["planes"][1]["object"]["iou"]["mean"] == 0.0
    assert rows["object"]["claimed_share"] == {"n": 3, "mean": 0.25, "interval": [0.25, 0.25]}
    # Each object is flat and at its plane, so who knows the depths makes no mistake.
    assert rows["pixel"]["iou_oracle"]["mean"] == 1.0
    # 96 photons in the last view and 20 + 6, 8, 7 in the first, of four views.
    assert result["photons_per_view"] == pytest.approx((96 + 20 + 7) / 4)


def test_methods_are_compared_on_the_same_datasets(evaluated: tuple[dict[str, Any], Path]) -> None:
    (group,) = evaluated[0]["groups"]
    nested, own = group["paired"]
    assert (nested["budget"], own["budget"]) == (NESTED, OWN)
    assert own["methods"] == ["by count", "two rows"]
    assert own["difference"]["mean"] == pytest.approx(0.85 - 10 / 48)
    assert own["p"] == 2 / 8
    assert own["exact"]
    # Three equal differences have an interval without width.
    assert nested["difference"]["interval"] == pytest.approx([1 - 10 / 48] * 2)


def test_a_significant_fall_with_more_photons_is_listed(evaluated: tuple[dict[str, Any], Path]) -> None:
    (group,) = evaluated[0]["groups"]
    # From 1 to 0.8, 0.9, 0.85: -0.15, half width 4.302653 * 0.05 / sqrt(3) = 0.124207. "two rows" stays.
    (fall,) = group["monotonic"]
    assert (fall["method"], fall["from"], fall["to"]) == ("by count", NESTED, OWN)
    assert fall["difference"]["mean"] == pytest.approx(-0.15)
    assert fall["difference"]["interval"] == pytest.approx([-0.274207, -0.025793], abs=1e-6)


def test_an_insignificant_fall_is_not_listed(tmp_path: Path, calls: list[str]) -> None:
    for seed, hits in ((1, 5), (2, 9)):  # -0.25 and -0.05: half width 12.7 * 0.1
        write_dataset(tmp_path / "data" / f"seed_{seed}", seed, {NESTED: 10, OWN: hits})
    (group,) = evaluate([tmp_path / "data"], tmp_path / "out", methods=FAKES)["groups"]
    assert group["monotonic"] == []


def test_one_dataset_has_no_intervals(series: Path, tmp_path: Path, calls: list[str]) -> None:
    evaluation = evaluate([series / "seed_3"], tmp_path / "out", methods=FAKES, budgets=[OWN])
    row = result_of(evaluation, OWN, "by count")
    assert row["object"]["iou"] == {"n": 1, "mean": pytest.approx(0.8), "interval": None}
    assert row["seconds"]["interval"] is None
    assert evaluation["groups"][0]["paired"][0]["p"] == 1.0
    assert "0.800 |" in (tmp_path / "out" / "evaluation.md").read_text()


def change_recipe(dataset: Path, **settings: Any) -> None:
    manifest = read_manifest(dataset)
    identity = f"{manifest.identity} {settings}"
    rewrite_manifest(dataset, recipe={**manifest.recipe, **settings}, identity=identity)


def test_groups_of_one_title_are_labelled_by_the_settings_that_differ(
    tmp_path: Path, calls: list[str]
) -> None:
    data = [write_dataset(tmp_path / f"data {number}", 1, {OWN: 2 + number}) for number in range(4)]
    change_recipe(data[1], scene="another", grid={"rows": 4}, exposure=None)
    change_recipe(data[2], scene="another", grid={"rows": 6}, exposure={"time_s": 1.0})
    change_recipe(data[3], title="of its own")  # the manifest's `title` stays the same
    other = write_dataset(tmp_path / "other", 1, {OWN: 9}, title="other")
    evaluation = evaluate([*data, other], tmp_path / "out", methods=["by count"])
    table = overview(evaluation["groups"])
    cells = {row[0]: row[2] for row in table.rows}
    assert len(table.rows) == len(cells) == 5
    assert cells["by hand (scene=another, grid.rows=6)"] == "0.700"
    assert cells["by hand (scene=another, grid.rows=4)"] == "0.650"
    assert cells["other"] == "0.950"
    # These two have the same settings, and differ by the hashes of their recipes.
    left = {row["label"]: row["recipe"][:8] for row in evaluation["groups"] if row["scene"] == "by hand"}
    assert list(left) == [f"by hand (scene=by hand, recipe {recipe})" for recipe in left.values()]
    page = (tmp_path / "out" / "evaluation.html").read_text()
    assert "<h2>by hand (scene=another, grid.rows=6)</h2>" in page
    assert "## by hand (scene=another, grid.rows=6)\n" in (tmp_path / "out" / "evaluation.md").read_text()


def test_what_a_later_dataset_needs_compiled_is_no_time_of_the_method(
    series: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop, clock, calls = nb.njit(lambda n: n + 1), SlowClock(monkeypatch), 0

    def late(counts: Any, sections: Any) -> Any:
        nonlocal calls
        calls += 1
        if counts.total != first_total:  # of the first dataset: the others take another path
            clock.go_on(1 if loop.signatures else 100)
            loop(counts.total)
        clock.go_on(1)
        return by_count(counts, sections)

    monkeypatch.setitem(METHODS, "late", late)
    first_total = open_dataset(series / "seed_3").counts.total
    evaluation = evaluate([series], tmp_path / "out", methods=["late"], budgets=[OWN])
    assert calls == 5  # three, the warm-up and the one that compiled
    assert sorted(row["seconds"] for row in rows_of(tmp_path / "out")) == [1, 2, 2]
    interval = result_of(evaluation, OWN, "late")["seconds"]["interval"]
    assert interval[0] > 0


def entropies(seed: int, ball: tuple[float, float], bird: tuple[float, float]) -> dict[str, Any]:
    planes = [{"z_mm": z, "object": name, "truth": "object", "iou": 0.5} for z, name in OWNERS.items()]
    objects = [
        {"name": name, "entropy": dict(zip(("540", "620"), bits, strict=True))}
        for name, bits in (("ball", ball), ("bird", bird))
    ]
    head = {"dataset": f"seed_{seed}", "identity": str(seed), "recipe": "r", "title": "t", "scene": "s"}
    return head | {
        "seed": seed,
        "budget": 1000.0,
        "method": "three-step",
        "photons_per_view": 1.0,
        "seconds": 1.0,
        "planes": planes,
        "objects": objects,
    }


OWNERS = {540.0: "ball", 620.0: "bird"}


def test_table_1_is_counted_over_seeds() -> None:
    rows = [
        entropies(1, (1.0, 1.5), (1.25, 1.0)),
        entropies(2, (1.0, 1.25), (1.0, 1.25)),
        entropies(3, (1.0, 1.75), (1.5, 1.0)),
    ]
    ball, bird = summarise(rows)["groups"][0]["table1"]
    assert ball == {
        "budget": 1000.0,
        "object": "ball",
        "own_z_mm": 540.0,
        "seeds": 3,
        "lowest_at_own": 3,
        "smallest_gap_bits": 0.25,
        "mean_gap_bits": 0.5,
    }
    assert (bird["own_z_mm"], bird["lowest_at_own"], bird["smallest_gap_bits"]) == (620.0, 2, -0.25)
    assert bird["mean_gap_bits"] == pytest.approx(0.5 / 3)


def test_a_depth_map_without_estimates_is_reported_as_such(
    series: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = DepthMap(np.full((8, 12), np.nan), np.zeros((8, 12)))
    comparison = import_module("pcii.evaluation.comparison")
    monkeypatch.setattr(comparison, "estimate_depth", lambda *_, **__: nothing)
    evaluation = evaluate([series], tmp_path / "out", methods=["depth"])
    row = result_of(evaluation, OWN, "depth:posterior")
    assert row["depth"]["ece"] is row["depth"]["reliability"] is None
    assert row["depth"]["coverage"] == {"n": 3, "mean": 0.0, "interval": [0.0, 0.0]}
    assert row["depth"]["mae_mm"] is None
    assert row["depth"]["bad_1px"]["mean"] == 1.0
    assert "### Depth" in (tmp_path / "out" / "evaluation.md").read_text()


def test_what_is_measured_is_not_measured_again(series: Path, tmp_path: Path, calls: list[str]) -> None:
    evaluate([series], tmp_path / "out", methods=["by count"])
    assert len(calls) == 3 * 2 + 2  # a row for each dataset and budget, and one call that warms up by budget
    first = rows_of(tmp_path / "out")
    evaluate([series, series / "seed_3"], tmp_path / "out", methods=["by count"])
    assert len(calls) == 8
    told = list[tuple[str, int, int]]()
    evaluate([series], tmp_path / "out", methods=FAKES, report=lambda *stage: told.append(stage))
    assert told[0] == ("scores of an earlier run", 6, 6)
    assert told[-3:] == [("scores", 6, 6), ("pages", 0, 1), ("pages", 1, 1)]
    assert set(calls[8:]) == {"two rows"}
    assert rows_of(tmp_path / "out")[:6] == first


def near_plane(data: Any, z_range_mm: tuple[float, float]) -> DepthMap:
    return DepthMap(np.ones((8, 12)), np.ones((8, 12)))


def test_functions_are_compared_like_methods_with_a_name(series: Path, tmp_path: Path) -> None:
    """By one process and by two, which share the work."""
    methods = [by_count, ("rows", two_rows), ("depth:near", near_plane), "variance"]
    asked: dict[str, Any] = {"methods": methods, "budgets": [OWN]}
    evaluation = evaluate([series], tmp_path / "alone", **asked)
    assert result_of(evaluation, OWN, "by_count")["object"]["iou"]["mean"] == pytest.approx(0.85)
    assert result_of(evaluation, OWN, "rows")["object"]["iou"]["mean"] == pytest.approx(10 / 48)
    assert result_of(evaluation, OWN, "depth:near")["depth"]["bad_1px"]["mean"] == 0.5
    shared = evaluate([series], tmp_path / "out", **asked, executor=Executor(2))
    assert without_seconds(shared) == without_seconds(evaluation)
    assert len(rows_of(tmp_path / "out")) == len(rows_of(tmp_path / "alone")) == 12
    # Nobody knows what they follow from, so they are measured whenever they are named.
    (again,) = evaluate([series], tmp_path / "out", **asked)["again"]
    why, names = "what makes them is not known", ["by_count", "depth:near", "rows"]
    assert again == {"why": why, "rows": 9, "methods": names}
    kept = evaluate([series], tmp_path / "out", methods=["variance"], budgets=[OWN])
    assert kept["again"] == []
    assert [row["method"] for row in kept["groups"][0]["results"]] == [*names, "variance"]


@pytest.mark.parametrize(
    ("methods", "sentence"),
    [
        ([by_count, by_count], "the name 'by_count' is taken"),
        (
            [("likelihood", by_count)],
            r"the name 'likelihood' is taken; give a pair \(another name, function\)",
        ),
        ([("mine", 3)], r"expected names, functions, or pairs \(name, function\), got \('mine', 3\)"),
        ([("mine", lambda counts, sections: None)], "'mine' cannot be sent to other processes; define it"),
    ],
)
def test_functions_that_cannot_be_compared_are_refused(
    series: Path, tmp_path: Path, methods: list[Any], sentence: str
) -> None:
    with pytest.raises(InputError, match=f"^methods: {sentence}"):
        evaluate([series], tmp_path / "out", methods=methods, executor=Executor(2))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("left", [1, -1])
def test_a_killed_evaluation_goes_on_where_it_was(
    evaluated: tuple[dict[str, Any], Path], tmp_path: Path, calls: list[str], left: int
) -> None:
    whole, done = evaluated
    out = tmp_path / "killed"
    shutil.copytree(done, out)
    *lines, last, _ = (out / ROWS).read_bytes().split(b"\n")
    (out / ROWS).write_bytes(b"\n".join(lines) + b"\n" + last[:left])  # killed in the middle of a line
    again = evaluate([done.parent / "data"], out, methods=FAKES)
    assert len(calls) == 2  # the torn row, and its warm-up
    assert without_seconds(again) == without_seconds(whole)
    assert len((out / ROWS).read_bytes().splitlines()) == len(lines) + 1


def without_seconds(evaluation: dict[str, Any]) -> dict[str, Any]:
    copy = json.loads(json.dumps(evaluation))
    for group in copy["groups"]:
        for row in group["results"]:
            del row["seconds"]
    return copy


def test_many_writers_leave_whole_lines(tmp_path: Path) -> None:
    claim_rows(tmp_path / "out")

    def write(writer: int) -> None:
        for number in range(40):
            append_row(
                tmp_path / "out", {"identity": f"{writer}-{number}" * 50, "budget": 1.0, "method": "m"}
            )

    threads = [Thread(target=write, args=(writer,)) for writer in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(rows_of(tmp_path / "out")) == 160


def test_a_flipped_bit_of_a_row_is_never_summed_up(
    evaluated: tuple[dict[str, Any], Path], tmp_path: Path
) -> None:
    rows, rng = tmp_path / ROWS, np.random.default_rng(8)
    whole = (evaluated[1] / ROWS).read_bytes()
    for bit in rng.integers(8 * (len(whole) - 1), size=100):  # all but the last line break
        rows.write_bytes(whole)
        flip_a_bit(rows, int(bit))
        with pytest.raises(InputError, match=r"rows.jsonl: line \d+: .*; delete that line"):
            rows_of(tmp_path)


def test_an_evaluation_that_grew_is_whole_once_its_pages_are_written(
    series: Path, tmp_path: Path, calls: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, write = tmp_path / "out", evaluation_pages.write_bytes_safely
    evaluate([series], out, methods=FAKES[:1])
    before = (out / EVALUATION).read_bytes()

    def killed(path: Path, content: bytes) -> None:
        if path.name == "evaluation.html":
            (out / f".{path.name}.x.tmp").touch()
            raise KeyboardInterrupt
        write(path, content)

    monkeypatch.setattr(evaluation_pages, "write_bytes_safely", killed)
    with pytest.raises(KeyboardInterrupt):
        evaluate([series], out, methods=FAKES)
    assert (out / EVALUATION).read_bytes() == before
    with pytest.raises(InputError, match=r"rows.jsonl: .*repeat the `pcii evaluate` command"):
        verify(out)
    monkeypatch.setattr(evaluation_pages, "write_bytes_safely", write)
    calls.clear()
    evaluate([series], out, methods=FAKES)
    assert calls == []
    assert verify(out) == 3
    (out / EVALUATION).unlink()
    with pytest.raises(InputError, match=r"out: unfinished; the same `pcii evaluate` command"):
        verify(out)


def test_datasets_are_found_in_the_order_of_their_seeds(tmp_path: Path) -> None:
    for seed in (2, 10, 9):
        write_dataset(tmp_path / "data" / f"seed_{seed}", seed, {OWN: 5})
    (tmp_path / "data" / "notes").mkdir()
    assert [path.name for path in find_datasets([tmp_path / "data"])] == ["seed_2", "seed_9", "seed_10"]


def test_an_unfinished_dataset_is_not_passed_over(series: Path, tmp_path: Path) -> None:
    (series / "seed_4" / MANIFEST).unlink()
    with pytest.raises(InputError, match=r"seed_4: not a finished dataset"):
        evaluate([series], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_evaluated_is_refused_before_any_work(
    series: Path, tmp_path: Path, calls: list[str]
) -> None:
    out = tmp_path / "out"
    with pytest.raises(InputError, match="no method named 'guess'"):
        evaluate([series], out, methods=["guess"])
    with pytest.raises(InputError, match="no photons of budget 7"):
        evaluate([series], out, methods=FAKES, budgets=[7])
    with pytest.raises(InputError, match="no such dataset folder"):
        evaluate([tmp_path / "nowhere"], out)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="neither a finished dataset nor"):
        evaluate([tmp_path / "empty"], out)
    with pytest.raises(InputError, match="at least one"):
        evaluate([], out)
    with pytest.raises(InputError, match="holds something else"):
        evaluate([series], series, methods=FAKES)
    files = read_manifest(series / "seed_3").files
    others = {name: entry for name, entry in files.items() if not name.startswith(TRUTH)}
    rewrite_manifest(series / "seed_3", files=others)
    with pytest.raises(InputError, match="has no truth"):
        evaluate([series], out, methods=FAKES)
    assert calls == []
    assert not out.exists()


def test_depths_are_given_where_the_recipe_names_none(
    series: Path, tmp_path: Path, calls: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    for path in find_datasets([series]):
        rewrite_manifest(path, analysis={})
    command = ["evaluate", str(series), "-o", str(out), "--method", "by count"]
    assert command_line.run(cli.app, command) == 2
    assert "suggests no depths; name depths with --z-mm" in capsys.readouterr().err
    assert command_line.run(cli.app, [*command, "--z-mm", "1", "--z-mm", "2"]) == 0
    assert {plane["z_mm"] for row in rows_of(out) for plane in row["planes"]} == {1, 2}
    calls.clear()
    evaluation = evaluate([series], out, methods=["by count"], z_mm=[1, 2])
    assert calls == []  # nothing is measured twice
    assert result_of(evaluation, OWN, "by count")["object"]["iou"]["mean"] == pytest.approx(0.85)
    # Other depths are another group, with figures of their own.
    evaluation = evaluate([series], out, methods=["by count"], z_mm=[1])
    planes = {
        group["label"]: [plane["z_mm"] for plane in group["results"][0]["planes"]]
        for group in evaluation["groups"]
    }
    assert sorted(planes.values()) == [[1], [1, 2]]
    assert any("analysis.z_mm=[1]" in label for label in planes)


def test_the_command_and_its_page(
    evaluated: tuple[dict[str, Any], Path],
    tmp_path: Path,
    calls: list[str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    shutil.copytree(evaluated[1], out)
    command = ["evaluate", str(evaluated[1].parent / "data"), "-o", str(out), "--method", "by count"]
    command += ["--method", "two rows"]
    assert command_line.run(cli.app, command) == 0
    assert "evaluation.html" in capsys.readouterr().out
    page = (out / "evaluation.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert "<script" not in page
    assert "://" not in page
    assert str(tmp_path) not in page
    assert "0.850 (0.726 to 0.974)" in page
    assert "IoU of by count is lower with 50 photons than with 20" in page
    assert calls == []
    other = write_dataset(tmp_path / "other", 3, {OWN: 5}, title="another")
    assert command_line.run(cli.app, [*command[:2], str(other), *command[2:], "--budget", str(OWN)]) == 0
    assert len(rows_of(out)) == 12 + 2
    assert command_line.run(cli.app, [*command, "--workers", "0"]) == 2
    assert "workers: expected a whole number from 1" in capsys.readouterr().err
