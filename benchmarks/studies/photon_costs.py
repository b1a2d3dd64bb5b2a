"""What a photon costs at the paper's size: thinning against dense rendering, and growth.

Dense views are timed on a few views and scaled to all, since each costs the same.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import bars, curve, frame
from benchmarks.peers.dense_photons import drawn_counts, rendered_mosaic
from benchmarks.results import Measured, Row, Size, Study, Value
from benchmarks.scenes import capture_of, film
from benchmarks.timing import median_of, ratio_of, side_by_side
from pcii.types import CameraGrid
from simgen.photons import thin_photons
from simgen.spec import load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = "Photon counts of the paper's recipe"
COSTS = "Cost of each, which the choice between both ways goes by"
GROWTH = "Thinning of two views, by photons"
DENSE = "dense + Poisson"
BASE = "thinning, 1000 photons per view"
AGAINST_16 = "thinning against dense with 16 samples, the paper's recipe"
FINER = "thinning, 16 times as many pixels"
BRIGHTER = "thinning, 10 000 photons per view"

SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 1024, "repeats": 6, "dense_views": 1, "most_photons": 5},
    "full": {"side_px": 1024, "repeats": 12, "dense_views": 4, "most_photons": 7},
}


def measure(side_px: int, repeats: int, dense_views: int, most_photons: int) -> Measured:
    """The paper's recipe, and growth up to ten to the power `most_photons`."""
    rows, ratios = _paper(side_px, repeats, dense_views)
    return Measured(rows + _growth(side_px, repeats, most_photons), ratios, [1])


def _paper(side_px: int, repeats: int, dense_views: int) -> tuple[list[Row], dict[str, Value]]:
    recipes = {
        BASE: load_recipe("paper", film(side_px))[0],
        FINER: load_recipe("paper", film(4 * side_px))[0],
        BRIGHTER: load_recipe("paper", [*film(side_px), "photons.budget=10000"])[0],
    }
    captures = {name: capture_of(recipe) for name, recipe in recipes.items()}
    capture, logs = captures[BASE], dict[str, dict[str, Any]]()

    def thin(name: str, seed: int) -> None:
        logs[name] = thin_photons(replace(captures[name], seed=seed))[1]

    def render(samples: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        for view in range(dense_views):
            mosaic = rendered_mosaic(capture, view, samples, seed)
            drawn_counts(mosaic, capture.cfa, capture.photons.budget, rng)

    works = {name: partial(thin, name) for name in recipes}
    works |= {dense_name(samples): partial(render, samples) for samples in (1, 16)}
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
    ratios = {
        f"thinning against dense with {samples} samples, the paper's recipe": ratio_of(
            seconds[dense_name(samples)], seconds[BASE], scale
        )
        for samples in (1, 16)
    }
    return [*rows, *_costs(seconds, scale, capture.grid)], ratios


def dense_name(samples: int) -> str:
    """Name of dense rendering with this number of samples per pixel."""
    return f"{DENSE}, samples: {samples}"


def _costs(seconds: dict[str, list[float]], scale: float, grid: CameraGrid) -> list[Row]:
    """What `simgen.photons.counting_plan` chooses by."""
    pixels = grid.view_count * grid.height * grid.width
    base, more = (np.array(seconds[name]) for name in (BASE, BRIGHTER))
    one, sixteen = (scale * np.array(seconds[dense_name(samples)]) for samples in (1, 16))
    sample = (sixteen - one) / (15 * pixels)
    costs = {
        "a photon more, by thinning": (more - base) / (9000 * grid.view_count),
        "a sample of a dense pixel": sample,
        "a dense pixel, without its samples": one / pixels - sample,
    }
    return [Row(COSTS, name, {}, {"cost_us": median_of(list(each), 1e6)}) for name, each in costs.items()]


def _growth(side_px: int, repeats: int, most: int) -> list[Row]:
    """Time against photons, from ten to ten to this power in a view."""
    small = ["grid.rows=1", "grid.cols=2", *film(side_px)]
    recipes = {
        10**n: load_recipe("paper", [*small, f"photons.budget={10**n}"])[0] for n in range(1, most + 1)
    }
    capture = capture_of(recipes[10])
    works = {
        n: lambda seed, recipe=recipe: thin_photons(replace(capture, photons=recipe.photons, seed=seed))
        for n, recipe in recipes.items()
    }
    return [
        Row(
            GROWTH,
            "thinning",
            {"photons_per_view": float(photons)},
            {"time_ms": median_of(taken, 1e3), "each_us": median_of(taken, 1e6 / (2 * photons))},
        )
        for photons, taken in side_by_side(works, repeats).items()
    ]


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
    ratio = measured.ratios[AGAINST_16].value
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
