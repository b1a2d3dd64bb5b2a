"""report.html: a slider through the depths, and the paper's figures and table for one dataset with its truth.

A single file that fetches nothing, which can be mailed, archived and printed. Its pictures and text need no
script; the slider and the read-out are by the one in `pcii/evaluation/templates/report.js`.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.app.report_figures import Crop, Shown, depth_panels, figure6, figure7
from pcii.app.report_origin import origin
from pcii.app.report_slider import slider
from pcii.app.report_tables import depth_table, key_facts, score_table, table1
from pcii.base.progress import Report, silent
from pcii.base.safe_files import write_bytes_safely
from pcii.evaluation.pages import page

PAPER_SCENE, PAPER_PLANES_MM = "two_objects", [540.0, 620.0]
PAPER_TABLE_1 = (("object 1", "1.04", "1.35"), ("object 2", "1.44", "1.05"))

COARSE_PX = 320
"""Smaller pictures are enlarged with sharp pixels."""


def write_report(
    path: Path, outcome: Outcome, report: Report = silent, smoothing_px: float | None = None
) -> None:
    """Write the report of one run as a self-contained HTML file.

    Photons of sections are shown smoothed by a Gaussian with a standard deviation of `smoothing_px`: by
    default what so many photons need, 0 for none.
    """
    content = _content(outcome, smoothing_px, report)
    write_bytes_safely(path, page("report.html.j2", content, script="report.js"))


def _content(outcome: Outcome, asked_px: float | None, report: Report) -> dict[str, Any]:
    dataset, shown = outcome.dataset, Shown.of(outcome, asked_px)
    manifest, truth, crop = dataset.manifest, dataset.truth, shown.crop
    return {
        "title": manifest.get("title") or dataset.name,
        "grid": dataset.grid,
        "cfa": dataset.cfa,
        "photons": dataset.counts.total if dataset.has_counts else None,
        "has_radiance": dataset.views is not None,
        "has_truth": truth is not None,
        "has_objects": truth is not None and truth.has_objects,
        "is_paper": _is_paper(outcome),
        "paper_table1": PAPER_TABLE_1,
        "facts": key_facts(outcome),
        "crop": {
            "words": _crop_in_words(crop, dataset.grid.height, dataset.grid.width),
            "width": crop.width_px,
            "height": crop.height_px,
            "is_coarse": max(crop.width_px, crop.height_px) < COARSE_PX,
        },
        "smoothing_px": shown.smoothing_px,
        "slider": slider(shown, report),
        "figure6": figure6(shown),
        "figure7": figure7(shown),
        "depth": depth_panels(shown),
        "has_depths": bool(np.isfinite(outcome.depth.z_mm).any()),
        "depth_range": [f"{z:g}" for z in outcome.z_range_mm],
        "error_limit": f"{shown.error_mm[1]:g}" if truth is not None else None,
        "depth_table": depth_table(outcome),
        "table1": table1(outcome),
        "scores": score_table(outcome),
        "origin": origin(outcome, asked_px),
    }


def _is_paper(outcome: Outcome) -> bool:
    """Whether figures and tables are those of the paper, and may have their numbers."""
    recipe = outcome.dataset.manifest.get("recipe") or {}
    return recipe.get("scene") == PAPER_SCENE and outcome.sections.z_mm.tolist() == PAPER_PLANES_MM


def _crop_in_words(crop: Crop, height: int, width: int) -> str:
    whole = (crop.height_px, crop.width_px) == (height, width)
    rows, cols = (f"{side.start} to {side.stop - 1}" for side in (crop.rows, crop.cols))
    part = "the whole frame" if whole else f"rows {rows}, columns {cols} of the frame"
    return part if crop.step_px == 1 else f"{part}, {crop.step_px} × {crop.step_px} pixels as one"
