"""The model of the scene on drawn scenes: is the least energy beside the truth, and is it found?

Energies are of surfaces on a ladder of depths (`pcii.scene_model`), in nats above the true depths of cells:
of the best plane, of where the search ends that starts from the posterior of depth, and of where it ends from
the truth. Where the last is lowest, search is what fails; where it is not, the model is.
"""

import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.drawn import KINDS, TUNING, write_recipe
from benchmarks.figures import bars
from benchmarks.results import Measured, Row, Size, Study, Value
from benchmarks.scenes import film
from pcii.core.geometry import total_disparity_px
from pcii.depth.methods import depth_posterior
from pcii.imaging.blocks import on_pixels
from pcii.io.dataset import Dataset, open_dataset
from pcii.io.suggested_depths import depth_range_of, planes_of
from pcii.metrics.agreement import mask_agreement
from pcii.metrics.true_masks import TrueFocus
from pcii.removal.posterior_masks import PosteriorMasks, in_focus_at
from pcii.scene_model.energy import SceneEnergy
from pcii.scene_model.parameters import SceneParameters
from pcii.scene_model.ray_kernels import JUMP
from pcii.scene_model.rays import Rays
from pcii.scene_model.solver import best_plane, least_energy, state_of
from pcii.scene_model.starts import starts_of
from simgen.dataset.generation import generate
from simgen.spec.recipe import load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Energy of surfaces"
PLANE, FOUND, FROM_TRUTH, TRUTH = "best plane", "found", "from the truth", "truth"
SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"kinds": ("textured", "checks"), "numbers": (TUNING,), "side_px": 256, "budget": 1000},
    "full": {"kinds": tuple(KINDS), "numbers": range(TUNING, TUNING + 4), "side_px": 512, "budget": 1000},
}


def measure(kinds: Sequence[str], numbers: Sequence[int], side_px: int, budget: int) -> Measured:
    """Drawn scenes of these kinds and numbers, seen by the paper's cameras."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            for number in numbers:
                recipe = write_recipe(Path(folder), kind, number)
                settings = [*film(side_px), f"photons.budget={budget}", "products.radiance=none"]
                generate(*load_recipe(str(recipe), settings), Path(folder) / recipe.stem)
                rows += _rows(recipe.stem, open_dataset(Path(folder) / recipe.stem))
    return Measured(rows, (), list(numbers))


def _rows(scene: str, dataset: Dataset) -> list[Row]:
    """What is found in a scene, and how far above the truth it is."""
    rays = Rays.through(dataset.counts, depth_range_of(dataset), SceneParameters())
    energy = SceneEnergy(rays)
    truth = true_labels(dataset, rays)
    true = state_of(energy, truth)
    start = time.perf_counter()
    starts = starts_of(depth_posterior(dataset.counts, depth_range_of(dataset)), rays)
    found = least_energy(energy, starts)
    seconds = time.perf_counter() - start
    states = {
        PLANE: best_plane(energy),
        FOUND: found,
        FROM_TRUTH: least_energy(energy, [truth]),
        TRUTH: true,
    }
    rows = []
    for name, state in states.items():
        wrong = np.abs(state.labels.astype(int) - truth)[truth >= 0] > JUMP
        values = {
            "energy_nats": Value(state.total - true.total),
            "iou": Value(float(np.mean(overlaps(dataset, rays, state.labels)))),
            "wrong_depth_percent": Value(100 * float(wrong.mean())),
        }
        if name == FOUND:
            values["time_ms"] = Value(1e3 * seconds)
        rows.append(Row(TABLE, name, {"scene": scene}, values))
    return rows


def true_labels(dataset: Dataset, rays: Rays) -> np.ndarray:
    """Labels (h, w) int16 of the true depths of cells; what is far behind the ladder has none."""
    side, (h, w), total_px = rays.cell_px, rays.shape, rays.planes.total_disparity_px
    assert dataset.truth is not None
    z_mm = dataset.truth.z_mm[side // 2 :: side, side // 2 :: side][:h, :w]
    places = (total_disparity_px(dataset.grid, z_mm) - total_px[0]) / (total_px[1] - total_px[0])
    return np.where(places < -3, -1, np.clip(places.round(), 0, total_px.size - 1)).astype(np.int16)


def overlaps(dataset: Dataset, rays: Rays, labels: np.ndarray) -> list[float]:
    """IoU by object of what belongs to each plane that has objects."""
    assert dataset.truth is not None
    planes = planes_of(dataset, None)
    true = TrueFocus(dataset.grid, dataset.truth, planes.z_mm).by_object
    ladder_px = rays.planes.total_disparity_px
    near = in_focus_at(ladder_px, planes.total_disparity_px, PosteriorMasks.within_px)
    cells = near[:, labels] & (labels >= 0)
    masks = on_pixels(cells, rays.cell_px, dataset.grid.shape_HW)
    agreements = [mask_agreement(mask, own) for mask, own in zip(masks, true, strict=True) if own.any()]
    return [agreement["iou"] or 0.0 for agreement in agreements]


def draw(figure: "Figure", measured: Measured) -> None:
    """How far above the truth the search ends, from the posterior of depth and from the truth."""
    for axes, name in zip(figure.subplots(1, 2, sharey=True), (FOUND, FROM_TRUTH), strict=True):
        rows = [row for row in measured.of(TABLE) if row.name == name]
        scenes = [str(row.parameters["scene"]) for row in rows]
        bars(axes, scenes, [row.values["energy_nats"] for row in rows], f"{name}: nats above the truth")


def reading(measured: Measured) -> str:
    """How to read it: where search fails, and where the model does."""
    found, from_truth, truth = (
        [row for row in measured.of(TABLE) if row.name == name] for name in (FOUND, FROM_TRUTH, TRUTH)
    )
    gaps = [
        one.values["energy_nats"].value - other.values["energy_nats"].value
        for one, other in zip(found, from_truth, strict=True)
    ]
    iou = [float(np.mean([row.values["iou"].value for row in rows])) for rows in (found, from_truth, truth)]
    return (
        f"Of {len(gaps)} scenes the search ends within 100 nats of where it ends from the truth in"
        f" {sum(gap <= 100 for gap in gaps)}, and lower in {sum(gap < 0 for gap in gaps)}. The mean IoU is"
        f" {iou[0]:.2f}, from the truth {iou[1]:.2f}; that of the true cells is {iou[2]:.2f}."
    )


STUDY = Study(
    "scene-model", "The model of the scene", SIZES, measure, draw, reading, width_in=9.5, height_in=4.6
)
