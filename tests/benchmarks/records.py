"""A study that measures nothing, and its record."""

from dataclasses import replace
from typing import Any

from benchmarks.figures import curve, frame
from benchmarks.results import Measured, Record, Row, Study, Value

MEASURED = Measured(
    rows=[
        Row(
            "Errors", "ours", {"samples": 4}, {"time_ms": Value(2.0, 1.5, 2.5), "rmse_percent": Value(0.125)}
        ),
        Row("Errors", "theirs <b>", {"samples": 16}, {"time_ms": Value(8.0)}),
        Row("Memory", "ours", {}, {"peak_mb": Value(1234.0)}),
    ],
    ratios={"ours against theirs": Value(4.0, 3.5, 4.5), "memory": Value(1.5)},
    seeds=[1, 2],
)


def _draw(figure: Any, measured: Measured) -> None:
    axes = figure.subplots()
    curve(axes, measured.of("Errors"), "samples", "time_ms", "both", 0)
    frame(axes, "samples", "time_ms", "title")


STUDY = Study(
    "nothing",
    "A study of nothing",
    {"quick": {}, "full": {}},
    lambda: MEASURED,
    _draw,
    lambda measured: f"Ours takes {measured.one('Errors', 'ours').values['time_ms'].value:g} ms. Two. Three.",
)
MACHINE = {"processor": "abacus", "cores": 2, "renderer": "scalar_rgb", "cores_in_use": 0.1}


def record(**changes: Any) -> Record:
    """The record of a quick run of `STUDY`, with other values of some fields."""
    own = Record(
        "nothing",
        "quick",
        "2026-01-02T03:04:05+00:00",
        12.5,
        MACHINE,
        {"commit": "abc", "numpy": "2.1"},
        MEASURED,
    )
    return replace(own, **changes)


def with_ratios(**ratios: float) -> Record:
    """The record with these ratios instead."""
    return record(measured=Measured(MEASURED.rows, {name: Value(ratio) for name, ratio in ratios.items()}))
