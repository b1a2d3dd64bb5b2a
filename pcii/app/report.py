"""report.html: a slider through the depths, pictures of each plane, depth, scores, and how it was made.

A single file that fetches nothing, which can be mailed, archived and printed. Its pictures and text need no
script; the slider is by the one in `pcii/evaluation/templates/report.js`.
"""

import json
import shlex
from datetime import UTC, datetime
from pathlib import Path

from pcii.app.command_options import budget_words
from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import Pictures, depth_panels, input_panels, plane_panels, slider_panels
from pcii.app.report_tables import depth_table, entropy_table, key_facts, score_table
from pcii.base.progress import Report, silent
from pcii.base.safe_files import write_bytes_safely
from pcii.depth.methods import DEFAULT_METHOD
from pcii.evaluation.method_names import NamedMethod, depth_name, software_of
from pcii.evaluation.pages import page
from pcii.store.software import machine

COARSE_PX = 320
"""Smaller pictures are enlarged with sharp pixels."""


def write_report(path: Path, outcome: Outcome, report: Report = silent) -> None:
    """Write the report of one run as a self-contained HTML file."""
    dataset, pictures = outcome.dataset, Pictures.of(outcome)
    grid = dataset.grid
    content = {
        "title": dataset.manifest.get("title") or dataset.name,
        "grid": grid,
        "cfa": dataset.cfa,
        "photons": dataset.counts.total if dataset.has_counts else None,
        "has_truth": dataset.truth is not None,
        "facts": key_facts(outcome),
        "is_coarse": max(grid.shape_HW) < COARSE_PX,
        "smoothing_px": pictures.smoothing_px,
        "light": pictures.light,
        "slider": slider_panels(pictures, report),
        "input": input_panels(pictures),
        "planes": plane_panels(pictures),
        "depth": depth_panels(pictures),
        "depth_table": depth_table(outcome),
        "entropies": entropy_table(outcome),
        "scores": score_table(outcome),
        "origin": origin(outcome),
        "recipe": json.dumps(dataset.manifest.get("recipe"), indent=1, ensure_ascii=False).splitlines(),
    }
    write_bytes_safely(path, page("report.html.j2", content, script="report.js"))


def origin(outcome: Outcome) -> list[tuple[str, str]]:
    """How the report and its dataset were made: names and values, folders by their names alone."""
    manifest = outcome.dataset.manifest
    methods = (*(focus.method for focus in outcome.focus), depth_name(outcome.depth_method))
    versions: dict[str, str] = {}
    for method in methods:
        versions |= software_of(NamedMethod(method)) or {}
    seconds = ", ".join(f"{name} {value:.2f} s" for name, value in outcome.timings_s.items())
    rows = [
        ("command", _command(outcome)),
        ("date", f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"),
        ("machine", machine()),
        ("time", seconds),
        ("software", _versions(versions)),
        ("dataset", outcome.dataset.name),
    ]
    rows += [(key, str(manifest[key])) for key in ("origin", "licence", "citation") if manifest.get(key)]
    if manifest.get("versions"):
        rows.append(("dataset made by", _versions(manifest["versions"])))
    if manifest.get("identity"):
        rows.append(("identity", manifest["identity"]))
    return rows


def _versions(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in versions.items())


def _command(outcome: Outcome) -> str:
    """The command that makes the same report, with all that it may leave out."""
    words = ["pcii", "run", outcome.dataset.name, "-o", "RESULTS"]
    for z in outcome.sections.z_mm:
        words += ["--z-mm", f"{z:.17g}" if float(f"{z:g}") != z else f"{z:g}"]
    for focus in outcome.focus:
        words += ["--method", focus.method]
    if outcome.depth_method != DEFAULT_METHOD:
        words += ["--depth-method", outcome.depth_method]
    return shlex.join([*words, *budget_words(outcome.dataset)])
