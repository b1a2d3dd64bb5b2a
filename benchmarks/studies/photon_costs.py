"""What a photon costs at the paper's size: thinning against dense rendering, growth, and drawn scenes.

Dense views are timed on a few views and scaled to all, since each costs the same.
"""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import bars, curve, frame
from benchmarks.peers.dense_photons import drawn_counts, rendered_mosaic
from benchmarks.results import Measured, Ratio, Row, Size, Study, Value, mean_of
from benchmarks.scenes import FIRST_NUMBER, KINDS, capture_of, film
from benchmarks.timing import median_of, ratio_of, side_by_side, timed
from pcii.types.camera_grid import CameraGrid
from simgen.dataset.generation import generate
from simgen.dataset.prepared import prepare
from simgen.photons.capture import Capture
from simgen.photons.thinning import thin_photons
from simgen.spec.recipe import Recipe, load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, COSTS, GROWTH, DRAWN = (
    "Photon counts of the paper's recipe",
    "Cost of each, which the choice between both ways goes by",
    "Thinning of two views, by photons",
    "Drawn scenes, thinned",
)
DENSE = "dense + Poisson"
BASE = "thinning, 1000 photons per view"
OTHERS = {
    "thinning, 16 times as many pixels": (4, []),
    "thinning, 10 000 photons per view": (1, ["photons.budget=10000"]),
}

SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 1024, "repeats": 6, "dense_views": 1, "most_photons": 5, "drawn": 0},
    "full": {"side_px": 1024, "repeats": 12, "dense_views": 4, "most_photons": 7, "drawn": 4},
}


def measure(side_px: int, repeats: int, dense_views: int, most_photons: int, drawn: int) -> Measured:
    """The paper's recipe, growth up to ten to the power `most_photons`, and so many scenes of each kind."""
    rows, ratios = _paper(side_px, repeats, dense_views)
    rows += _growth(side_px, repeats, most_photons)
    if drawn:
        rows += _drawn(drawn, rows[0].values["time_ms"].value)
    return Measured(rows, ratios, [1])


