"""Tables of an evaluation as text, the same for HTML and Markdown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pcii.base.plain_text import in_markdown
from pcii.evaluation.rows import by_light
from pcii.store.dataset import FULL_LIGHT, Budget

Entry = Mapping[str, Any]
Column = tuple[str, Callable[[Any], str]]
"""The name of a column, and what an entry says in it."""

IOU = ("IoU", "object", "iou")
MEANS = (
    IOU,
    ("IoU, pixels", "pixel", "iou"),
    ("oracle IoU, pixels", "pixel", "iou_oracle"),
    ("boundary F", "object", "boundary_f"),
    ("claimed share", "object", "claimed_share"),
    ("photon precision", "object", "photon_precision"),
    ("photon recall", "object", "photon_recall"),
)
"""What is shown of a result of removal: names of columns, and where their means are."""
BAD_1PX = ("bad_1px", "depth", "bad_1px")
OF_OBJECTS = ("BadPix(0.07)", "depth", "hci_objects", "badpix_007")
OF_ALL_PIXELS = ("BadPix(0.07), all pixels", "depth", "hci", "badpix_007")
"""It stands for that of objects where surfaces have no names, as in other people's data."""
DEPTH_MEANS = (
    ("median, px", "depth", "median_px"),
    ("bias, px", "depth", "bias_px"),
    BAD_1PX,
    ("bad_3px", "depth", "bad_3px"),
    OF_OBJECTS,
    OF_ALL_PIXELS,
    ("answered", "depth", "coverage"),
    ("ECE", "depth", "ece"),
)
"""The same of a result of depth."""
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


def with_interval(mean: Entry | None, digits: int = 3) -> str:
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


METHOD: Column = ("method", lambda entry: entry["method"])
PHOTONS: Column = ("photons", lambda entry: budget_name(entry["budget"]))
P_VALUES: tuple[Column, ...] = (
    ("p", lambda entry: f"{entry['p']:.2g}{'' if entry['exact'] else ' (sampled)'}"),
    ("least p possible", lambda entry: f"{entry['least_p']:.2g}"),
)


def tables_of(group: Entry) -> list[Table]:
    """The tables of one group, without empty ones."""
    tables = [_removal(group), _depth(group), _bounds(group)]
    tables += [_paired(group, "iou", "IoU"), _paired(group, "bad_1px", "bad_1px"), _table1(group)]
    return [table for table in tables if table.rows]


def overviews(groups: Sequence[Entry]) -> list[Table]:
    """`overview` and `depth_overview`, without empty ones."""
    return [table for table in (overview(groups), depth_overview(groups)) if table.rows]


def overview(groups: Sequence[Entry]) -> Table:
    """Mean object IoU of every group and method by photon budget; labels of groups differ."""
    return _by_budget(groups, "IoU by photon budget", IOU[1:], 1)


def depth_overview(groups: Sequence[Entry]) -> Table:
    """Share of errors of depth above 1 px of every group and method by photon budget."""
    return _by_budget(groups, "Errors of depth above 1 px by photon budget", BAD_1PX[1:], -1)


def _mean(entry: Entry, *path: str) -> Entry | None:
    """A mean by the names of the mappings that it is in; None if it is not there."""
    found: Any = entry
    for name in path:
        found = None if found is None else found.get(name)
    return found


def _mean_column(name: str, path: Sequence[str]) -> Column:
    digits = 2 if name.endswith(", px") else 3
    return name, lambda entry: with_interval(_mean(entry, *path), digits)


def _mean_columns(means: Sequence[tuple[str, ...]], results: Sequence[Entry]) -> list[Column]:
    """Columns of the means that a result has."""
    return [_mean_column(name, path) for name, *path in means if any(_mean(row, *path) for row in results)]


def _best(figures: Sequence[tuple[object, Entry | None]], sign: int) -> set[int]:
    """Numbers of the figures with the best mean of their contest, where another one is worse."""
    entered: dict[object, list[tuple[float, int]]] = {}
    for number, (contest, figure) in enumerate(figures):
        if figure is not None:
            entered.setdefault(contest, []).append((sign * figure["mean"], number))
    decided = [own for own in entered.values() if min(own)[0] < max(own)[0]]
    return {number for own in decided for value, number in own if value == max(own)[0]}


