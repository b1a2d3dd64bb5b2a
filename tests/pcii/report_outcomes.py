"""Results of a small dataset, by hand, and what a report says of them."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pcii.app import Outcome, write_report
from pcii.metrics import score
from pcii.sections import depth_range_of, reconstruct
from pcii.store import save_dataset
from pcii.types import CameraGrid, DepthMap, PhotonCounts, Segmented, Truth, Views

GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.2, GRID.shape_KLHW), GRID, cfa="GRBG")
LIGHT = Views(np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32), GRID)
IDS = np.zeros((40, 48), np.int16)
IDS[10:30, 8:20], IDS[12:28, 28:40] = 3, 7
Z_MM = np.select([IDS == 3, IDS == 7], [500.0, 700.0], np.inf)
TRUTH = Truth(Z_MM, IDS, {3: "ball", 5: "unseen", 7: "card"})
FOUND = np.where(IDS > 0, np.where(IDS > 0, Z_MM, 0) + np.linspace(-3, 5, 48), np.nan)


def outcome_of(root: Path, images: Any, truth: Truth | None, z_mm: tuple[float, ...] = (500, 700)) -> Outcome:
    """Results as `analyse` gives them, of a method that keeps the first object, with a depth by hand."""
    dataset = save_dataset(root, images, truth, z_mm=list(z_mm), title="By hand")
    sections = reconstruct(dataset.counts_or_views, z_mm)
    focus: tuple[Segmented, ...] = ()
    if dataset.has_counts:
        kept = np.repeat((IDS == 3)[None], len(z_mm), axis=0)
        focus = (Segmented(kept, "by hand", sections),)
    depth = DepthMap(FOUND, np.where(np.isfinite(FOUND), 0.75, 0.0))
    result = score(focus, depth, truth, grid=dataset.grid, dataset=dataset.name)
    full_light = None if dataset.views is None else reconstruct(dataset.views, z_mm)
    z_range_mm = depth_range_of(dataset)
    return Outcome(dataset, full_light, sections, focus, depth, result, z_range_mm, {"depth": 1.0})


class Written(NamedTuple):
    """Results, and the report of them."""

    outcome: Outcome
    path: Path

    @property
    def page(self) -> str:
        return self.path.read_text(encoding="utf-8")


def page_of(outcome: Outcome, folder: Path) -> str:
    write_report(folder / "report.html", outcome)
    return (folder / "report.html").read_text(encoding="utf-8")