def _paper(side_px: int, repeats: int, dense_views: int) -> tuple[list[Row], list[Ratio]]:
    recipe, _ = load_recipe("paper", film(side_px))
    capture, logs = capture_of(recipe), dict[str, dict[str, Any]]()

    def thinning(name: str, own_capture: Capture, seed: int) -> None:
        logs[name] = thin_photons(replace(own_capture, seed=seed))[1]

    def dense(samples: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        for view in range(dense_views):
            drawn_counts(
                rendered_mosaic(capture, view, samples, seed), capture.cfa, recipe.photons.budget, rng
            )

    works: dict[str, Any] = {BASE: lambda n: thinning(BASE, capture, n)}
    for name, (finer, settings) in OTHERS.items():
        own_capture = capture_of(load_recipe("paper", [*film(finer * side_px), *settings])[0])
        works[name] = lambda n, name=name, own=own_capture: thinning(name, own, n)
    for samples in (1, 16):
        works[f"{DENSE}, samples: {samples}"] = lambda n, samples=samples: dense(samples, n)
    seconds = side_by_side(works, repeats)
    scale = capture.grid.view_count / dense_views
    rows: list[Row] = []
    for name, taken in seconds.items():
        values = {"time_ms": median_of(taken, 1e3 * (scale if name.startswith(DENSE) else 1))}
        if name in logs:
            kept = logs[name]["kept"]
            values["kept_percent"] = Value(100 * logs[name]["kept_share"])
            values["above_bound_percent"] = Value(100 * logs[name]["paths_above_bound"] / max(kept, 1))
        rows.append(Row(PAPER, name, {}, values))
    ratios = [
        ratio_of(
            f"thinning against dense with {samples} samples, the paper's recipe",
            seconds[f"{DENSE}, samples: {samples}"],
            seconds[BASE],
            scale=scale,
        )
        for samples in (1, 16)
    ]
    return [*rows, *_costs(seconds, scale, capture.grid)], ratios


def _costs(seconds: dict[str, list[float]], scale: float, grid: CameraGrid) -> list[Row]:
    """What `simgen.photons.counting_plan` chooses by."""
    pixels = grid.view_count * grid.height * grid.width
    base, more = (np.array(seconds[name]) for name in (BASE, "thinning, 10 000 photons per view"))
    one, sixteen = (scale * np.array(seconds[f"{DENSE}, samples: {samples}"]) for samples in (1, 16))
    sample = (sixteen - one) / (15 * pixels)
    found = {
        "a photon more, by thinning": (more - base) / (9000 * grid.view_count),
        "a sample of a dense pixel": sample,
        "a dense pixel, without its samples": one / pixels - sample,
    }
    return [Row(COSTS, name, {}, {"cost_us": median_of(list(each), 1e6)}) for name, each in found.items()]


def _growth(side_px: int, repeats: int, most: int) -> list[Row]:
    """Time against photons, from ten to ten to this power in a view."""
    rows: list[Row] = []
    for power in range(1, most + 1):
        recipe, _ = load_recipe(
            "paper", ["grid.rows=1", "grid.cols=2", *film(side_px), f"photons.budget={10**power}"]
        )
        capture = capture_of(recipe)
        taken, _ = timed(lambda n, own=capture: thin_photons(replace(own, seed=n)), repeats)
        values = {
            "time_ms": median_of(taken, 1e3),
            "each_us": median_of(taken, 1e6 / (2 * 10**power)),
        }
        rows.append(Row(GROWTH, "thinning", {"photons_per_view": 10.0**power}, values))
    return rows


def _drawn(each: int, base_ms: float) -> list[Row]:
    """Scenes drawn at random, so many of each kind, against the paper's scene; and each as a new dataset."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            relative, kept, raised, fresh = [], [], [], []
            for number in range(FIRST_NUMBER, FIRST_NUMBER + each):
                recipe = Recipe(scene=f"drawn_{kind}", scene_number=number, seed=number)
                start = time.perf_counter()
                generate(recipe, Path(), Path(folder) / f"{kind}_{number}")
                fresh.append(time.perf_counter() - start)
                built, grid = prepare(recipe, Path()).render_scene(), recipe.grid.camera_grid()
                capture = Capture(built, grid, recipe.cfa, recipe.photons)
                logs: list[dict[str, Any]] = []
                works = {
                    kind: lambda n, own=capture, logs=logs: logs.append(thin_photons(replace(own, seed=n))[1])
                }
                relative.append(1e3 * median(side_by_side(works)[kind]) / base_ms)
                kept.append(100 * logs[-1]["kept_share"])
                raised.append(float(logs[-1]["bound_raised"]))
            values = {
                "times_the_papers": relative,
                "kept_percent": kept,
                "raised": raised,
                "new_dataset_s": fresh,
            }
            rows.append(Row(DRAWN, kind, {}, {name: mean_of(found) for name, found in values.items()}))
    return rows


def draw(figure: "Figure", measured: Measured) -> None:
    """Time of the paper's counts, and growth with the photons."""
    left, right = figure.subplots(1, 2)
    rows = measured.of(PAPER)
    times = [row.values["time_ms"] for row in rows]
    bars(left, [row.name for row in rows], times, "time of 100 views, ms", log=True)
    left.set_title("the paper's recipe", fontsize=10)
    curve(right, measured.of(GROWTH), "photons_per_view", "time_ms", "thinning, two views", 0)
    frame(right, "photons_per_view", "time_ms", "growth with the photons")


def reading(measured: Measured) -> str:
    """How to read it: the ratio to dense rendering, and what a photon costs."""
    ratio = measured.ratios[1].ratio.value
    rows = measured.of(GROWTH)
    few, many = (row.values["time_ms"].value for row in (rows[0], rows[-1]))
    cost = measured.one(COSTS, "a photon more, by thinning").values["cost_us"].value
    sample = measured.one(COSTS, "a sample of a dense pixel").values["cost_us"].value
    return (
        "What does a photon-limited dataset of the paper's size cost? Photons drawn one by one take 1 in"
        f" {ratio:.0f} of the time of rendering every pixel with 16 samples and drawing from that. A photon"
        f" more costs {cost:.1f} µs and a sample of a pixel {sample:.3f} µs, so that rendering wins where"
        f" there are more photons than {sample / cost:.2f} in a pixel and sample; up to some thousand"
        f" photons the pilot costs most ({few:.0f} ms for the fewest, {many:.0f} ms for the most photons"
        " tried)."
    )


STUDY = Study("photon-costs", "Photons: cost", SIZES, measure, draw, reading, width_in=10.0, height_in=3.6)
