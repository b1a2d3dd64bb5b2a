"""Summary of the rows of an evaluation: means over seeds, and paired comparisons of methods."""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from itertools import combinations, pairwise
from typing import Any

from pcii.evaluation.paired_tests import mean_interval, paired_difference, positive_mean_interval
from pcii.evaluation.pooling import pooled
from pcii.evaluation.provenance import record
from pcii.evaluation.rows import Budget, Cells, Measure, Row, by_light

INTERVALS = (
    "95 % interval of the mean over seeds by Student's t, clipped to [0, 1] for shares, and of the logarithm "
    "of the mean for seconds and other values that are never negative; null for one seed"
)
TABLE_1_METHOD = "three-step"
TRUTHS = ("object", "pixel")
SHARES = {"iou", "precision", "recall", "f1", "boundary_f", "photon_precision", "photon_recall"}
SHARES |= {"claimed_share", "iou_oracle", "bad_1px", "bad_3px", "coverage", "answered"}
SHARES |= {"badpix_001", "badpix_003", "badpix_007", "discontinuities", "fine_fattening", "fine_thinning"}
SHARES |= {"ece", "share", "confidence", "correct"}
SIGNED = {"bias_mm", "bias_px"}


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """The content of evaluation.json: `groups`, one for each recipe, of datasets that differ in seed.

    A group's `label` is its title, with the settings that differ between groups of the same title. Its
    `results` have a row for each budget and method: means over seeds with their intervals, by kind of truth,
    as the mean over the planes and plane by plane; of depth maps the errors of `Score.depth` in `depth`, and
    in `bounds`, where there is radiance, `depth_sigma_px` of each object. `paired` compares methods on the
    same datasets, by their `measure`: those of removal by "iou", the mean object IoU, where more is better,
    those of depth by "bad_1px", where less is. `monotonic` lists where it is significantly worse at one
    budget than at the next smaller one: its `difference` is negative for "iou" and positive for "bad_1px".
    `table1` has in how many seeds each object's entropy is lowest at the plane that the object belongs to.

    `pooled` ranks methods over all groups (see `pcii.evaluation.pooling`), and `made` has by what the rows
    were measured, on which machines and days (see `pcii.evaluation.provenance`).
    """
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["title"], row["recipe"]].append(row)
    kinds = [_by_kind(_cells(members)) for members in groups.values()]
    return {
        "version": version("photon-integral-imaging"),
        "interval": INTERVALS,
        "groups": [
            {"label": _label(rows[0], [members[0] for members in groups.values()]), **_group(recipe, rows)}
            for (_, recipe), rows in sorted(groups.items())
        ],
        "pooled": [
            *pooled([removal for removal, _ in kinds], _IOU),
            *pooled([depth for _, depth in kinds], _BAD_1PX),
        ],
        "made": record(rows),
    }


def _label(row: Row, groups: Sequence[Row]) -> str:
    """Title of a row's group, with the settings that distinguish it from other groups of the same title."""
    same_title = [each for each in groups if each["title"] == row["title"]]
    rivals = [each.get("settings", {}) for each in same_title if each["recipe"] != row["recipe"]]
    distinctions: list[str] = []
    for name, value in row.get("settings", {}).items():
        left = [settings for settings in rivals if name in settings and settings[name] == value]
        if len(left) < len(rivals):
            distinctions.append(f"{name}={value if isinstance(value, str) else json.dumps(value)}")
        rivals = left
    if rivals:  # a scene was changed under the same name, or there is no recipe
        distinctions.append(f"recipe {row['recipe'][:8]}")
    return f"{row['title']} ({', '.join(distinctions)})" if distinctions else row["title"]


