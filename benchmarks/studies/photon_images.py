"""Photon counts of two views: time against distance from the true photon distribution.

Thinning draws each photon by light paths of its own; the other way renders all pixels with some samples and
draws Poisson counts from them. Scenes from matt to glass, whose paths differ ever more in what they carry.
"""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.peers.dense_photons import drawn_counts, rendered_mosaic
from benchmarks.photon_distance import Rates, distances
from benchmarks.results import Measured, Ratio, Row, Size, Study, Value
from benchmarks.scenes import capture_of, film
from benchmarks.timing import median_of, ratio_of, side_by_side
from simgen.photons.capture import Capture
from simgen.photons.thinning import thin_photons
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import Photons, load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCENES = {"matt": "paper", "glossy": "glossy", "glass": "glass"}
"""Recipe of each."""
VIEWS = ["grid.rows=1", "grid.cols=2", "products.radiance=none"]
THINNING, DENSE = "thinning", "dense + Poisson"
DISTANCES = "Time of a view, and distance from the true distribution (1 is exact)"
CROSSOVERS = "Photons per view up to which thinning takes less time than so many samples"
USUAL = 1000.0
"""Photons per view that ratios are told of."""
EXCESS = 0.01
"""Dispersion above 1 that is small: `simgen` allows itself no more."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {
        "side_px": 128,
        "samples": (1, 4, 16, 64),
        "budgets": (10.0, 1e3, 1e4, 1e5),
        "repeats": 6,
        "reference": 512,
    },
    "full": {
        "side_px": 256,
        "samples": (1, 4, 16, 64, 256),
        "budgets": (10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7),
        "repeats": 12,
        "reference": 16384,
    },
}


def measure(
    side_px: int,
    samples: Sequence[int],
    budgets: Sequence[float],
    repeats: int,
    reference: int,
    scenes: Mapping[str, str] = SCENES,
) -> Measured:
    """Both ways, scene by scene and budget by budget; rates are those of `reference` samples."""
    rows: list[Row] = []
    ratios: list[Ratio] = []
    usual = min(budgets, key=lambda budget: abs(budget - USUAL))
    for scene, name in scenes.items():
        recipe, _ = load_recipe(name, [*VIEWS, *film(side_px)])
        capture = capture_of(recipe)
        rates = true_rates(capture, reference)
        seconds: dict[tuple[str, float], list[float]] = {}
        for budget in budgets:
            photons = recipe.photons.model_copy(update={"budget": budget})
            times, counts = _thinned(capture, photons, repeats)
            seconds[THINNING, budget] = times
            rows.append(_row(scene, THINNING, 0, budget, times, counts, rates))
        for number in samples:
            for budget, (times, counts) in _dense(capture, budgets, number, repeats).items():
                seconds[dense_name(number), budget] = times
                rows.append(_row(scene, DENSE, number, budget, times, counts, rates))
        ratios.append(
            _ratio(
                f"{scene}: thinning against dense with {max(samples)} samples, {usual:g} photons per view",
                capture,
                recipe.photons.model_copy(update={"budget": usual}),
                max(samples),
                repeats,
            )
        )
        rows += _crossovers(scene, samples, seconds)
    return Measured(rows, ratios, list(range(1, repeats + 1)))


def _ratio(name: str, capture: Capture, photons: Photons, samples: int, repeats: int) -> Ratio:
    """Both ways in turns."""

    def dense(number: int) -> None:
        for view in range(capture.grid.view_count):
            mosaic, rng = rendered_mosaic(capture, view, samples, number), np.random.default_rng(number)
            drawn_counts(mosaic, capture.cfa, photons.budget, rng)

    works = {THINNING: lambda n: thin_photons(replace(capture, photons=photons, seed=n)), DENSE: dense}
    seconds = side_by_side(works, repeats)
    return ratio_of(name, seconds[DENSE], seconds[THINNING])


def dense_name(samples: int) -> str:
    """Key of dense rendering with so many samples per pixel."""
    return f"{DENSE}, {samples}"


def true_rates(capture: Capture, samples: int) -> Rates:
    """Rates by a long rendering in two halves, whose difference tells the noise that is left."""
    halves = np.empty((2, capture.grid.view_count, capture.grid.height, capture.grid.width))
    for half, view in np.ndindex(*halves.shape[:2]):
        halves[half, view] = rendered_mosaic(capture, view, samples // 2, 10_000 + 100 * half + view)
    light = halves.mean(axis=(0, 2, 3), keepdims=True)
    halves /= light * capture.grid.height * capture.grid.width
    return Rates(halves.mean(axis=0), (halves[0] - halves[1]) ** 2 / 4)


def _thinned(capture: Capture, photons: Photons, repeats: int) -> tuple[list[float], np.ndarray]:
    """Seconds of each repeat, and counts (R, V, H, W)."""
    seconds, counts = [], []
    capture = replace(capture, photons=photons)
    thin_photons(capture)
    for seed in range(1, repeats + 1):
        start = time.perf_counter()
        drawn, _ = thin_photons(replace(capture, seed=seed))
        seconds.append(time.perf_counter() - start)
        counts.append(as_images(drawn, capture))
    return seconds, np.array(counts)


def as_images(drawn: PhotonTable, capture: Capture) -> np.ndarray:
    """Counts (V, H, W) of photons in a table."""
    grid = capture.grid
    size = grid.view_count * grid.height * grid.width
    flat = np.bincount(drawn.flat_pixels(grid), weights=drawn.n, minlength=size)
    return flat.reshape(grid.view_count, grid.height, grid.width)


def _dense(
    capture: Capture, budgets: Sequence[float], samples: int, repeats: int
) -> dict[float, tuple[list[float], np.ndarray]]:
    """Of each budget seconds of each repeat, and counts; a rendering serves all budgets."""
    grid, views = capture.grid, range(capture.grid.view_count)
    seconds: dict[float, list[float]] = {budget: [] for budget in budgets}
    counts = {budget: np.zeros((repeats, len(views), grid.height, grid.width)) for budget in budgets}
    rendered_mosaic(capture, 0, samples, 0)
    for repeat in range(repeats):
        start = time.perf_counter()
        mosaics = [rendered_mosaic(capture, view, samples, 1 + repeat * len(views) + view) for view in views]
        rendering = time.perf_counter() - start
        for budget in budgets:
            rng = np.random.default_rng([repeat, int(budget)])
            start = time.perf_counter()
            for view in views:
                counts[budget][repeat, view] = drawn_counts(mosaics[view], capture.cfa, budget, rng)
            seconds[budget].append(rendering + time.perf_counter() - start)
    return {budget: (seconds[budget], counts[budget]) for budget in budgets}


def _row(
    scene: str, way: str, samples: int, budget: float, seconds: list[float], counts: np.ndarray, rates: Rates
) -> Row:
    parameters = {"scene": scene, "samples": samples, "photons_per_view": budget}
    values = {"time_ms": median_of(seconds, 1e3 / counts.shape[1])} | distances(counts, rates, budget)
    return Row(DISTANCES, way, parameters, values)


def _crossovers(
    scene: str, samples: Sequence[int], seconds: Mapping[tuple[str, float], list[float]]
) -> list[Row]:
    """At how many photons thinning takes as long as so many samples, between the budgets that were tried."""
    budgets = sorted({budget for _, budget in seconds})
    found: list[Row] = []
    for number in samples:
        gap = [
            math.log(median(seconds[THINNING, budget]) / median(seconds[dense_name(number), budget]))
            for budget in budgets
        ]
        crossing = budgets[0] if gap[0] > 0 else budgets[-1]
        for (low, high), (before, after) in zip(pairwise(budgets), pairwise(gap), strict=True):
            if before <= 0 < after:
                crossing = low * (high / low) ** (before / (before - after))
        side = "above" if gap[-1] <= 0 else "below" if gap[0] > 0 else "at"
        parameters = {"scene": scene, "samples": number, "where": side}
        found.append(Row(CROSSOVERS, THINNING, parameters, {"photons_per_view": Value(crossing)}))
    return found


def draw(figure: "Figure", measured: Measured) -> None:
    """Time and dispersion of each scene by photons, a line for each way."""
    scenes = dict.fromkeys(str(row.parameters["scene"]) for row in measured.of(DISTANCES))
    panels = figure.subplots(2, len(scenes), sharex=True, squeeze=False)
    for (times, excesses), scene in zip(panels.T, scenes, strict=True):
        rows = measured.of(DISTANCES, scene=scene)
        ways = dict.fromkeys((row.name, row.parameters["samples"]) for row in rows)
        for number, (name, samples) in enumerate(ways):
            own = [row for row in rows if (row.name, row.parameters["samples"]) == (name, samples)]
            told = f"{name}, samples: {samples}" if samples else name
            curve(times, own, "photons_per_view", "time_ms", told, number)
            curve(excesses, own, "photons_per_view", _excess, "", number)
        excesses.axhline(EXCESS, color="#8a94a6", linewidth=0.8, linestyle=":")
        frame(times, "photons_per_view", "time_ms", scene)
        frame(excesses, "photons_per_view", "dispersion - 1", log="x")
        excesses.set_yscale("symlog", linthresh=EXCESS)


def _excess(row: Row) -> Value:
    """Dispersion above that of exact counts."""
    found = row.values["dispersion"]
    assert found.low is not None
    assert found.high is not None
    return Value(found.value - 1, found.low - 1, found.high - 1)


def reading(measured: Measured) -> str:
    """How to read it, with the figures of most photons of the first and the last scene."""
    rows = measured.of(DISTANCES)
    first, last = (str(row.parameters["scene"]) for row in (rows[0], rows[-1]))
    most = max(float(row.parameters["photons_per_view"]) for row in rows)
    samples = max(int(row.parameters["samples"]) for row in rows)

    def dispersion(way: str, scene: str, samples: int) -> float:
        found = measured.one(DISTANCES, way, scene=scene, photons_per_view=most, samples=samples)
        return found.values["dispersion"].value

    return (
        "Which way of making photon counts is exact, and what does it cost? Counts are exact where the"
        f" dispersion over repeats is 1: with {most:g} photons per view thinning has"
        f" {dispersion(THINNING, first, 0):.3f} in the {first} scene, while in the one of {last} a"
        f" rendering with 1 sample has {dispersion(DENSE, last, 1):.2f} and one with {samples} has"
        f" {dispersion(DENSE, last, samples):.2f}, since noise of the rendering is in its rates (points"
        " above the dotted line have more than the 1 % that is allowed). Thinning takes time with the"
        " photons and rendering with pixels and samples: on this small film thinning is"
        f" {measured.ratios[0].ratio.value:.2g} times as fast as {samples} samples, and the table of"
        " crossovers tells where it loses."
    )


STUDY = Study("photons", "Photon images", SIZES, measure, draw, reading, width_in=11.0, height_in=6.5)
