"""Studies, on one that measures nothing: its record, its page, losses, and how times are taken."""

import inspect
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from benchmarks import __main__ as command
from benchmarks.figures import curve, frame
from benchmarks.guard import losses, reference_of
from benchmarks.page import write_page
from benchmarks.results import Measured, Record, Row, Study, Value, read_record, write_record
from benchmarks.studies import STUDIES
from benchmarks.timing import median_of, ratio_of, side_by_side
from pcii.base import InputError

TIMES = {"time_ms": Value(2.0, 1.5, 2.5), "rmse_percent": Value(0.125)}
MEASURED = Measured(
    rows=[
        Row("Errors", "ours", {"samples": 4}, TIMES),
        Row("Errors", "theirs <b>", {"samples": 16}, {"time_ms": Value(8.0)}),
        Row("Memory", "ours", {}, {"peak_mb": Value(1234.0)}),
    ],
    ratios={"ours against theirs": Value(4.0, 3.5, 4.5), "memory": Value(1.5)},
    seeds=[1, 2],
)
MACHINE = {"processor": "abacus", "cores": 2, "renderer": "scalar_rgb", "cores_in_use": 0.1}
VERSIONS = {"commit": "abc", "numpy": "2.1"}
RECORD = Record("nothing", "quick", "2026-01-02T03:04:05+00:00", 12.5, MACHINE, VERSIONS, MEASURED)


def draw(figure: Any, measured: Measured) -> None:
    axes = figure.subplots()
    curve(axes, measured.of("Errors"), "samples", "time_ms", "both", 0)
    frame(axes, "samples", "time_ms", "title")


def reading(measured: Measured) -> str:
    return f"Ours takes {measured.one('Errors', 'ours').values['time_ms'].value:g} ms. Two. Three."


STUDY = Study("nothing", "A study of nothing", {"quick": {}, "full": {}}, lambda: MEASURED, draw, reading)


def with_ratios(**ratios: float) -> Record:
    """The record with these ratios instead."""
    measured = Measured(MEASURED.rows, {name: Value(ratio) for name, ratio in ratios.items()})
    return replace(RECORD, measured=measured)


def test_a_record_reads_as_it_was_written_and_other_files_are_refused_by_name(tmp_path: Path) -> None:
    write_record(tmp_path, RECORD)
    path = tmp_path / "nothing.json"
    assert read_record(path) == RECORD
    for text in ('{"study": "nothing"}', "{"):
        path.write_text(text)
        with pytest.raises(InputError, match=r"nothing\.json: expected results of a study"):
            read_record(path)


def test_a_run_prints_its_tables_and_leaves_results_for_a_page(tmp_path: Path, capsys: Any) -> None:
    made = command.measure(STUDY, "quick", tmp_path)
    assert read_record(tmp_path / "nothing.json").measured == made.measured
    assert made.versions["numpy"]
    assert "| ours | 4 | 2 (1.5 to 2.5) | 0.125 |" in capsys.readouterr().out
    write_page(tmp_path / "page.md", [STUDY], [RECORD])
    text = (tmp_path / "page.md").read_text()
    assert "![A study of nothing](benchmarks/nothing.png)" in text
    for words in (
        "Ours takes 2 ms. Two. Three.",
        "| ours against theirs | 4 (3.5 to 4.5) |",
        "abacus, 2 cores",
    ):
        assert words in text
    with Image.open(tmp_path / "benchmarks" / "nothing.png") as picture:
        assert min(picture.size) > 300


def test_every_study_has_both_sizes_and_they_fit() -> None:
    names = [study.name for study in STUDIES]
    assert len(set(names)) == len(names)
    for study in STUDIES:
        assert set(study.sizes) == {"quick", "full"}
        for size in study.sizes.values():
            inspect.signature(study.measure).bind(**size)


def test_a_ratio_that_is_gone_nan_or_a_quarter_less_is_a_loss() -> None:
    reference = reference_of([with_ratios(fast=10.0, slow=2.0)])
    for ratios, lost in (
        ({"fast": 7.6, "slow": 2.5}, []),
        ({"fast": 7.4, "slow": 2.0}, ["nothing, fast: 7.4 instead of 10, 26% less"]),
        ({"slow": 2.0}, ["nothing, fast: was 10 and is not measured any more"]),
    ):
        assert losses([with_ratios(**ratios)], reference) == lost
    assert len(losses([with_ratios(fast=float("nan"), slow=2.0)], reference)) == 1


def test_the_command_exits_with_1_on_a_planted_loss(tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    study, results = command.STUDIES[0].name, tmp_path / "bench"
    monkeypatch.setattr(command, "REFERENCE", tmp_path / "reference.json")
    command.REFERENCE.write_text(json.dumps({study: {"size": "quick", "ratios": {"speed": 8.0}}}))
    monkeypatch.setattr("sys.argv", ["benchmarks", "guard", "--out", str(results)])
    for ratio, code in ((8.0, 0), (5.9, 1)):
        write_record(results, replace(with_ratios(speed=ratio), study=study))
        assert command.main() == code
    assert f"lost: {study}, speed: 5.9 instead of 8" in capsys.readouterr().out


def test_works_take_turns_and_the_first_round_is_not_counted() -> None:
    calls: list[tuple[str, int]] = []
    works = {name: lambda n, name=name: calls.append((name, n)) for name in "ab"}
    seconds = side_by_side(works, repeats=2)
    assert calls == [("a", 0), ("b", 0), ("a", 1), ("b", 1), ("a", 2), ("b", 2)]
    assert {name: len(taken) for name, taken in seconds.items()} == {"a": 2, "b": 2}


def test_intervals_of_medians_are_order_statistics_and_ratios_are_taken_round_by_round() -> None:
    # Both ends of 6 miss the median with the probability 2 / 2^6 = 3 %, of 5 with 6 %.
    assert median_of([1.0, 2.0, 3.0, 4.0, 5.0]).low is None
    six = median_of([6.0, 1.0, 5.0, 2.0, 4.0, 3.0], scale=10)
    assert (six.value, six.low, six.high) == (35, 10, 60)
    # Of 12 the third on either side: 2 (1 + 12 + 66) / 2^12 = 3.9 %.
    twelve = median_of([float(n) for n in range(1, 13)])
    assert (twelve.low, twelve.high) == (3, 10)
    # Were they of medians, the slow third round of both would count.
    assert ratio_of([2.0, 4.0, 90.0], [1.0, 1.0, 30.0], scale=10).value == 30
