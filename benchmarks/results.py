"""What a study measures: rows of values with intervals, ratios of pairs, and their files.

Names of quantities end in their unit where they have one (`time_ms`, `rmse_percent`); `label` writes them in
words.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pcii.base import InputError, write_json_safely
from pcii.evaluation import mean_interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Size = Literal["quick", "full"]
Parameter = str | int | float
UNITS = {
    "s": "s", "ms": "ms", "us": "µs", "percent": "%", "mb": "MB", "px": "px", "mm": "mm", "bits": "bits",
}  # fmt: skip
SPELLINGS = {
    "1px": "1 px", "badpix 007": "BadPix(0.07)", "boundary f": "boundary F", "flip": "FLIP", "iou": "IoU",
    "rmse": "RMSE", "mse": "MSE",
}  # fmt: skip
"""Words that are written in another way than names of quantities."""


@dataclass(frozen=True)
class Value:
    """A number and its 95 % interval, None where there is none."""

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Row:
    """What was measured of `name` with these parameters; rows of one `table` have the same quantities."""

    table: str
    name: str
    parameters: Mapping[str, Parameter]
    values: Mapping[str, Value]


@dataclass(frozen=True)
class Measured:
    """The rows and ratios of one run of a study, and the seeds that they are of.

    A ratio, by its name, says how many times better ours is than what was measured beside it in the same run.
    """

    rows: Sequence[Row]
    ratios: Mapping[str, Value] = field(default_factory=dict)
    seeds: Sequence[int] = ()

    def of(self, table: str, **parameters: Parameter) -> list[Row]:
        """The rows of a table that have these parameters."""
        wanted = parameters.items()
        return [row for row in self.rows if row.table == table and wanted <= dict(row.parameters).items()]

    def one(self, table: str, name: str, **parameters: Parameter) -> Row:
        """The first of these rows with this name; `KeyError` if there is none."""
        for row in self.of(table, **parameters):
            if row.name == name:
                return row
        raise KeyError(f"{table}: {name} {parameters}")


@dataclass(frozen=True)
class Study:
    """A question, how it is measured and drawn, and how to read what is found.

    `sizes` are the arguments of `measure`. The numbers in the sentences of `reading` come from the results.
    """

    name: str
    title: str
    sizes: Mapping[Size, Mapping[str, Any]]
    measure: Callable[..., Measured]
    draw: Callable[["Figure", Measured], None]
    reading: Callable[[Measured], str]
    width_in: float = 9.0
    height_in: float = 3.6


@dataclass(frozen=True)
class Record:
    """A run of a study with all that is needed to judge it: size, date, wall time, machine, versions."""

    study: str
    size: Size
    date: str
    wall_s: float
    machine: Mapping[str, Any]
    versions: Mapping[str, str]
    measured: Measured = field(repr=False)


def label(quantity: str) -> str:
    """A quantity or parameter in words, its unit after a comma.

    >>> label("time_ms"), label("photons_per_view"), label("rmse_percent")
    ('time, ms', 'photons per view', 'RMSE, %')
    """
    *words, last = quantity.split("_")
    text = " ".join(words) + f", {UNITS[last]}" if words and last in UNITS else " ".join((*words, last))
    for name, written in SPELLINGS.items():
        text = text.replace(name, written)
    return text


def mean_of(samples: Iterable[float]) -> Value:
    """Mean of samples that are never negative, with its interval; without one for a single sample.

    The interval is Student's of the mean's logarithm, so that it stays above 0.
    """
    return value_of(mean_interval(list(samples), "positive"))


def value_of(mean: Any, scale: float = 1.0) -> Value:
    """A mean of `pcii.evaluation` times `scale`; that of one sample has no interval."""
    value = scale * mean.mean
    return Value(value) if mean.n == 1 else Value(value, scale * mean.low, scale * mean.high)


def write_record(folder: Path, record: Record) -> None:
    """Write <study>.json."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json_safely(folder / f"{record.study}.json", asdict(record))


def read_record(path: Path) -> Record:
    """A run as `write_record` wrote it; `InputError` for a file that is something else."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        measured = content.pop("measured")
        rows = [Row(**row | {"values": _values_of(row["values"])}) for row in measured["rows"]]
        measurements = Measured(rows, _values_of(measured["ratios"]), measured["seeds"])
        return Record(**content, measured=measurements)
    except (ValueError, TypeError, KeyError, AttributeError) as fault:
        raise InputError(
            f"{path}: expected results of a study, as `make bench` writes them ({fault})"
        ) from None


def _values_of(content: Mapping[str, Any]) -> dict[str, Value]:
    return {name: Value(**found) for name, found in content.items()}
