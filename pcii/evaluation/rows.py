"""Rows of an evaluation: rows.jsonl, which grows while methods are measured.

It has one JSON object for each dataset, light and method. What is measured again, since other software made
it, is added below, and the last row counts.
"""

import json
import os
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, Literal, NotRequired

from pcii.base.errors import InputError
from pcii.base.safe_files import locked, named_in_errors
from pcii.store.folders import EVALUATION_FOLDER, ROWS

if TYPE_CHECKING:
    from pydantic import TypeAdapter

Row = dict[str, Any]
Key = tuple[str, float | str | None, str, tuple[float, ...]]
HEAD = ("scene", "light", "method", "dataset", "seed", "identity", "recipe", "z_mm", "objects")
"""Columns of the frame of an evaluation that say of what a row is: no measure has such a name."""


def leaves(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables by its dotted name, as `--set` takes it."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _measures(scores: Any) -> Any:
    """Scores by their dotted names; raises ValueError for a name of another column of the frame."""
    measures = dict(leaves(scores)) if isinstance(scores, dict) else {}
    if names := {*HEAD} & measures.keys():
        raise ValueError(f"{min(names)!r} is no name of a measure")
    return measures or scores


def plane_parts(plane: Mapping[str, Any]) -> Row:
    """A plane with its scores as one member."""
    scores = dict(plane)
    parts = {name: scores.pop(name) for name in ("z_mm", "object", "truth") if name in scores}
    return parts | {"scores": scores}


@cache
def _row_model() -> "TypeAdapter[Any]":
    """The model of a row, made when the first is read: pydantic is slow to load."""
    from pydantic import BeforeValidator, Field, TypeAdapter
    from typing_extensions import TypedDict

    from pcii.store.manifests import OPEN, Text

    is_not_negative, by_names = Field(ge=0), BeforeValidator(_measures)

    class Plane(TypedDict):
        __pydantic_config__ = OPEN  # type: ignore[misc]
        z_mm: float
        object: Text | None
        truth: Literal["object", "pixel"]
        scores: Annotated[dict[str, float | None], by_names]

    class RowModel(TypedDict):
        __pydantic_config__ = OPEN  # type: ignore[misc]
        dataset: Text
        identity: Text
        recipe: Text
        title: Text
        method: Text
        budget: Annotated[float, is_not_negative] | Literal["full-light"] | None
        seed: NotRequired[float | None]
        settings: NotRequired[dict[str, Any]]
        z_mm: NotRequired[list[float]]
        photons_per_view: NotRequired[Annotated[float, is_not_negative] | None]
        seconds: NotRequired[Annotated[float, is_not_negative] | None]
        software: NotRequired[dict[str, Text] | None]
        date: NotRequired[Text]
        machine: NotRequired[Text]
        bound_px: NotRequired[float | None]
        depth: NotRequired[Annotated[dict[str, float | None], by_names]]
        planes: NotRequired[list[Annotated[Plane, BeforeValidator(plane_parts)]]]

    return TypeAdapter(RowModel)


def key_of(row: Mapping[str, Any]) -> Key:
    """Identity of the dataset, light and method of a row, and depths that replace the dataset's."""
    return row["identity"], row["budget"], row["method"], tuple(row.get("z_mm", ()))


@dataclass(frozen=True)
class RowFile:
    """The rows of an evaluation, by key, whose file no other process writes meanwhile."""

    file: IO[bytes]
    rows: dict[Key, Row]

    def add(self, row: Row) -> None:
        """Add a row and flush it to disk."""
        # Names of files may hold bytes that are not valid characters.
        text = json.dumps(row, ensure_ascii=False, allow_nan=False)
        with named_in_errors(Path(self.file.name)):
            self.file.write(text.encode(errors="backslashreplace") + b"\n")
            self.file.flush()
            os.fsync(self.file.fileno())
        self.rows[key_of(row)] = row


@contextmanager
def writing_rows(out: Path) -> Iterator[RowFile]:
    """The rows in the folder of an evaluation, new or not, to add to; an unfinished last line is removed.

    Raises `InputError` if the folder holds something else, or another process adds rows to it.
    """
    EVALUATION_FOLDER.guard(out)
    out.mkdir(parents=True, exist_ok=True)
    with locked(out / ROWS, out) as file:
        content = file.read()
        rows = _parsed(out, content)
        file.truncate(content.rfind(b"\n") + 1)
        yield RowFile(file, rows)


def read_rows(out: Path) -> list[Row]:
    """The last row of each key in a folder; `InputError` without rows, and for a line that is no row."""
    rows = _parsed(out, (out / ROWS).read_bytes()) if (out / ROWS).is_file() else {}
    if not rows:
        raise InputError(f"{out}: holds no evaluation; `pcii evaluate` makes one")
    return list(rows.values())


def _parsed(out: Path, content: bytes) -> dict[Key, Row]:
    from pydantic import ValidationError

    from pcii.store.manifests import first_fault

    *lines, _ = content.split(b"\n")  # the last one is empty, or unfinished
    rows: dict[Key, Row] = {}
    for number, line in enumerate(lines, start=1):
        try:
            row = json.loads(line)
            _row_model().validate_python(row)
            if not (row.get("depth") or row.get("planes")):
                raise ValueError("no scores")
            rows[key_of(row)] = row
        except (ValueError, TypeError, RecursionError) as fault:
            sentence = first_fault(fault) if isinstance(fault, ValidationError) else "is no row of scores"
            advice = "delete that line and repeat the command that made it"
            raise InputError(f"{out / ROWS}: line {number}: {sentence}; {advice}") from None
    return rows


def origin_of(rows: Sequence[Row]) -> dict[str, Any]:
    """What measured rows: how many each version of each package, and each machine, did; first and last day.

    `differing` names what has several versions or sources.
    """
    software: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        for name, number in (row.get("software") or {}).items():
            software[name][number] += 1
    days = sorted(row["date"] for row in rows if "date" in row)
    return {
        "software": {name: dict(numbers) for name, numbers in software.items()},
        "differing": sorted(name for name, numbers in software.items() if len(numbers) > 1),
        "machines": dict(Counter(row["machine"] for row in rows if "machine" in row)),
        "days": [days[0], days[-1]] if days else [],
    }
