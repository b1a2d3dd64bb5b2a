"""The page of all studies: figures, tables and how to read them, as Markdown and as HTML from templates."""

import base64
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import draw
from benchmarks.machine import in_words, was_busy
from benchmarks.results import Record, Row, Study, Value, label
from pcii.base.safe_files import write_bytes_safely
from pcii.figures.pages import render_page, table_markdown, text_table

if TYPE_CHECKING:
    from pandas import DataFrame

PICTURES = "benchmarks"
"""Folder of the figures, beside the Markdown page."""


def write_markdown(path: Path, studies: Sequence[Study], records: Sequence[Record]) -> None:
    """Write the page and its figures, in a folder beside it."""
    sections = [_section(study, record) for study, record in _pairs(studies, records)]
    for study, record in _pairs(studies, records):
        draw(study, record.measured, path.parent / PICTURES / f"{study.name}.png")
    text = _markdown(sections=sections, pictures=PICTURES)
    write_bytes_safely(path, text.encode())


def write_html(path: Path, studies: Sequence[Study], records: Sequence[Record]) -> None:
    """Write the page in one file; figures are those that `draw` wrote in the same folder."""
    sections = [_section(study, record) for study, record in _pairs(studies, records)]
    for section in sections:
        picture = (path.parent / f"{section['name']}.png").read_bytes()
        section["picture"] = "data:image/png;base64," + base64.b64encode(picture).decode()
    page = render_page("benchmarks.html.j2", {"sections": sections}, package="benchmarks")
    write_bytes_safely(path, page)


def tables_of(rows: Sequence[Row]) -> dict[str, "DataFrame"]:
    """The tables of a study by title, with a column for each parameter and quantity that any row has."""
    tables: dict[str, DataFrame] = {}
    for title in dict.fromkeys(row.table for row in rows):
        own = [row for row in rows if row.table == title]
        parameters = list(dict.fromkeys(name for row in own for name in row.parameters))
        quantities = list(dict.fromkeys(name for row in own for name in row.values))
        cells = [
            (
                row.name,
                *(_parameter(row.parameters.get(name)) for name in parameters),
                *(told(row.values.get(name)) for name in quantities),
            )
            for row in own
        ]
        tables[title] = text_table(cells, ("what", *map(label, (*parameters, *quantities))))
    return tables


def told(value: Value | None) -> str:
    """A value to three digits, with its interval in brackets; a dash for none.

    >>> told(Value(1234.5, 1200.0, 1300.0)), told(Value(0.01)), told(None)
    ('1230 (1200 to 1300)', '0.01', '–')
    """
    if value is None:
        return "–"
    if value.low is None or value.high is None:
        return _three_digits(value.value)
    return f"{_three_digits(value.value)} ({_three_digits(value.low)} to {_three_digits(value.high)})"


def _three_digits(number: float) -> str:
    if 100 <= abs(number) < 1e6:
        return f"{round(float(f'{number:.3g}'))}"
    return f"{number:.3g}"


def _parameter(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _pairs(studies: Sequence[Study], records: Sequence[Record]) -> list[tuple[Study, Record]]:
    """Studies that have run, in their order, each with its record."""
    by_name = {record.study: record for record in records}
    return [(study, by_name[study.name]) for study in studies if study.name in by_name]


def _section(study: Study, record: Record) -> dict[str, Any]:
    machine = record.machine
    tables = tables_of(record.measured.rows)
    if record.measured.ratios:
        tables["Ratios"] = _ratios(record)
    return {
        "name": study.name,
        "title": study.title,
        "reading": study.reading(record.measured),
        "tables": {title: (table, table_markdown(table)) for title, table in tables.items()},
        "size": record.size,
        "date": date.fromisoformat(record.date[:10]).isoformat(),
        "wall_s": round(record.wall_s),
        "machine": in_words(machine),
        "busy": was_busy(machine),
        "cores_in_use": machine["cores_in_use"],
        "seeds": ", ".join(map(str, record.measured.seeds)),
        "versions": ", ".join(f"{name} {number}" for name, number in record.versions.items()),
    }


def _ratios(record: Record) -> "DataFrame":
    rows = [
        (
            ratio.name,
            told(ratio.ratio),
            "–" if ratio.asked is None else f"{ratio.asked:g}",
            "–" if ratio.asked is None else ("yes" if ratio.ratio.value >= ratio.asked else "no"),
        )
        for ratio in record.measured.ratios
    ]
    header = ("how many times better, side by side", "ratio", "asked for", "met")
    return text_table(rows, header)


def _markdown(**content: Any) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("benchmarks"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("benchmarks.md.j2").render(content)
