"""The page of all studies in Markdown: figures, how to read them, and tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import draw
from benchmarks.machine import in_words, was_busy
from benchmarks.results import Record, Row, Study, Value, label
from pcii.base import in_markdown, write_bytes_safely
from pcii.figures import text_table

if TYPE_CHECKING:
    from pandas import DataFrame

PICTURES = "benchmarks"
"""Folder of the figures, beside the page."""
HEAD = """# Run time against error

Made by `make bench`, and put into the guide by `make bench-publish`; no figure is typed. What is compared
was measured side by side in one run. In brackets and as bars: 95 % intervals, by Student's t of means over
seeds, by order statistics of medians of run times, by resampling or propagation where the text says so.
Seconds are of one machine; ratios are what `python -m benchmarks guard` compares."""


def write_page(path: Path, studies: Sequence[Study], records: Sequence[Record]) -> None:
    """Write the page of those studies that have run, in their order, and its figures in a folder."""
    of_study = {record.study: record for record in records}
    ran = [study for study in studies if study.name in of_study]
    for study in ran:
        draw(study, of_study[study.name].measured, path.parent / PICTURES / f"{study.name}.png")
    versions = ", ".join(f"{name} {number}" for name, number in records[0].versions.items())
    parts = [HEAD, *(_section(study, of_study[study.name]) for study in ran), f"Versions: {versions}.\n"]
    write_bytes_safely(path, "\n\n".join(parts).encode())


def _section(study: Study, record: Record) -> str:
    measured, machine = record.measured, record.machine
    tables = tables_of(measured.rows)
    if measured.ratios:
        ratios = [(name, value_text(ratio)) for name, ratio in measured.ratios.items()]
        tables["Ratios"] = text_table(ratios, ("how many times better, side by side", "ratio"))
    seeds = f", seeds {', '.join(map(str, measured.seeds))}" if measured.seeds else ""
    parts = [f"## {study.title}", f"![{study.title}]({PICTURES}/{study.name}.png)", study.reading(measured)]
    for title, table in tables.items():
        parts += [f"**{title}**", table_markdown(table)]
    parts.append(
        f"Study `{study.name}`, {record.size} size, {record.date[:10]}, commit {record.versions['commit']},"
        f" {record.wall_s:.0f} s on {in_words(machine)}{seeds}."
    )
    if was_busy(machine):
        parts.append(
            "The machine was busy with other work when it began"
            f" ({machine['cores_in_use']} cores in use): seconds are too long, ratios less so."
        )
    return "\n\n".join(parts)


def tables_of(rows: Sequence[Row]) -> dict[str, "DataFrame"]:
    """The tables of a study by title, with a column for each parameter and quantity that any row has."""
    tables: dict[str, DataFrame] = {}
    for title in dict.fromkeys(row.table for row in rows):
        of_table = [row for row in rows if row.table == title]
        parameters = list(dict.fromkeys(name for row in of_table for name in row.parameters))
        quantities = list(dict.fromkeys(name for row in of_table for name in row.values))
        cells = [
            (
                row.name,
                *(_parameter(row.parameters.get(name)) for name in parameters),
                *(value_text(row.values.get(name)) for name in quantities),
            )
            for row in of_table
        ]
        tables[title] = text_table(cells, ("what", *map(label, (*parameters, *quantities))))
    return tables


def value_text(value: Value | None) -> str:
    """A value to three digits, with its interval in brackets; a dash for none.

    >>> value_text(Value(1234.5, 1200.0, 1300.0)), value_text(Value(0.01)), value_text(None)
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


def table_markdown(table: "DataFrame") -> str:
    """A table in Markdown, all texts escaped.

    >>> print(table_markdown(text_table([("a|b", "1")], ("what", "value"))))
    | what | value |
    | :-- | --: |
    | a\\|b | 1 |
    """
    columns = table.reset_index()
    header, *rows = (map(in_markdown, row) for row in [[*columns.columns], *columns.to_numpy().tolist()])
    rule = [":--"] * table.index.nlevels + ["--:"] * len(table.columns)
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, rule, *rows))
