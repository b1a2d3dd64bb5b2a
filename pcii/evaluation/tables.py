"""Tables of an evaluation as text, the same for HTML and Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pcii.base.plain_text import in_markdown
from pcii.evaluation.rows import by_light
from pcii.io.dataset import FULL_LIGHT, Budget

COLUMNS = (
    ("IoU", "object", "iou"),
    ("IoU, pixels", "pixel", "iou"),
    ("oracle IoU, pixels", "pixel", "iou_oracle"),
    ("boundary F", "object", "boundary_f"),
    ("claimed share", "object", "claimed_share"),
    ("photon precision", "object", "photon_precision"),
    ("photon recall", "object", "photon_recall"),
)
DEPTH_COLUMNS = (
    ("median, px", "median_px"),
    ("bias, px", "bias_px"),
    ("bad_1px", "bad_1px"),
    ("bad_3px", "bad_3px"),
    ("BadPix(0.07)", "hci_objects", "badpix_007"),
    ("BadPix(0.07), all pixels", "hci", "badpix_007"),
    ("answered", "coverage"),
    ("ECE", "ece"),
)
ALL_PIXELS = "BadPix(0.07), all pixels"
"""The column that stands for those of objects where surfaces have no names, as in other people's data."""
P_COLUMNS = ("p", "least p possible")
EXPOSURE = "by exposure"
"""Name of the photon budget of datasets whose recipe has an exposure instead."""


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


def tables_of(group: Mapping[str, Any]) -> list[Table]:
    """The tables of one group, without empty ones."""
    tables = [_removal(group), _depth(group), _bounds(group)]
    tables += [_paired(group, "iou", "IoU"), _paired(group, "bad_1px", "bad_1px"), _table1(group)]
    return [table for table in tables if table.rows]


def overviews(groups: Sequence[Mapping[str, Any]]) -> list[Table]:
    """`overview` and `depth_overview`, without empty ones."""
    return [table for table in (overview(groups), depth_overview(groups)) if table.rows]


def overview(groups: Sequence[Mapping[str, Any]]) -> Table:
    """Mean object IoU of every group and method by photon budget; labels of groups differ."""
    return _by_budget(groups, "IoU by photon budget", "object", "iou", 1)


def depth_overview(groups: Sequence[Mapping[str, Any]]) -> Table:
    """Share of errors of depth above 1 px of every group and method by photon budget."""
    return _by_budget(groups, "Errors of depth above 1 px by photon budget", "depth", "bad_1px", -1)


def p_cells(entry: Mapping[str, Any]) -> tuple[str, str]:
    """A p-value and the smallest that is possible, as text."""
    sampled = "" if entry["exact"] else " (sampled)"
    return f"{entry['p']:.2g}{sampled}", f"{entry['least_p']:.2g}"


def _best(contests: Sequence[object], figures: Sequence[Mapping[str, Any] | None], sign: int) -> set[int]:
    """Numbers of the figures with the best mean of their contest, where another one is worse."""
    entered: dict[object, list[tuple[float, int]]] = {}
    for number, (contest, figure) in enumerate(zip(contests, figures, strict=True)):
        if figure is not None:
            entered.setdefault(contest, []).append((sign * figure["mean"], number))
    decided = [own for own in entered.values() if min(own)[0] < max(own)[0]]
    return {number for own in decided for value, number in own if value == max(own)[0]}


def _by_budget(groups: Sequence[Mapping[str, Any]], title: str, part: str, measure: str, sign: int) -> Table:
    budgets: dict[Budget, None] = {}
    cells: dict[tuple[str, str], dict[Budget, Any]] = {}
    for group in groups:
        for row in group["results"]:
            if part in row:
                budgets[row["budget"]] = None
                mean = row[part].get(measure)
                cells.setdefault((group["label"], row["method"]), {})[row["budget"]] = mean
    order = sorted(budgets, key=by_light)
    scenes, means = [scene for scene, _ in cells], list(cells.values())
    rows = [
        (*names, *(with_interval(by_budget.get(budget)) for budget in order))
        for names, by_budget in cells.items()
    ]
    best = {
        (number, column)
        for column, budget in enumerate(order, start=2)
        for number in _best(scenes, [by_budget.get(budget) for by_budget in means], sign)
    }
    header = ("scene", "method", *map(budget_name, order))
    return Table(title, header, tuple(rows), words=2, best=frozenset(best))


