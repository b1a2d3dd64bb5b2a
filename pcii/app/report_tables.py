"""Numbers of a report as text: key facts, Table 1, scores of the masks and of the depth map.

A column or row of which nothing is known is left out.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from pcii.app.pipeline import Outcome
from pcii.evaluation.entropy_intervals import entropy_half_widths
from pcii.evaluation.rows import object_planes
from pcii.evaluation.tables import METHOD, Column, Table, tabulated
from pcii.sections.photon_statistics import saturation_loss

Row = Mapping[str, Any]
NUMBERS = (
    ("IoU", "iou"),
    ("oracle", "iou_oracle"),
    ("precision", "precision"),
    ("recall", "recall"),
    ("F1", "f1"),
    ("boundary F", "boundary_f"),
    ("photon precision", "photon_precision"),
    ("photon recall", "photon_recall"),
    ("entropy before", "entropy_before"),
    ("entropy after", "entropy_after"),
)
"""Columns of the scores after those that say what is scored."""


def key_facts(outcome: Outcome) -> list[tuple[str, str]]:
    """What the reader wants to know first: a few names and values."""
    dataset, score = outcome.dataset, outcome.score
    facts: list[tuple[str, str]] = []
    if dataset.has_counts:
        counts, readout = dataset.counts, dataset.counts.readout
        facts.append(("photons per view", f"{counts.total / dataset.grid.view_count:,.0f}"))
        if not readout.is_plain:
            bits = "" if readout.bits is None else f" of {readout.bits} bit{'s' * (readout.bits > 1)}"
            facts.append(("frames", f"{readout.frames:,}{bits}"))
        if readout.bits is not None:
            facts.append(("photons lost to saturation", f"{100 * saturation_loss(counts):.2g} %"))
    for focus in outcome.focus:
        ious = [
            row["iou"] for row in _rows_of(score.planes, focus.method, "object") if row["object"] is not None
        ]
        if ious and None not in ious:
            name = "IoU" if len(ious) == 1 else "mean IoU"
            facts.append((f"{name} of {focus.method}", f"{sum(ious) / len(ious):.3f}"))
    if score.depth["median_mm"] is not None:
        facts.append(("median error of depth", f"{score.depth['median_mm']:.2f} mm"))
        facts.append(("bias of depth", _bias(f"{score.depth['bias_mm']:+.2f} mm", score.depth["bias_mm"])))
        facts.append(("depths off by more than 1 px", _percent(score.depth["bad_1px"])))
    else:
        facts.append(("pixels with a depth", _percent(float((outcome.depth.confidence > 0).mean()))))
    return facts


def _rows_of(planes: Sequence[Row], method: str, kind: str) -> list[Row]:
    return [row for row in planes if row["method"] == method and row["truth"] == kind]


def table1(outcome: Outcome) -> dict[str, Any] | None:
    """Entropies of the objects with their intervals, and whether each is lowest at its plane."""
    objects, truth = outcome.score.objects, outcome.dataset.truth
    if truth is None or all(bits is None for row in objects for bits in row["entropy"].values()):
        return None
    halves = entropy_half_widths(outcome.dataset.counts, outcome.sections, truth)
    seen = [
        (row["name"], row["entropy"], half)
        for row, half in zip(objects, halves or [{}] * len(objects), strict=True)
        if None not in row["entropy"].values()
    ]
    columns: list[Column] = [("object", lambda entry: entry[0])]
    lowest: dict[str, set[int]] = {}
    depths = list(objects[0]["entropy"])
    for z in depths:
        columns.append((f"{z} mm", lambda entry, z=z: _with_half_width(entry[1][z], entry[2].get(z))))
        least = {number for number, (_, bits, _) in enumerate(seen) if bits[z] == min(bits.values())}
        lowest[f"{z} mm"] = least if len(depths) > 1 else set()
    return {
        "table": tabulated("Entropy of the objects", columns, seen, best=lowest),
        "has_intervals": bool(halves),
        "holds": table1_holds(objects, outcome.score.planes),
    }


def _with_half_width(bits: float, half: float | None) -> str:
    return f"{bits:.3f}" if half is None else f"{bits:.3f} ± {half:.3f}"


def table1_holds(objects: Sequence[Row], planes: Sequence[Row]) -> bool | None:
    """Whether each object's entropy is lowest at its plane; None if none has two planes to compare."""
    plane_of = object_planes(planes)
    verdicts: list[bool] = []
    for row in objects:
        bits = {z: value for z, value in row["entropy"].items() if value is not None}
        if row["name"] in plane_of and len(bits) > 1:
            verdicts.append(min(bits, key=lambda z: bits[z]) == plane_of[row["name"]])
    return all(verdicts) if verdicts else None


