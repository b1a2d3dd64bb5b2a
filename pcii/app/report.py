"""report.html: a slider through the depths, pictures of each plane, depth, scores, and how it was made.

A single file that fetches nothing, which can be mailed, archived and printed. Its pictures and text need no
script; the slider is by the one in `pcii/figures/templates/report.js`. In tables a column or row of which
nothing is known is left out.
"""

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import report_panels
from pcii.base import write_bytes_safely
from pcii.evaluation import NamedMethod, depth_name, mean_interval, software_of
from pcii.figures import NOT_KNOWN, emphasised, render_page, text_table
from pcii.metrics import entropy_region
from pcii.sections import pooled_estimate, pooled_samples, reconstruct, region_entropy_bits, section_window_px
from pcii.store import machine
from pcii.types import PhotonCounts, Sections, Truth

if TYPE_CHECKING:
    from pandas import DataFrame

NUMBERS = (
    "iou",
    "everything",
    "precision",
    "recall",
    "f1",
    "boundary_f",
    "photon_precision",
    "photon_recall",
)
NUMBERS += ("entropy_before", "entropy_after", "claimed_share", "false_share")
"""Columns of the scores after those that say what is scored."""
NAMES = {"iou": "IoU", "everything": "IoU of all claimed", "f1": "F1", "boundary_f": "boundary F"}
NAMES |= {"false_share": "claimed falsely"}
"""Names of columns, where they are not those of the scores."""
JACKKNIFE_GROUPS = 10
"""Intervals of so few pseudo-values are 15 % longer than those of many, and take a fraction of the time."""
MAX_JACKKNIFE_EVENTS = 5_000_000
"""With more pixels that have photons, intervals are narrower than the digits that are shown."""


def write_report(path: Path, outcome: Outcome) -> None:
    """Write the report of one run as a self-contained HTML file."""
    dataset = outcome.dataset
    content = {
        "title": dataset.manifest.get("title") or dataset.name,
        "grid": dataset.grid,
        "cfa": dataset.cfa,
        "photons": dataset.counts.total if dataset.has_counts else None,
        "has_truth": dataset.truth is not None,
        **report_panels(outcome),
        "depth_table": _depth_table(outcome),
        "entropies": _entropy_table(outcome),
        "scores": _score_table(outcome),
        "origin": text_table(_origin(outcome), ("what", "value"), words=2),
        "recipe": json.dumps(dataset.manifest.get("recipe"), indent=1, ensure_ascii=False).splitlines(),
    }
    write_bytes_safely(path, render_page("report.html.j2", content, script="report.js"))