def markdown(table: Table) -> str:
    """The table in Markdown, without its title."""
    rule = [":--" if column < table.words else "--:" for column in range(len(table.header))]
    rows = [[in_markdown(cell) for cell in row] for row in (table.header, *table.rows)]
    for row, column in table.best:
        rows[1 + row][column] = f"**{rows[1 + row][column]}**"
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


def budget_name(budget: Budget) -> str:
    """A photon budget as text; `EXPOSURE` where the recipe has an exposure time instead."""
    if budget == FULL_LIGHT:
        return "full light"
    return EXPOSURE if budget is None else f"{budget:g}"


def light_name(budget: Budget) -> str:
    """Photons of a budget, or full light, in words.

    >>> light_name(300.0), light_name("full-light"), light_name(None)
    ('300 photons', 'full light', 'photons by exposure')
    """
    if budget is None:
        return f"photons {EXPOSURE}"
    return budget_name(budget) if budget == FULL_LIGHT else f"{budget_name(budget)} photons"


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
    best = _best_rows(results, [row["object"].get("iou") for row in results], 1, header, "IoU")
    return Table("Removal of defocused points", header, tuple(rows), best=best)


def _best_rows(
    results: Sequence[Mapping[str, Any]],
    figures: Sequence[Mapping[str, Any] | None],
    sign: int,
    header: Sequence[str],
    name: str,
) -> frozenset[tuple[int, int]]:
    """The method and the figure, in the column `name`, of the rows that are best at their budget."""
    columns = [0, *(number for number, column in enumerate(header) if column == name)]
    numbers = _best([row["budget"] for row in results], figures, sign)
    return frozenset((number, column) for number in numbers for column in columns)


def _depth(group: Mapping[str, Any]) -> Table:
    results = [row for row in group["results"] if "depth" in row]
    means = [{name: _mean(row["depth"], *path) for name, *path in DEPTH_COLUMNS} for row in results]
    shown = [name for name, *_ in DEPTH_COLUMNS if any(mean[name] for mean in means)]
    if "BadPix(0.07)" in shown and ALL_PIXELS in shown:
        shown.remove(ALL_PIXELS)
    rows = tuple(
        (
            row["method"],
            budget_name(row["budget"]),
            str(row["seeds"]),
            *(with_interval(mean[name], 2 if name.endswith(", px") else 3) for name in shown),
            with_interval(row["seconds"], 2),
        )
        for row, mean in zip(results, means, strict=True)
    )
    header = ("method", "photons", "seeds", *shown, "seconds")
    best = _best_rows(results, [mean["bad_1px"] for mean in means], -1, header, "bad_1px")
    return Table("Depth", header, rows, best=best)


def _mean(scores: Mapping[str, Any], *path: str) -> Mapping[str, Any] | None:
    """A mean by its name, or by the names of the mappings that it is in; None if it is not there."""
    found: Any = scores
    for name in path:
        found = None if found is None else found.get(name)
    return found


def _bounds(group: Mapping[str, Any]) -> Table:
    """Bounds of each object and budget; they are the same for all methods that saw the same photons."""
    cells = {
        (bound["name"], row["budget"]): (bound["photons"], bound["depth_sigma_px"])
        for row in group["results"]
        for bound in row.get("bounds", {}).get("objects", ())
        if bound["depth_sigma_px"] is not None
    }
    rows = tuple(
        (name, budget_name(budget), with_interval(photons, 0), with_interval(sigma))
        for (name, budget), (photons, sigma) in cells.items()
    )
    header = ("object", "photons", "photons of the object", "standard deviation, px")
    return Table("Least error of an object's depth (Cramér-Rao bound)", header, rows)


def _paired(group: Mapping[str, Any], measure: str, name: str) -> Table:
    rows = tuple(
        (
            " minus ".join(entry["methods"]),
            budget_name(entry["budget"]),
            str(entry["difference"]["n"]),
            with_interval(entry["difference"]),
            *p_cells(entry),
        )
        for entry in group["paired"]
        if entry["measure"] == measure
    )
    header = ("methods", "photons", "seeds", f"difference of {name}", *P_COLUMNS)
    kind = "methods" if measure == "iou" else "methods of depth"
    return Table(f"Pairs of {kind} on the same datasets", header, rows)


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
