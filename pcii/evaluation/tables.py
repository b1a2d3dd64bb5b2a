"""Tables of an evaluation as text, the same for HTML and Markdown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base.plain_text import in_markdown
from pcii.evaluation.rows import EXPOSURE
from pcii.evaluation.summary import CELL, SIGNS, lines_of, means, ranks
from pcii.store.dataset import FULL_LIGHT, Budget

if TYPE_CHECKING:
    from pandas import DataFrame

Column = tuple[str, Callable[[Any], str]]
"""The name of a column, and what an entry says in it."""
METHOD: Column = ("method", lambda entry: entry["method"])
NAMES = {"iou": "IoU", "bad_1px": "bad_1px"}
TITLES = {"iou": "IoU", "bad_1px": "Errors of depth above 1 px"}
"""What methods of removal and of depth are compared by."""
REMOVAL = {
    "iou": "IoU",
    "pixel_iou": "IoU, pixels",
    "pixel_iou_oracle": "oracle IoU, pixels",
    "boundary_f": "boundary F",
    "claimed_share": "claimed share",
    "photon_precision": "photon precision",
    "photon_recall": "photon recall",
    "entropy_gap_bits": "entropy gap, bits",
    "seconds": "seconds",
}
"""Measures of removal in tables, and the names of their columns."""
OF_OBJECTS, OF_ALL_PIXELS = "hci_objects.badpix_007", "hci.badpix_007"
DEPTH = {
    "median_px": "median, px",
    "bound_px": "bound, px",
    "bias_px": "bias, px",
    "bad_1px": "bad_1px",
    "bad_3px": "bad_3px",
    OF_OBJECTS: "BadPix(0.07)",
    OF_ALL_PIXELS: "BadPix(0.07), all pixels",
    "coverage": "answered",
    "ece": "ECE",
    "seconds": "seconds",
}
"""The same of depth. BadPix of all pixels stands for that of objects where surfaces have no names."""


@dataclass(frozen=True)
class Table:
    """A table of text: title, names of the columns, rows; the first `words` columns are left-aligned.

    `best` are cells (row, column) to stand out.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1
    best: frozenset[tuple[int, int]] = frozenset()


def tabulated(
    title: str,
    columns: Sequence[Column],
    entries: Sequence[Any],
    words: int = 1,
    best: Mapping[str, set[int]] | None = None,
) -> Table:
    """A row for each entry; of `best` the numbers of the rows that stand out in the columns of its names."""
    names = tuple(name for name, _ in columns)
    rows = tuple(tuple(of(entry) for _, of in columns) for entry in entries)
    cells = {(row, names.index(name)) for name, numbers in (best or {}).items() for row in numbers}
    return Table(title, names, rows, words, frozenset(cells))


def markdown(table: Table) -> str:
    """The table in Markdown, without its title."""
    rule = [":--" if column < table.words else "--:" for column in range(len(table.header))]
    rows = [[in_markdown(cell) for cell in row] for row in (table.header, *table.rows)]
    for row, column in table.best:
        rows[1 + row][column] = f"**{rows[1 + row][column]}**"
    return "\n".join(f"| {' | '.join(row)} |" for row in (rows[0], rule, *rows[1:]))


def with_interval(mean: float, low: float, high: float, digits: int = 3) -> str:
    """A mean with its interval as text, a dash for NaN.

    >>> with_interval(0.912, 0.905, 0.919), with_interval(0.912, float("nan"), float("nan"))
    ('0.912 (0.905 to 0.919)', '0.912')
    """
    if np.isnan(mean):
        return "–"
    text = f"{mean:.{digits}f}"
    return text if np.isnan(low) else f"{text} ({low:.{digits}f} to {high:.{digits}f})"


def light_name(light: Budget) -> str:
    """Photons of a light, or full light, as the name of a column or plot.

    >>> light_name(300.0), light_name("full-light"), light_name("by exposure")
    ('300', 'full light', 'by exposure')
    """
    if light == FULL_LIGHT:
        return "full light"
    return EXPOSURE if light is None else f"{light:g}" if not isinstance(light, str) else light


def tables_of_all(of_cells: "DataFrame", ranked: Mapping[str, "DataFrame"]) -> list[Table]:
    """Ranks over all scenes, then means by scene and light: of methods of removal, then of depth."""
    tables = [rank_table(ranked[name], name, f"{title} over all scenes") for name, title in TITLES.items()]
    tables += [light_table(of_cells, name, f"{title} by photon budget") for name, title in TITLES.items()]
    return [table for table in tables if table.rows]