def _by_budget(groups: Sequence[Entry], title: str, path: Sequence[str], sign: int) -> Table:
    cells: dict[tuple[str, str], dict[Budget, Entry | None]] = {}
    for group in groups:
        for row in group["results"]:
            if path[0] in row:
                cells.setdefault((group["label"], row["method"]), {})[row["budget"]] = _mean(row, *path)
    budgets: set[Budget] = {budget for by_budget in cells.values() for budget in by_budget}
    columns: list[Column] = [("scene", lambda entry: entry[0][0]), ("method", lambda entry: entry[0][1])]
    best: dict[str, set[int]] = {}
    for budget in sorted(budgets, key=by_light):
        name = budget_name(budget)
        columns.append((name, lambda entry, budget=budget: with_interval(entry[1].get(budget))))
        best[name] = _best([(scene, means.get(budget)) for (scene, _), means in cells.items()], sign)
    return tabulated(title, columns, list(cells.items()), words=2, best=best)


def _results(
    title: str, results: Sequence[Entry], columns: Sequence[Column], decisive: Sequence[str], sign: int
) -> Table:
    """Results by method and budget; the best of a budget by the `decisive` mean stand out."""
    name, *path = decisive
    lead: list[Column] = [METHOD, PHOTONS, ("seeds", lambda row: str(row["seeds"]))]
    seconds: Column = ("seconds", lambda row: with_interval(row["seconds"], 2))
    rows = _best([(row["budget"], _mean(row, *path)) for row in results], sign)
    best = {"method": rows, name: rows} if rows else {}
    return tabulated(title, [*lead, *columns, seconds], results, best=best)


def _removal(group: Entry) -> Table:
    results = [row for row in group["results"] if "object" in row]
    depths = sorted({plane["z_mm"] for row in results for plane in row["planes"]})

    def at_plane(z_mm: float) -> Column:
        def iou(row: Entry) -> str:
            planes = {plane["z_mm"]: plane["object"].get("iou") for plane in row["planes"]}
            return with_interval(planes.get(z_mm))

        return f"IoU, {z_mm:g} mm", iou

    columns = [at_plane(z) for z in depths] if len(depths) > 1 else []
    columns += _mean_columns(MEANS, results)
    return _results("Removal of defocused points", results, columns, IOU, 1)


def _depth(group: Entry) -> Table:
    results = [row for row in group["results"] if "depth" in row]
    columns = dict(_mean_columns(DEPTH_MEANS, results))
    if OF_OBJECTS[0] in columns:
        columns.pop(OF_ALL_PIXELS[0], None)
    return _results("Depth", results, list(columns.items()), BAD_1PX, -1)


def _bounds(group: Entry) -> Table:
    """Bounds of each object and budget; they are the same for all methods that saw the same photons."""
    bounds = {
        (bound["name"], row["budget"]): bound | {"budget": row["budget"]}
        for row in group["results"]
        for bound in row.get("bounds", {}).get("objects", ())
        if bound["depth_sigma_px"] is not None
    }
    columns: list[Column] = [
        ("object", lambda bound: bound["name"]),
        PHOTONS,
        ("photons of the object", lambda bound: with_interval(bound["photons"], 0)),
        ("standard deviation, px", lambda bound: with_interval(bound["depth_sigma_px"])),
    ]
    title = "Least error of an object's depth (Cramér-Rao bound)"
    return tabulated(title, columns, list(bounds.values()))


def _paired(group: Entry, measure: str, name: str) -> Table:
    columns: list[Column] = [
        ("methods", lambda pair: " minus ".join(pair["methods"])),
        PHOTONS,
        ("seeds", lambda pair: str(pair["difference"]["n"])),
        (f"difference of {name}", lambda pair: with_interval(pair["difference"])),
        *P_VALUES,
    ]
    kind = "methods" if measure == "iou" else "methods of depth"
    pairs = [pair for pair in group["paired"] if pair["measure"] == measure]
    return tabulated(f"Pairs of {kind} on the same datasets", columns, pairs)


def _table1(group: Entry) -> Table:
    columns: list[Column] = [
        ("object", lambda entry: entry["object"]),
        ("plane", lambda entry: f"{entry['own_z_mm']:g} mm"),
        PHOTONS,
        ("lowest at its plane", lambda entry: f"{entry['lowest_at_own']} of {entry['seeds']}"),
        ("smallest gap, bits", lambda entry: f"{entry['smallest_gap_bits']:.3f}"),
        ("mean gap, bits", lambda entry: f"{entry['mean_gap_bits']:.3f}"),
    ]
    title = "Entropy of the objects (Table 1 of Muniraj et al. 2017)"
    return tabulated(title, columns, group["table1"], words=2)
