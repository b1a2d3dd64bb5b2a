"""Rows of an evaluation: rows.jsonl, which grows while methods are measured, and the data frame of it.

The file has one JSON object for each dataset, light and method. What is measured again, since other software
made it, is added below, and the last row counts.

The frame has a row for each dataset, light, method and plane, or depth map. Its columns, which
docs/evaluation.md lists, are `HEAD`, `photons_per_view`, `seconds`, and what was measured: `iou` and the
other scores against the objects of the plane, `pixel_iou` and the others against the points within 1 px of
blur, `within_1px` and the other scores of depth, with dots for what is nested, `bound_px`.
"""

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, Literal, NotRequired

from pydantic import BeforeValidator, NonNegativeFloat, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from pcii.base import InputError, locked, named_in_errors
from pcii.store import EVALUATION_FOLDER, OPEN, ROWS, Text, first_fault

if TYPE_CHECKING:
    from pandas import DataFrame

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


def _plane_parts(plane: Mapping[str, Any]) -> Row:
    """A plane with its scores as one member."""
    scores = dict(plane)
    parts = {name: scores.pop(name) for name in ("z_mm", "object", "truth") if name in scores}
    return parts | {"scores": scores}


_Scores = Annotated[dict[str, float | None], BeforeValidator(_measures)]


class _Plane(TypedDict):
    __pydantic_config__ = OPEN  # type: ignore[misc]
    z_mm: float
    object: Text | None
    truth: Literal["object", "pixel"]
    scores: _Scores


class _Row(TypedDict):
    __pydantic_config__ = OPEN  # type: ignore[misc]
    dataset: Text
    identity: Text
    recipe: Text
    title: Text
    method: Text
    budget: NonNegativeFloat | Literal["full-light"] | None
    seed: NotRequired[float | None]
    settings: NotRequired[dict[str, Any]]
    analysis: NotRequired[dict[str, Any]]
    z_mm: NotRequired[list[float]]
    photons_per_view: NotRequired[NonNegativeFloat | None]
    seconds: NotRequired[NonNegativeFloat | None]
    software: NotRequired[dict[str, Text] | None]
    date: NotRequired[Text]
    machine: NotRequired[Text]
    bound_px: NotRequired[float | None]
    depth: NotRequired[_Scores]
    planes: NotRequired[list[Annotated[_Plane, BeforeValidator(_plane_parts)]]]


_ROW = TypeAdapter(_Row)


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
    *lines, _ = content.split(b"\n")  # the last one is empty, or unfinished
    rows: dict[Key, Row] = {}
    for number, line in enumerate(lines, start=1):
        try:
            row = json.loads(line)
            _ROW.validate_python(row)
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
    import pandas as pd

    columns = pd.DataFrame([row.get("software") or {} for row in rows]).items()
    software = {str(name): column.value_counts(sort=False).to_dict() for name, column in columns}
    days = sorted(row["date"] for row in rows if "date" in row)
    return {
        "software": software,
        "differing": sorted(name for name, numbers in software.items() if len(numbers) > 1),
        "machines": dict(Counter(row["machine"] for row in rows if "machine" in row)),
        "days": [days[0], days[-1]] if days else [],
    }


def read_frame(out: str | Path) -> "DataFrame":
    """The frame of the evaluation in a folder; raises `InputError` as `read_rows` does."""
    return frame_of(read_rows(Path(out)))


def frame_of(rows: Sequence[Row]) -> "DataFrame":
    """The frame of rows, scenes in their order."""
    import pandas as pd

    labels = _labels(rows)
    records = [
        {
            "scene": labels[row["title"], row["recipe"]],
            "light": "by exposure" if row["budget"] is None else row["budget"],
        }
        | {name: row.get(name) for name in ("method", "dataset", "seed", "identity", "recipe")}
        | {"z_mm": None, "objects": None}
        | {name: row.get(name) for name in ("photons_per_view", "seconds")}
        | measured
        for row in rows
        for measured in _measured(row)
    ]
    frame = pd.DataFrame(records, columns=None if records else [*HEAD])
    texts = ["scene", "method", "dataset", "identity", "recipe", "objects"]
    # With escapes for parts of names of files that are no characters, which pandas cannot hold.
    frame[texts] = frame[texts].map(
        lambda text: text.encode(errors="backslashreplace").decode(), na_action="ignore"
    )
    numbers = frame.columns.difference([*texts, "light"])
    frame[numbers] = frame[numbers].astype("float64")
    frame["scene"] = pd.Categorical(frame["scene"], list(dict.fromkeys(frame["scene"])))
    # Numbers of photons, then an exposure, then full light.
    lights = sorted(set(frame["light"]), key=lambda light: (isinstance(light, str), light))
    frame["light"] = pd.Categorical(frame["light"], lights, ordered=True)
    return frame


def by_scene(rows: Sequence[Row]) -> list[Row]:
    """Rows whose datasets belong to one scene of the frame if their titles are the same, in any light."""
    return [row | {"recipe": row["title"]} for row in rows]


def _measured(row: Row) -> Iterable[Row]:
    """A record of depth, or one for each plane, with its scores against both kinds of truth."""
    if "depth" in row:
        return [dict(leaves(row["depth"])) | {name: row[name] for name in ("bound_px",) if name in row}]
    records: dict[float, Row] = {}
    for plane in row["planes"]:
        record = records.setdefault(plane["z_mm"], {"z_mm": plane["z_mm"], "objects": None})
        scores = dict(leaves(_plane_parts(plane)["scores"]))
        if plane["truth"] == "object":
            record |= {"objects": plane["object"]} | scores
        else:
            record |= {f"pixel_{name}": score for name, score in scores.items()}
    return records.values()


def _labels(rows: Sequence[Row]) -> dict[tuple[str, str], str]:
    """By title and recipe: the title, with the settings that distinguish it from others of the same title."""
    recipes: dict[str, dict[str, dict[str, str]]] = {}
    for row in rows:
        settings = row.get("settings", {})
        texts = {name: text if isinstance(text, str) else json.dumps(text) for name, text in settings.items()}
        recipes.setdefault(row["title"], {}).setdefault(row["recipe"], texts)
    labels: dict[tuple[str, str], str] = {}
    for title, by_recipe in recipes.items():
        names = dict.fromkeys(name for settings in by_recipe.values() for name in settings)
        differing = [name for name in names if len({texts.get(name) for texts in by_recipe.values()}) > 1]
        parts = {
            recipe: [f"{name}={texts[name]}" for name in differing if name in texts]
            for recipe, texts in by_recipe.items()
        }
        for recipe, words in parts.items():
            if list(parts.values()).count(words) > 1:
                # A scene that was changed, or has no recipe, differs in no setting.
                words = [*words, f"recipe {recipe[:8]}"]
            labels[title, recipe] = f"{title} ({', '.join(words)})" if words else title
    return labels
