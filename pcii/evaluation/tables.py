"""The tables of an evaluation as text, the same for HTML and Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pcii.base.plain_text import in_markdown

COLUMNS = (
    ("IoU", "object", "iou"),
    ("IoU, pixels", "pixel", "iou"),
    ("oracle's IoU, pixels", "pixel", "iou_oracle"),
    ("boundary F", "object", "boundary_f"),
    ("claimed share", "object", "claimed_share"),
    ("photon precision", "object", "photon_precision"),
    ("photon recall", "object", "photon_recall"),
)
DEPTH_COLUMNS = ("median_px", "median_mm", "mae_mm", "bad_1px", "bad_3px", "coverage")
DIGITS = {"median_px": 2, "median_mm": 2, "mae_mm": 2}


@dataclass(frozen=True)
class Table:
    """A table of text: its title, the names of its columns, its rows; `words` columns hold words."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1


def tables_of(group: Mapping[str, Any]) -> list[Table]:
    """The tables of one group that have rows."""
    tables = [_removal(group), _depth(group), _paired(group), _table1(group)]
    return [table for table in tables if table.rows]


def overview(groups: Sequence[Mapping[str, Any]]) -> Table:
    """Mean object IoU of every group and method by photon budget; no two groups have one label."""
    budgets: dict[str, None] = {}
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for group in groups:
        for row in group["results"]:
            if "object" in row:
                name = budget_name(row["budget"])
                budgets[name] = None
                cells.setdefault((group["label"], row["method"]), {})[name] = told(row["object"].get("iou"))
    order = sorted(budgets, key=lambda name: (name == "own", float(name) if name != "own" else 0.0))
    rows = [(*names, *(own.get(budget, "–") for budget in order)) for names, own in cells.items()]
    return Table("IoU by photon budget", ("scene", "method", *order), tuple(rows), words=2)


def markdown(table: Table) -> str:
    """The table in Markdown, without its title."""
    rule = [":--" if column < table.words else "--:" for column in range(len(table.header))]
    rows = [[in_markdown(cell) for cell in row] for row in (table.header, *table.rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (rows[0], rule, *rows[1:]))


def told(mean: Mapping[str, Any] | None, digits: int = 3) -> str:
    """A mean with its interval, such as 0.912 (0.905 to 0.919)."""
    if mean is None:
        return "–"
    text = f"{mean['mean']:.{digits}f}"
    if mean["interval"] is None:
        return text
    low, high = mean["interval"]
    return f"{text} ({low:.{digits}f} to {high:.{digits}f})"


def budget_name(budget: float | None) -> str:
    """A photon budget as text; "own" where the recipe has an exposure instead."""
    return "own" if budget is None else f"{budget:g}"


def _removal(group: Mapping[str, Any]) -> Table:
    results = [row for row in group["results"] if "object" in row]
    shown = [column for column in COLUMNS if any(row[column[1]].get(column[2]) for row in results)]
    depths = sorted({plane["z_mm"] for row in results for plane in row["planes"]})
    rows = []
    for row in results:
        planes = {plane["z_mm"]: plane["object"].get("iou") for plane in row["planes"]}
        cells = [told(planes.get(z)) for z in depths] if len(depths) > 1 else []
        means = [told(row[kind].get(name)) for _, kind, name in shown]
        lead = (row["method"], budget_name(row["budget"]), str(row["seeds"]))
        rows.append((*lead, *cells, *means, told(row["seconds"], 2)))
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
            *(told(row["depth"].get(name), DIGITS.get(name, 3)) for name in shown),
            told(row["seconds"], 2),
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
            told(entry["difference"]),
            f"{entry['p']:.2g}" + ("" if entry["exact"] else " (drawn)"),
        )
        for entry in group["paired"]
    )
    header = ("methods", "photons", "seeds", "difference of IoU", "p")
    return Table("Methods on the same datasets", header, rows)


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
    header = ("object", "own plane", "photons", "lowest there", "smallest gap, bits", "mean gap, bits")
    return Table("Entropy of the objects (Table 1 of Muniraj et al. 2017)", header, rows, words=2)