def score_table(outcome: Outcome) -> Table:
    """Scores of every method at every plane against both kinds of truth; without truth its entropies."""
    planes = outcome.score.planes
    oracles = outcome.score.bounds["planes"] or [{"iou_oracle": None}] * len(planes)
    rows = [{**row, "iou_oracle": bound["iou_oracle"]} for row, bound in zip(planes, oracles, strict=True)]
    columns: list[Column] = [("plane", lambda row: f"{row['z_mm']:g} mm"), METHOD]
    if outcome.dataset.truth is None:
        rows = [row for row in rows if row["truth"] == "object"]
    else:
        columns += [("truth", lambda row: row["truth"]), ("objects", _objects)]
    words = len(columns)
    columns += [
        (title, lambda row, key=key: _number(row[key]))
        for title, key in NUMBERS
        if any(row[key] is not None for row in rows)
    ]
    columns.append(("claimed share", lambda row: _percent(row["claimed_share"], 2)))
    return tabulated("Scores of the masks", columns, rows, words)


def _objects(row: Row) -> str:
    if row["truth"] == "pixel":
        return "all in focus"
    return row["object"] or "none at this plane"


def _bias(value: str, error_mm: float) -> str:
    return f"{value} (too {'far' if error_mm > 0 else 'near'})" if error_mm else value


def depth_table(outcome: Outcome) -> Table:
    """Measures of the depth map that are known, over the objects' pixels or, without objects, over all."""
    depth, truth = outcome.score.depth, outcome.dataset.truth
    where = (
        "the objects' pixels" if truth is not None and truth.has_objects else "all pixels with a true depth"
    )
    rows: list[tuple[str, str]] = []
    if depth["coverage"] is not None:
        rows.append((f"share with an estimate, of {where}", _percent(depth["coverage"])))
        if depth["median_mm"] is not None:
            for name in ("median", "mean"):
                key = {"median": "median", "mean": "mae"}[name]
                value = f"{depth[f'{key}_mm']:.2f} mm, {depth[f'{key}_px']:.2f} px of total disparity"
                rows.append((f"{name} error of those", value))
            value = f"{depth['bias_mm']:+.2f} mm, {depth['bias_px']:+.2f} px of total disparity"
            rows.append(("bias, the median of their signed errors", _bias(value, depth["bias_mm"])))
        rows.append(("off by more than 1 px of total disparity, or no estimate", _percent(depth["bad_1px"])))
        rows.append(("off by more than 3 px of total disparity, or no estimate", _percent(depth["bad_3px"])))
    hci = depth["hci_objects"]
    if hci["answered"]:
        value = (
            f"BadPix(0.07) {_percent(hci['badpix_007'])}, MSE × 100 {hci['mse_x100']:.2f}, "
            f"Q25 {hci['q25_x100']:.2f}"
        )
        rows.append((f"HCI 4D light field benchmark, px between neighbouring views, {where}", value))
    if depth["ece"] is not None:
        rows.append(("expected calibration error of the confidence", f"{depth['ece']:.3f}"))
    for row in outcome.score.bounds["objects"]:
        if row["depth_sigma_px"] is not None:
            bound = f"{row['depth_sigma_px']:.3f} px of total disparity"
            rows.append((f"Cramér-Rao bound on the standard deviation for {row['name']}", bound))
    return Table("Errors of the depth map", ("measure", "value"), tuple(rows), words=2)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def _percent(share: float, digits: int = 1) -> str:
    return f"{100 * share:.{digits}f} %"
