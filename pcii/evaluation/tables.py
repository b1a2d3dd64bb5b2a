"""Tables of an evaluation as text, the same for HTML and Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pcii.base.plain_text import in_markdown

COLUMNS = (
    ("IoU", "object", "iou"),
    ("IoU, pixels", "pixel", "iou"),
    ("oracle IoU, pixels", "pixel", "iou_oracle"),
    ("boundary F", "object", "boundary_f"),
    ("claimed share", "object", "claimed_share"),
    ("photon precision", "object", "photon_precision"),
    ("photon recall", "object", "photon_recall"),
)
DEPTH_COLUMNS = ("median_px", "median_mm", "mae_mm", "bad_1px", "bad_3px", "coverage")
DIGITS = {"median_px": 2, "median_mm": 2, "mae_mm": 2}
EXPOSURE = "by exposure"
"""Name of the photon budget of datasets whose recipe has an exposure instead."""


@dataclass(frozen=True)
class Table:
    """A table of text: title, names of the columns, rows; the first `words` columns are left-aligned."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1


def tables_of(group: Mapping[str, Any]) -> list[Table]:
    """The tables of one group, without empty ones."""
    tables = [_removal(group), _depth(group), _paired(group), _table1(group)]
    return [table for table in tables if table.rows]


def overview(groups: Sequence[Mapping[str, Any]]) -> Table:
    """Mean object IoU of every group and method by photon budget; labels of groups differ."""
    budgets: dict[str, None] = {}
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for group in groups:
        for row in group["results"]:
            if "object" in row:
                name = budget_name(row["budget"])
                budgets[name] = None
                iou = with_interval(row["object"].get("iou"))
                cells.setdefault((group["label"], row["method"]), {})[name] = iou
    order = sorted(budgets, key=lambda name: float("inf") if name == EXPOSURE else float(name))
    rows = [(*names, *(by_budget.get(budget, "–") for budget in order)) for names, by_budget in cells.items()]
    return Table("IoU by photon budget", ("scene", "method", *order), tuple(rows), words=2)


def markdown(table: Table) -> str:
    """The table in Markdown, without its title."""
    rule = [":--" if column < table.words else "--:" for column in range(len(table.header))]
    rows = [[in_markdown(cell) for cell in row] for row in (table.header, *table.rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (rows[0], rule, *rows[1:]))


def with_interval(mean: Mapping[str, Any] | None, digits: int = 3) -> str:
    """A mean with its interval as text, a dash for None.

    >>> with_interval({"mean": 0.912, "interval": [0.905, 0.919]})
    '0.912 (0.905 to 0.919)'
    """
    if mean is None:
        return "–"
    text = f"{mean['mean']:.{digits}f}"
    if mean["interval"] is None:
        return text
    low, high = mean["interval"]
    return f"{text} ({low:.{digits}f} to {high:.{digits}f})"


def budget_name(budget: float | None) -> str:
    """A photon budget as text; `EXPOSURE` where the recipe has an exposure time instead."""
    return EXPOSURE if budget is None else f"{budget:g}"


def _removal(group: Mapping[str, Any]) -> Table:
    results = [row for row in group["results"] if "object" in row]
    shown = [column for column in COLUMNS if any(row[column[1]].get(column[2]) for row in results)]
    depths = sorted({plane["z_mm"] for row in results for plane in row["planes"]})
    rows = []
    for row in results:
        planes = {plane["z_mm"]: plane["object"].get("iou") for plane in row["planes"]}
        cells = [with_interval(planes.get(z)) for z in depths] if len(depths) > 1 else []
        means = [with_interval(row[kind].get(name)) for _, kind, name in shown]
        lead = (row["method"], budget_name(row["budget"]), str(row["seeds"]))
        rows.append((*lead, *cells, *means, with_interval(row["seconds"], 2)))
    planes = [f"IoU, {z:g} mm" for z in depths] if len(depths) > 1 else []
    names = [name for name, _, _ in shown]
    header = ("method", "photons", "seeds", *planes, *names, "seconds")
    return Table("Removal of defocused points", header, tuple(rows))


def _depth(group: Mapping[str, Any]) -> Table:
    results = [row for row in group["results"] if "depth" in row]
    shown = [name for name in DEPTH_COLUMNS if any(row["depth"].get(name) for row in results)]
    rows = tuple(
        (
            budget_name(row["budget"]),
            str(row["seeds"]),
            *(with_interval(row["depth"].get(name), DIGITS.get(name, 3)) for name in shown),
            with_interval(row["seconds"], 2),
        )
        for row in results
    )
    return Table("Depth", ("photons", "seeds", *shown, "seconds"), rows, words=0)


def _paired(group: Mapping[str, Any]) -> Table:
    rows = tuple(
        (
            " minus ".join(entry["methods"]),
            budget_name(entry["budget"]),
            str(entry["difference"]["n"]),
            with_interval(entry["difference"]),
            f"{entry['p']:.2g}" + ("" if entry["exact"] else " (sampled)"),
        )
        for entry in group["paired"]
    )
    header = ("methods", "photons", "seeds", "difference of IoU", "p")
    return Table("Pairs of methods on the same datasets", header, rows)


def _table1(group: Mapping[str, Any]) -> Table:
    rows = tuple(
        (
            entry["object"],
            f"{entry['own_z_mm']:g} mm",
            budget_name(entry["budget"]),
            f"{entry['lowest_at_own']} of {entry['seeds']}",
            f"{entry['smallest_gap_bits']:.3f}",
            f"{entry['mean_gap_bits']:.3f}",
        )
        for entry in group["table1"]
    )
    header = ("object", "plane", "photons", "lowest at its plane", "smallest gap, bits", "mean gap, bits")
    return Table("Entropy of the objects (Table 1 of Muniraj et al. 2017)", header, rows, words=2)
