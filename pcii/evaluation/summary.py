"""Rows of an evaluation, summed up: means over seeds, and what is better than what."""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from itertools import combinations, pairwise
from typing import Any

from pcii.evaluation.paired_tests import Mean, mean_interval, paired_difference, positive_mean_interval
from pcii.evaluation.rows import DEPTH, Row

INTERVALS = (
    "95 % interval of the mean by Student's t over seeds, for shares clipped to [0, 1], for seconds and "
    "other figures that are never negative by way of the mean's logarithm; null for one seed"
)
TABLE_1_METHOD = "three-step"
TRUTHS = ("object", "pixel")
SHARES = {"iou", "precision", "recall", "f1", "boundary_f", "photon_precision", "photon_recall"}
SHARES |= {"claimed_share", "iou_oracle", "bad_1px", "bad_3px", "coverage", "answered"}
SHARES |= {"badpix_001", "badpix_003", "badpix_007", "discontinuities", "fine_fattening", "fine_thinning"}


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """What evaluation.json holds: `groups`, one for each recipe, of datasets that differ in their seed alone.

    A group's `label` is its title, and where groups share one also what tells their recipes apart. Its
    `results` have a row for each budget and method: means over seeds with their intervals, by kind of truth
    as the mean over the planes and plane by plane; for the depth map the errors of `Score.depth`. `paired`
    compares methods by the mean object IoU of the same datasets, `monotonic` lists where that falls from one
    budget to the next larger one by more than its interval explains, and `table1` says in how many seeds
    each object's entropy is lowest at its own plane.
    """
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["title"], row["recipe"]].append(row)
    return {
        "version": version("photon-integral-imaging"),
        "interval": INTERVALS,
        "groups": [
            {"label": _label(rows[0], [other[0] for other in groups.values()]), **_group(recipe, rows)}
            for (_, recipe), rows in sorted(groups.items())
        ],
    }


def _label(row: Row, others: Sequence[Row]) -> str:
    """The title of a row's group, with settings that tell it from those `others` that share the title."""
    alike = [other for other in others if other["title"] == row["title"]]
    rivals = [other.get("settings", {}) for other in alike if other["recipe"] != row["recipe"]]
    told: list[str] = []
    for name, value in row.get("settings", {}).items():
        left = [settings for settings in rivals if name in settings and settings[name] == value]
        if len(left) < len(rivals):
            told.append(f"{name}={value if isinstance(value, str) else json.dumps(value)}")
        rivals = left
    if rivals:  # scenes of one name that were changed, or datasets without a recipe
        told.append(f"recipe {row['recipe'][:8]}")
    return f"{row['title']} ({', '.join(told)})" if told else row["title"]


