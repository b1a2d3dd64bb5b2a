from pathlib import Path

import pytest
from records import record, with_ratios

from benchmarks import __main__ as command
from benchmarks.guard import losses, read_reference, reference_of, write_reference
from benchmarks.results import write_record


def test_a_loss_above_a_quarter_is_named(tmp_path: Path) -> None:
    write_reference([with_ratios(fast=10.0, slow=2.0)], tmp_path / "reference.json")
    reference = read_reference(tmp_path / "reference.json")
    assert losses([with_ratios(fast=7.6, slow=2.5)], reference) == []
    assert losses([with_ratios(fast=7.4, slow=2.0)], reference) == [
        "nothing, fast: 7.4 instead of 10, 26% less"
    ]


def test_a_ratio_that_is_gone_or_nan_is_a_loss() -> None:
    reference = reference_of([with_ratios(fast=10.0)])
    assert losses([with_ratios(other=10.0)], reference) == [
        "nothing, fast: was 10 and is not measured any more"
    ]
    assert len(losses([with_ratios(fast=float("nan"))], reference)) == 1


def test_the_command_exits_with_1_on_a_planted_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study = command.STUDIES[0].name
    results = tmp_path / "bench"
    reference = {study: {"size": "quick", "ratios": {"speed": 8.0}}}
    monkeypatch.setattr(command, "read_reference", lambda: reference)
    for ratio, code in ((8.0, 0), (5.9, 1)):
        found = with_ratios(speed=ratio)
        write_record(results, record(study=study, measured=found.measured))
        assert run(monkeypatch, "guard", "--out", str(results)) == code
    assert f"lost: {study}, speed: 5.9 instead of 8" in capsys.readouterr().out


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["benchmarks", *arguments])
    return command.main()
