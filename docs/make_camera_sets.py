"""Print the tables of docs/camera_sets.md, what sets of cameras can know: `python docs/make_camera_sets.py`.

It takes ten minutes on two idle cores.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd

import pcii
import simgen
from pcii.depth import depth_map_of
from pcii.removal import masks_of

SIDE_PX, FILM_MM, FOCAL_MM = 256, 36.0448, 50.0
FAR_MM, NEAR_MM = 620.0, 540.0
"""Baselines are stated as the difference of total disparity between these depths."""
K, L = np.indices((5, 5))
SETS = {
    "10 × 10": np.ones((10, 10), bool),
    "10 × 10, 5 dead": np.ones((10, 10), bool),
    "5 × 5": np.ones((5, 5), bool),
    "cross of 9 in 5 × 5": (K == 2) | (L == 2),
    "chessboard of 13 in 5 × 5": (K + L) % 2 == 0,
    "3 × 3": np.ones((3, 3), bool),
    "2 × 2": np.ones((2, 2), bool),
    "1 × 9": np.ones((1, 9), bool),
    "9 × 1": np.ones((9, 1), bool),
    "1 × 2": np.ones((1, 2), bool),
}
"""Which cameras of a grid work. All sets have the same baseline along the axes that they have."""
SETS["10 × 10, 5 dead"][(0, 2, 4, 6, 9), (3, 7, 4, 1, 8)] = False
SCENES = {
    "Two objects": (simgen.load_scene("two_objects"), (450.0, 750.0), (100, 1000, 10_000), 1000),
    "The room": (simgen.load_scene("drawn_room", number=103), (400.0, 850.0), (1000, 10_000), 10_000),
}
"""Scene, range of depths, amounts of light and that of the baselines.

Light is in photons per view of 10 x 10 cameras; other sets have as many in all views together.
"""
USUAL_PX = 10.0
DIFFERENCES_PX = 2.0, 5.0, USUAL_PX, 20.0
OF_BASELINES = "10 × 10", "2 × 2"
NO_PHOTONS = {"within 1 px": "one depth", "three-step": "everything", "posterior": "everything"}
"""Columns, and that of the same score of whoever looks at no photon."""


def main() -> None:
    """All sets in all light at one baseline, then some at all baselines in the same light."""
    for scene, (_, _, lights, _) in SCENES.items():
        for photons in lights:
            rows = {cameras: measure(scene, cameras, USUAL_PX, photons) for cameras in SETS}
            show(f"{scene}, {photons} photons per view", "cameras", rows)
    for scene, (*_, photons) in SCENES.items():
        for cameras in OF_BASELINES:
            rows = {f"{px:g}": measure(scene, cameras, px, photons) for px in DIFFERENCES_PX}
            show(f"{scene}, {photons} photons per view, {cameras} cameras", "px apart", rows)


def grid_of(rows: int, cols: int, difference_px: float) -> pcii.CameraGrid:
    """The grid whose total disparities at `NEAR_MM` and `FAR_MM` differ by `difference_px`."""
    pixel_mm = FILM_MM / SIDE_PX
    baseline_mm = difference_px * pixel_mm / FOCAL_MM / (1 / NEAR_MM - 1 / FAR_MM)
    pitch_mm = baseline_mm / (max(rows, cols) - 1)
    film = {"pixel_mm": pixel_mm, "height": SIDE_PX, "width": SIDE_PX}
    return pcii.CameraGrid(rows=rows, cols=cols, pitch_mm=(pitch_mm, pitch_mm), focal_mm=FOCAL_MM, **film)


@cache
def drawn(scene: str, rows: int, cols: int, difference_px: float) -> tuple[pcii.PhotonCounts, pcii.Truth]:
    """The most photons that any set of this grid needs, once: other draws are samples of them."""
    fewest = min(int(works.sum()) for works in SETS.values() if works.shape == (rows, cols))
    world, _, lights, usual = SCENES[scene]
    most = 100 * (max(lights) if difference_px == USUAL_PX else usual)
    grid = grid_of(rows, cols, difference_px)
    counts, truth = simgen.draw_photons(world, grid, budget=1.02 * most / fewest, seed=1)
    return counts, replace(truth, photons=None)  # which are of these counts, not of samples


@cache
def measure(scene: str, cameras: str, difference_px: float, photons: int) -> dict[str, float]:
    """Scores of depth and removal, and of whoever looks at no photon, by the titles of their columns."""
    works, (world, z_range_mm, _, _) = SETS[cameras], SCENES[scene]
    counts, truth = drawn(scene, *works.shape, difference_px)
    e = counts.events
    k, l, i, j, n = (column[works[e.k, e.l]] for column in (e.k, e.l, e.i, e.j, e.n))
    counts = pcii.PhotonCounts.from_events(k, l, i, j, n, counts.grid, cfa=counts.cfa)
    counts = counts.subsample(100 * photons, np.random.default_rng((1, photons)))
    posterior = pcii.depth_posterior(counts, z_range_mm, z_mm=world.planes_mm)
    steps = pcii.segment(counts, world.planes_mm, method="three-step")
    score = pcii.score(
        (steps, masks_of(posterior, steps.sections)), depth_map_of(posterior, z_range_mm), truth
    )
    planes = [plane for plane in score.planes if plane["truth"] == "object"]
    iou = pd.DataFrame(planes).groupby("method", sort=False)["iou"].mean()
    return {
        "within 1 px": score.depth["within_1px"],
        "one depth": score.depth["one_depth"]["within_1px"],
        "3 px": score.depth["within_3px"],
        "answered": score.depth["coverage"],
        **iou,
        "everything": float(np.mean([plane["everything"]["iou"] for plane in planes])),
    }


def show(title: str, first: str, rows: Mapping[str, Mapping[str, float]]) -> None:
    """Print a table in Markdown, with a mark at what is no better than whoever looks at no photon."""
    names = list(next(iter(rows.values())))
    print(f"**{title}**\n\n| {' | '.join((first, *names))} |\n| :-- |{' --: |' * len(names)}")
    for row_name, row in rows.items():
        least = {name: row[NO_PHOTONS[name]] if name in NO_PHOTONS else -1.0 for name in names}
        cells = [f"{row[name]:.2f}{' †' if row[name] <= least[name] else ''}" for name in names]
        print(f"| {' | '.join((row_name, *cells))} |")
    print(flush=True)


if __name__ == "__main__":
    main()