def own_planes(planes: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Depth, as the keys of `Score.objects` spell it, of the plane that each object belongs to."""
    own: dict[str, str] = {}
    for row in planes:
        for name in (row["object"] or "").split(", "):
            own[name] = f"{row['z_mm']:g}"
    return own


def _group(recipe: str, rows: Sequence[Row]) -> dict[str, Any]:
    cells: dict[tuple[float | None, str], dict[str, Row]] = defaultdict(dict)
    for row in sorted(rows, key=lambda row: (row["seed"] or 0, row["identity"])):
        cells[row["budget"], row["method"]][row["identity"]] = row
    order = sorted(cells, key=lambda cell: (_rank(cell[0]), cell[1]))
    removal = {cell: cells[cell] for cell in order if cell[1] != DEPTH}
    names = {row["identity"]: row["dataset"] for row in rows}
    return {
        "recipe": recipe,
        "title": rows[0]["title"],
        "scene": rows[0]["scene"],
        "datasets": len(names),
        "results": [_result(*cell, list(cells[cell].values())) for cell in order],
        "paired": _paired(removal),
        "monotonic": _falls(removal),
        "table1": [
            entry
            for (budget, method), own in removal.items()
            if method == TABLE_1_METHOD
            for entry in _table1(budget, list(own.values()))
        ],
    }


def _rank(budget: float | None) -> float:
    return float("inf") if budget is None else budget


def _result(budget: float | None, method: str, rows: Sequence[Row]) -> dict[str, Any]:
    result: dict[str, Any] = {
        "budget": budget,
        "method": method,
        "seeds": len(rows),
        "photons_per_view": sum(row["photons_per_view"] for row in rows) / len(rows),
        "seconds": _told(positive_mean_interval([row["seconds"] for row in rows])),
    }
    if method == DEPTH:
        return result | {"depth": _means([row["depth"] for row in rows])}
    depths = sorted({plane["z_mm"] for row in rows for plane in row["planes"]})
    for kind in TRUTHS:
        result[kind] = _means([over_planes(row, kind) for row in rows])
    result["planes"] = [
        {"z_mm": z} | {kind: _means([_plane(row, kind, z) for row in rows]) for kind in TRUTHS}
        for z in depths
    ]
    return result


def over_planes(row: Row, kind: str) -> dict[str, float | None]:
    """Each figure of a row's planes against one kind of truth, as the mean of the planes that have it."""
    planes = [_figures(plane) for plane in row["planes"] if plane["truth"] == kind]
    means: dict[str, float | None] = {}
    for name in dict.fromkeys(name for plane in planes for name in plane):
        known = [value for plane in planes if (value := plane.get(name)) is not None]
        means[name] = sum(known) / len(known) if known else None
    return means


def _plane(row: Row, kind: str, z_mm: float) -> dict[str, float | None]:
    for plane in row["planes"]:
        if plane["truth"] == kind and plane["z_mm"] == z_mm:
            return _figures(plane)
    return {}


def _figures(plane: Mapping[str, Any]) -> dict[str, float | None]:
    return {name: value for name, value in plane.items() if name not in ("z_mm", "object", "truth")}


def _means(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean and interval of each figure over the rows that have it, None where none has; of tables too."""
    means: dict[str, Any] = {}
    for name in dict.fromkeys(name for row in rows for name in row):
        known = [value for row in rows if (value := row.get(name)) is not None]
        if not known:
            means[name] = None
            continue
        if isinstance(known[0], Mapping):
            means[name] = _means(known)
            continue
        mean = mean_interval(known, (0.0, 1.0)) if name in SHARES else positive_mean_interval(known)
        means[name] = _told(mean)
    return means


def _told(mean: Mean) -> dict[str, Any]:
    interval = None if mean.low is None else [mean.low, mean.high]
    return {"n": mean.n, "mean": mean.mean, "interval": interval}


def _compared(first: Mapping[str, Row], second: Mapping[str, Row]) -> dict[str, Any] | None:
    """Mean object IoU of the first rows minus that of the second, on the datasets of both."""
    pairs: list[tuple[float, float]] = []
    for identity in first:
        if identity in second:
            one, other = (over_planes(rows[identity], "object").get("iou") for rows in (first, second))
            if one is not None and other is not None:
                pairs.append((one, other))
    if not pairs:
        return None
    found = paired_difference([one for one, _ in pairs], [other for _, other in pairs])
    return {"difference": _told(found.difference), "p": found.p, "exact": found.exact}


def _paired(cells: Mapping[tuple[float | None, str], Mapping[str, Row]]) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for one, other in combinations(cells, 2):
        found = _compared(cells[one], cells[other]) if one[0] == other[0] else None
        if found is not None:
            entries.append({"budget": one[0], "methods": [one[1], other[1]], **found})
    return entries


def _falls(cells: Mapping[tuple[float | None, str], Mapping[str, Row]]) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for method in sorted({method for _, method in cells}):
        for fewer, more in pairwise(cell for cell in cells if cell[1] == method):
            found = _compared(cells[more], cells[fewer])
            interval = None if found is None else found["difference"]["interval"]
            if found is not None and interval is not None and interval[1] < 0:
                entries.append({"method": method, "from": fewer[0], "to": more[0], **found})
    return entries


def _table1(budget: float | None, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """In how many seeds each object's entropy is lowest at its own plane, and by how many bits."""
    gaps: dict[tuple[str, str], list[float]] = defaultdict(list)
    for row in rows:
        own = own_planes(row["planes"])
        for thing in row["objects"]:
            bits = {z: value for z, value in thing["entropy"].items() if value is not None}
            here = bits.pop(own.get(thing["name"], ""), None)
            if here is not None and bits:
                gaps[thing["name"], own[thing["name"]]].append(min(bits.values()) - here)
    return [
        {
            "budget": budget,
            "object": name,
            "own_z_mm": float(z),
            "seeds": len(bits),
            "lowest_at_own": sum(gap > 0 for gap in bits),
            "smallest_gap_bits": min(bits),
            "mean_gap_bits": sum(bits) / len(bits),
        }
        for (name, z), bits in gaps.items()
    ]