def _origin(outcome: Outcome) -> list[tuple[str, str]]:
    """How the report and its dataset were made: names and values, folders by their names alone."""
    manifest = outcome.dataset.manifest
    methods = (*(focus.method for focus in outcome.focus), depth_name(outcome.depth_method))
    versions: dict[str, str] = {}
    for method in methods:
        versions |= software_of(NamedMethod(method)) or {}
    seconds = {name: f"{value:.2f} s" for name, value in outcome.timings_s.items()}

    def listed(words: Mapping[str, str]) -> str:
        return ", ".join(f"{name} {value}" for name, value in words.items())

    rows = [
        ("date", f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"),
        ("machine", machine()),
        ("time", listed(seconds)),
        ("software", listed(versions)),
        ("methods", ", ".join(methods)),
        ("dataset", outcome.dataset.name),
    ]
    if outcome.dataset.choice is not None:
        rows.append(("photon budget", str(outcome.dataset.choice)))
    rows += [(key, str(manifest[key])) for key in ("origin", "licence", "citation") if manifest.get(key)]
    if manifest.get("versions"):
        rows.append(("dataset made by", listed(manifest["versions"])))
    if manifest.get("identity"):
        rows.append(("identity", manifest["identity"]))
    return rows


def _entropy_table(outcome: Outcome) -> "DataFrame":
    """Entropies of the objects at each plane with their intervals (the paper's Table 1).

    The lowest of a row stands out. There are no intervals of too few photons, nor of radiance.
    """
    objects, dataset = outcome.score.objects, outcome.dataset
    half_widths: list[dict[str, float]] = []
    if objects and dataset.has_counts and dataset.truth is not None:
        half_widths = _entropy_half_widths(dataset.counts, outcome.sections, dataset.truth)
    rows: list[tuple[str, ...]] = []
    for row, half in zip(objects, half_widths or [{}] * len(objects), strict=True):
        entropy = row["entropy"]
        if None in entropy.values():
            continue
        texts = {z: f"{bits:.3f}" + (f" ± {half[z]:.3f}" if z in half else "") for z, bits in entropy.items()}
        if len(entropy) > 1:
            lowest = min(entropy.values())
            texts |= {z: emphasised(texts[z]) for z, bits in entropy.items() if bits == lowest}
        rows.append((row["name"], *texts.values()))
    return text_table(rows, ("object", *(f"{z:g} mm" for z in outcome.sections.z_mm)))


def _entropy_half_widths(counts: PhotonCounts, sections: Sections, truth: Truth) -> list[dict[str, float]]:
    """Half the 95 % interval of each entropy in `Score.objects`, in bits, by depth spelled as there.

    A jackknife over photons (Quenouille 1956; Tukey 1958): every photon is in one of G random groups. With H
    the entropy of all photons and H_g that of all but group g, the pseudo-values G H - (G - 1) H_g have about
    the mean H, and their interval by Student's t is that of H over draws of the photons. Its variance is
    rather too large than too small (Efron and Stein 1981). Objects that are not seen have none; more than
    `MAX_JACKKNIFE_EVENTS` events, or fewer than G photons, give an empty list. `sections` are of `counts`.
    """
    if counts.total < JACKKNIFE_GROUPS or counts.events.n.size > MAX_JACKKNIFE_EVENTS:
        return []
    regions = [entropy_region(sections.grid, truth, number, sections.z_mm) for number in sorted(truth.names)]
    window_px = section_window_px(sections)
    samples = pooled_samples(sections, window_px)

    def entropies(counts_ZHWC: np.ndarray) -> np.ndarray:
        """Entropies (objects, planes) of Eq. 9, as `score` computes them."""
        stack = Sections(sections.planes, counts_ZHWC, sections.coverage)
        pooled = pooled_estimate(stack, window_px, samples)
        tops = pooled.max(axis=(0, 1, 2))
        return np.array([[region_entropy_bits(plane, each, tops) for plane in pooled] for each in regions])

    groups = (reconstruct(group, sections.planes).counts for group in _photon_groups(counts))
    without_group = [entropies(sections.counts - group) for group in groups]
    G, of_all = JACKKNIFE_GROUPS, entropies(sections.counts)
    pseudo_values = G * of_all - (G - 1) * np.stack(without_group)  # (groups, objects, planes)
    half_widths: list[dict[str, float]] = []
    for values, region in zip(np.moveaxis(pseudo_values, 0, -1), regions, strict=True):
        intervals = map(mean_interval, values if region.any() else ())
        half = (interval.high - interval.mean for interval in intervals)
        half_widths.append({f"{z:g}": bits for z, bits in zip(sections.z_mm, half, strict=False)})
    return half_widths


def _photon_groups(counts: PhotonCounts) -> Iterator[PhotonCounts]:
    """The photons in `JACKKNIFE_GROUPS` groups, the same whenever this is called."""
    rng, events = np.random.default_rng(0), counts.events
    remaining = events.n.copy()
    for group in range(JACKKNIFE_GROUPS):
        n = rng.binomial(remaining, 1 / (JACKKNIFE_GROUPS - group))
        remaining -= n
        places = (axis[n > 0] for axis in (events.k, events.l, events.i, events.j, n))
        yield PhotonCounts.from_events(*places, grid=counts.grid, cfa=counts.cfa)


def _score_table(outcome: Outcome) -> "DataFrame":
    """Scores of every method at every plane against both kinds of truth; without truth its entropies."""
    rows = [{**row, "everything": row["everything"]["iou"]} for row in outcome.score.planes]
    words = ["plane", "method", "truth", "objects"]
    truth = outcome.dataset.truth
    if truth is None:
        words, rows = words[:2], [row for row in rows if row["truth"] == "object"]
    elif not truth.are_objects_known:
        rows = [row for row in rows if row["truth"] == truth.mask_kind]
    numbers = [key for key in NUMBERS if any(row[key] is not None for row in rows)]
    cells: list[tuple[str, ...]] = []
    for row in rows:
        objects = "all in focus" if row["truth"] == "pixel" else row["object"] or "none at this plane"
        texts = [f"{row['z_mm']:g} mm", row["method"], row["truth"], objects][: len(words)]
        cells.append((*texts, *(NOT_KNOWN if row[key] is None else f"{row[key]:.3f}" for key in numbers)))
    header = (*words, *(NAMES.get(key, key.replace("_", " ")) for key in numbers))
    return text_table(cells, header, words=len(words))


def _depth_table(outcome: Outcome) -> "DataFrame":
    """Measures of the depth map that are known, over the objects' pixels or, without objects, over all."""
    depth, truth = outcome.score.depth, outcome.dataset.truth
    rows: list[tuple[str, str]] = []
    if truth is not None and depth["coverage"] is not None:
        pixels = "the objects' pixels" if truth.has_objects else "all pixels with a true depth"
        rows.append((f"share with an estimate, of {pixels}", f"{depth['coverage']:.1%}"))
        for limit in (1, 3):
            name = f"within {limit} px of total disparity (by the best answer of one depth everywhere)"
            of_one_depth = depth["one_depth"][f"within_{limit}px"]
            rows.append((name, f"{depth[f'within_{limit}px']:.1%} ({of_one_depth:.1%})"))
        for name, key in (
            ("median error of all of them", "median"),
            ("mean error of those with an estimate", "mae"),
            ("median signed error of those with an estimate", "bias"),
        ):
            if depth[f"{key}_mm"] is not None:
                value = f"{depth[f'{key}_mm']:.2f} mm, {depth[f'{key}_px']:.2f} px of total disparity"
                rows.append((name, value))
        scores = f"{depth['quadratic_score']:.3f} ({depth['one_depth']['quadratic_score']:.3f})"
        rows.append(("quadratic score of the confidence (of one depth)", scores))
    if depth["ece"] is not None:
        rows.append(("expected calibration error of the confidence", f"{depth['ece']:.3f}"))
    for row in outcome.score.bounds["objects"]:
        if row["depth_sigma_px"] is not None:
            bound = f"{row['depth_sigma_px']:.3f} px of total disparity"
            rows.append((f"Cramér-Rao bound on the standard deviation for {row['name']}", bound))
    return text_table(rows, ("measure", "value"), words=2)