def object_planes(planes: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Depth of the plane that each object belongs to, spelled as in the keys of `Score.objects`."""
    plane_of: dict[str, str] = {}
    for row in planes:
        for name in (row["object"] or "").split(", "):
            plane_of[name] = f"{row['z_mm']:g}"
    return plane_of


_IOU = Measure("iou", lambda row: over_planes(row, "object").get("iou"), 1)
_BAD_1PX = Measure("bad_1px", lambda row: row["depth"].get("bad_1px"), -1)


def _cells(rows: Sequence[Row]) -> Cells:
    """Rows of a group in the order of their light and method, and in each cell by seed."""
    cells: dict[tuple[Budget, str], dict[str, Row]] = defaultdict(dict)
    for row in sorted(rows, key=lambda row: (row["seed"] or 0, row["identity"])):
        cells[row["budget"], row["method"]][row["identity"]] = row
    return {cell: cells[cell] for cell in sorted(cells, key=lambda cell: (by_light(cell[0]), cell[1]))}


def _by_kind(cells: Cells) -> tuple[Cells, Cells]:
    """Cells of methods of removal, and of depth; all rows of a cell are of the same method."""
    depth = {cell: rows for cell, rows in cells.items() if "depth" in next(iter(rows.values()))}
    return {cell: rows for cell, rows in cells.items() if cell not in depth}, depth


def _group(recipe: str, rows: Sequence[Row]) -> dict[str, Any]:
    cells = _cells(rows)
    removal, depth = _by_kind(cells)
    names = {row["identity"]: row["dataset"] for row in rows}
    return {
        "recipe": recipe,
        "title": rows[0]["title"],
        "scene": rows[0]["scene"],
        "datasets": len(names),
        "results": [_result(*cell, list(own.values())) for cell, own in cells.items()],
        "paired": [*_paired(removal, _IOU), *_paired(depth, _BAD_1PX)],
        "monotonic": [*_losses(removal, _IOU), *_losses(depth, _BAD_1PX)],
        "table1": [
            entry
            for (budget, method), by_dataset in removal.items()
            if method == TABLE_1_METHOD
            for entry in _table1(budget, list(by_dataset.values()))
        ],
    }


def _result(budget: Budget, method: str, rows: Sequence[Row]) -> dict[str, Any]:
    photons = [row["photons_per_view"] for row in rows if row["photons_per_view"] is not None]
    seconds = [row["seconds"] for row in rows if row["seconds"] is not None]  # of maps nobody knows
    result: dict[str, Any] = {
        "budget": budget,
        "method": method,
        "seeds": len(rows),
        "photons_per_view": sum(photons) / len(photons) if photons else None,
        "seconds": positive_mean_interval(seconds).figures() if seconds else None,
    }
    if "depth" in rows[0]:
        return result | {"depth": _means([row["depth"] for row in rows])} | _bounds(rows)
    depths = sorted({plane["z_mm"] for row in rows for plane in row["planes"]})
    for kind in TRUTHS:
        result[kind] = _means([over_planes(row, kind) for row in rows])
    result["planes"] = [
        {"z_mm": z} | {kind: _means([_plane(row, kind, z) for row in rows]) for kind in TRUTHS}
        for z in depths
    ]
    return result


def _bounds(rows: Sequence[Row]) -> dict[str, Any]:
    """`bounds`: means over seeds of each object's bound on depth and what it follows from."""
    by_object: dict[str, list[dict[str, float | None]]] = defaultdict(list)
    for row in rows:
        for entry in row.get("bounds", {}).get("objects", ()):
            by_object[entry["name"]].append({name: entry[name] for name in entry if name != "name"})
    found = [{"name": name, **_means(entries)} for name, entries in by_object.items()]
    return {"bounds": {"objects": found}} if found else {}


def over_planes(row: Row, kind: str) -> dict[str, float | None]:
    """Means over a row's planes of each score against one kind of truth, of the planes that have it."""
    planes = [_plane_scores(plane) for plane in row["planes"] if plane["truth"] == kind]
    means: dict[str, float | None] = {}
    for name in dict.fromkeys(name for plane in planes for name in plane):
        known = [value for plane in planes if (value := plane.get(name)) is not None]
        means[name] = sum(known) / len(known) if known else None
    return means


def _plane(row: Row, kind: str, z_mm: float) -> dict[str, float | None]:
    for plane in row["planes"]:
        if plane["truth"] == kind and plane["z_mm"] == z_mm:
            return _plane_scores(plane)
    return {}


def _plane_scores(plane: Mapping[str, Any]) -> dict[str, float | None]:
    return {name: value for name, value in plane.items() if name not in ("z_mm", "object", "truth")}


def _means(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean and interval of each score, also nested, over the rows that have it; None if none has."""
    means: dict[str, Any] = {}
    for name in dict.fromkeys(name for row in rows for name in row):
        known = [value for row in rows if (value := row.get(name)) is not None]
        if not known:
            means[name] = None
            continue
        if isinstance(known[0], Mapping):
            means[name] = _means(known)
            continue
        if name in SIGNED:
            mean = mean_interval(known)
        elif name in SHARES:
            mean = mean_interval(known, (0.0, 1.0))
        else:
            mean = positive_mean_interval(known)
        means[name] = mean.figures()
    return means


def _compared(first: Mapping[str, Row], second: Mapping[str, Row], measure: Measure) -> dict[str, Any] | None:
    """The measure of the first rows minus that of the second, on the datasets of both."""
    pairs: list[tuple[float, float]] = []
    for identity in first:
        if identity in second:
            a, b = (measure.of(rows[identity]) for rows in (first, second))
            if a is not None and b is not None:
                pairs.append((a, b))
    if not pairs:
        return None
    test = paired_difference([a for a, _ in pairs], [b for _, b in pairs])
    return {"measure": measure.name, **test.figures()}


def _paired(cells: Cells, measure: Measure) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for (budget, method), (other_budget, other_method) in combinations(cells, 2):
        if budget != other_budget:
            continue
        comparison = _compared(cells[budget, method], cells[other_budget, other_method], measure)
        if comparison is not None:
            entries.append({"budget": budget, "methods": [method, other_method], **comparison})
    return entries


def _losses(cells: Cells, measure: Measure) -> list[dict[str, Any]]:
    """Where the whole interval of the change from one budget to the next larger one is for the worse."""
    entries: list[dict[str, Any]] = []
    for method in sorted({method for _, method in cells}):
        for fewer, more in pairwise(cell for cell in cells if cell[1] == method):
            comparison = _compared(cells[more], cells[fewer], measure)
            interval = None if comparison is None else comparison["difference"]["interval"]
            if interval is not None and max(measure.sign * end for end in interval) < 0:
                assert comparison is not None
                entries.append({"method": method, "from": fewer[0], "to": more[0], **comparison})
    return entries


def _table1(budget: Budget, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """In how many seeds each object's entropy is lowest at the object's plane, and by how many bits."""
    gaps: dict[tuple[str, str], list[float]] = defaultdict(list)
    for row in rows:
        plane_of = object_planes(row["planes"])
        for entry in row["objects"]:
            name = entry["name"]
            bits = {z: value for z, value in entry["entropy"].items() if value is not None}
            at_plane = bits.pop(plane_of.get(name, ""), None)
            if at_plane is not None and bits:
                gaps[name, plane_of[name]].append(min(bits.values()) - at_plane)
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