def tables_of_scene(frame: "DataFrame", of_cells: "DataFrame") -> list[Table]:
    """What was measured of one scene in full: removal, depth and comparisons; without empty ones."""
    tables = [_results(frame, of_cells, "iou", REMOVAL), _results(frame, of_cells, "bad_1px", DEPTH)]
    for name, title in TITLES.items():
        title = f"{title}, methods compared on the same datasets"
        tables.append(rank_table(ranks(frame, name, "identity"), name, title, "datasets"))
    return [table for table in tables if table.rows]


def light_table(of_cells: "DataFrame", measure: str, title: str) -> Table:
    """A measure of every scene and method by light; `of_cells` is of `summary.means`."""
    table = _with_texts(of_cells[of_cells["measure"] == measure], ["scene", "light"], measure)
    return _pivoted(title, table, ["scene", "method"], "light", light_name)


def _with_texts(table: "DataFrame", contest: Sequence[str], measure: str, digits: int = 3) -> "DataFrame":
    """The table with its means as `text`, and which is the best of its contest, where another is worse."""
    ends = zip(table["mean"], table["low"], table["high"], strict=True)
    values = SIGNS.get(measure, 0) * table["mean"]
    groups = values.groupby([table[name] for name in contest], observed=True)
    is_best = (values == groups.transform("max")) & (values > groups.transform("min"))
    return table.assign(text=[with_interval(*mean, digits) for mean in ends], is_best=is_best)


def _pivoted(
    title: str, table: "DataFrame", rows: Sequence[str], column: str, name: Callable[[Any], str] = str
) -> Table:
    """A table of texts with the columns `rows` and one for each value of `column`."""
    cells = table.pivot(index=list(rows), columns=column, values=["text", "is_best"])
    if not len(cells):
        return Table(title, (), ())
    texts = cells["text"].sort_index(axis="columns").fillna("–")
    marked = np.argwhere(cells["is_best"].sort_index(axis="columns").eq(True).to_numpy())
    index = texts.index.to_frame()
    if "light" in index:
        index["light"] = [light_name(light) for light in index["light"]]
    lines = map(tuple, np.hstack([index.to_numpy(object), texts.to_numpy(object)]).tolist())
    best = frozenset((int(row), len(rows) + int(number)) for row, number in marked)
    return Table(title, (*rows, *map(name, texts.columns)), tuple(lines), len(rows), best)


def _results(frame: "DataFrame", of_cells: "DataFrame", decisive: str, names: Mapping[str, str]) -> Table:
    """Results of one scene by method and light; the best of a light by the decisive measure stand out."""
    import pandas as pd

    methods = of_cells["method"][of_cells["measure"] == decisive].unique()
    table = of_cells[of_cells["method"].isin(methods)]
    shown = [name for name in names if name in set(table["measure"])]
    if OF_OBJECTS in shown:
        shown = [name for name in shown if name != OF_ALL_PIXELS]
    if decisive == "iou" and frame["z_mm"].nunique() > 1:
        planes = means(frame[[*CELL, "seed", "identity", "z_mm", decisive]], (*CELL, "z_mm"))
        planes = planes.assign(measure=[f"IoU, {z:g} mm" for z in planes["z_mm"]])
        shown = [*planes["measure"].unique(), *shown]
        table = pd.concat([table, planes])
    parts = []
    for name in shown:
        digits = 2 if names.get(name, "").endswith((" px", "seconds")) else 3
        parts.append(_with_texts(table[table["measure"] == name], ["light"], name, digits))
    everything = pd.concat(parts) if parts else _with_texts(table, ["light"], "")
    everything["measure"] = pd.Categorical(everything["measure"], shown)
    title = "Removal of defocused points" if decisive == "iou" else "Depth"
    return _pivoted(title, everything, ["light", "method"], "measure", lambda name: names.get(name, name))


def rank_table(table: "DataFrame", measure: str, title: str, unit: str = "scenes") -> Table:
    """Methods ranked over scenes or datasets; `table` is of `summary.ranks`."""
    rows = [
        (
            row.method,
            light_name(row.light),
            str(row.rank),
            with_interval(row.mean, row.low, row.high),
            with_interval(row.difference, row.difference_low, row.difference_high),
            *("–" if np.isnan(p) else f"{p:.2g}" for p in (row.p, row.least_p)),
            str(row.n),
        )
        for row in lines_of(table)
    ]
    header = ("method", "photons", "rank", f"mean {NAMES[measure]}", "minus that of the best")
    header += ("p", "least p possible", unit)
    return Table(title, header, tuple(rows))
