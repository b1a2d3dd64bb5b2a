"""report.html: a slider through the depths, pictures of each plane, depth, scores, and how it was made.

A single file that fetches nothing, which can be mailed, archived and printed. Its pictures and text need no
script; the slider is by the one in `pcii/figures/templates/report.js`.
"""

import json
from datetime import UTC, datetime
from pathlib import Path

from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import Pictures, depth_panels, input_panels, plane_panels, slider_panels
from pcii.app.report_tables import depth_table, entropy_table, score_table
from pcii.base.safe_files import write_bytes_safely
from pcii.evaluation.method_names import NamedMethod, depth_name, software_of
from pcii.figures.pages import render_page, text_table
from pcii.store.software import machine

COARSE_PX = 320
"""Smaller pictures are enlarged with sharp pixels."""


def write_report(path: Path, outcome: Outcome) -> None:
    """Write the report of one run as a self-contained HTML file."""
    dataset, pictures = outcome.dataset, Pictures.of(outcome)
    grid, (rows, cols) = dataset.grid, pictures.box
    slider, first = slider_panels(pictures)
    content = {
        "title": dataset.manifest.get("title") or dataset.name,
        "grid": grid,
        "cfa": dataset.cfa,
        "photons": dataset.counts.total if dataset.has_counts else None,
        "has_truth": dataset.truth is not None,
        "rows": rows,
        "cols": cols,
        "is_coarse": max(rows.stop - rows.start, cols.stop - cols.start) < COARSE_PX,
        "smoothing_px": pictures.smoothing_px,
        "light": pictures.light,
        "slider": slider,
        "first": first,
        "input": input_panels(pictures),
        "planes": plane_panels(pictures),
        "depth": depth_panels(pictures),
        "depth_table": depth_table(outcome),
        "entropies": entropy_table(outcome),
        "scores": score_table(outcome),
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
    seconds = ", ".join(f"{name} {value:.2f} s" for name, value in outcome.timings_s.items())
    rows = [
        ("date", f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"),
        ("machine", machine()),
        ("time", seconds),
        ("software", _versions(versions)),
        ("methods", ", ".join(methods)),
        ("dataset", outcome.dataset.name),
    ]
    if outcome.dataset.choice is not None:
        rows.append(("photon budget", str(outcome.dataset.choice)))
    rows += [(key, str(manifest[key])) for key in ("origin", "licence", "citation") if manifest.get(key)]
    if manifest.get("versions"):
        rows.append(("dataset made by", _versions(manifest["versions"])))
    if manifest.get("identity"):
        rows.append(("identity", manifest["identity"]))
    return rows


def _versions(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in versions.items())
