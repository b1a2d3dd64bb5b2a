"""Photon counts of two views: time against distance from the true photon distribution.

Thinning draws each photon by light paths of its own; the other way renders all pixels with some samples and
draws Poisson counts from them. Scenes from matt to glass, whose paths differ ever more in what they carry.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.peers.dense_photons import drawn_counts, rendered_mosaic
from benchmarks.results import Measured, Row, Size, Study, Value, mean_of
from benchmarks.scenes import capture_of, film
from benchmarks.timing import median_of, ratio_of, side_by_side
from simgen.photons import Capture, thin_photons
from simgen.spec import load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCENES = {"matt": "paper", "glossy": "glossy", "glass": "glass"}
"""Recipe of each."""
VIEWS = ["grid.rows=1", "grid.cols=2", "products.radiance=none"]
THINNING, DENSE = "thinning", "dense + Poisson"
DISTANCES = "Time of a view, and distance from the true distribution (1 is exact)"
USUAL = 1000.0
"""Photons per view of the published ratios."""
EXCESS = 0.01
"""Dispersion above 1 that is small: `simgen` allows itself no more."""
TILE_PX = 16
GROUPS = 16
"""Number of random groups of pixels; the spread of their figures gives the intervals."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {
        "side_px": 128,
        "samples": (1, 4, 16, 64),
        "budgets": (10.0, USUAL, 1e4, 1e5),
        "repeats": 6,
        "reference": 512,
    },
    "full": {
        "side_px": 256,
        "samples": (1, 4, 16, 64, 256),
        "budgets": (10.0, 100.0, USUAL, 1e4, 1e5, 1e6, 1e7),
        "repeats": 12,
        "reference": 16384,
    },
}


@dataclass(frozen=True)
class Rates:
    """Expected photons (V, H, W) of a budget of one photon per view, and their variance."""

    mean: np.ndarray
    variance: np.ndarray


def measure(
    side_px: int, samples: Sequence[int], budgets: Sequence[float], repeats: int, reference: int
) -> Measured:
    """All ways take turns, scene by scene and budget by budget; rates are those of `reference` samples."""
    rows: list[Row] = []
    ratios: dict[str, Value] = {}
    for scene, name in SCENES.items():
        recipe, _ = load_recipe(name, [*VIEWS, *film(side_px)])
        capture = capture_of(recipe)
        rates = true_rates(capture, reference)
        for budget in budgets:
            photons = recipe.photons.model_copy(update={"budget": budget})
            seconds, counts = compared(replace(capture, photons=photons), (0, *samples), repeats)
            for number, taken in seconds.items():
                where = {"scene": scene, "samples": number, "photons_per_view": budget}
                values = {"time_ms": median_of(taken, 1e3 / capture.grid.view_count)}
                values |= distances(counts[number], rates, budget)
                rows.append(Row(DISTANCES, DENSE if number else THINNING, where, values))
            if budget == USUAL:
                most = max(samples)
                pair = f"{scene}: thinning against dense with {most} samples, {budget:g} photons per view"
                ratios[pair] = ratio_of(seconds[most], seconds[0])
    return Measured(rows, ratios, list(range(1, repeats + 1)))


def compared(
    capture: Capture, ways: Sequence[int], repeats: int
) -> tuple[dict[int, list[float]], dict[int, np.ndarray]]:
    """Seconds and counts (R, V, H, W) of each way, which is its samples per pixel, or 0 for thinning."""
    counts: dict[int, list[np.ndarray]] = {samples: [] for samples in ways}
    works = {
        samples: lambda seed, samples=samples: counts[samples].append(counts_of(capture, samples, seed))
        for samples in ways
    }
    return side_by_side(works, repeats), {samples: np.array(found[1:]) for samples, found in counts.items()}


def counts_of(capture: Capture, samples: int, seed: int) -> np.ndarray:
    """Counts (V, H, W) by dense rendering with `samples` per pixel, or by thinning if that is 0."""
    grid, budget = capture.grid, capture.photons.budget
    if not samples:
        table, _ = thin_photons(replace(capture, seed=seed))
        size = grid.view_count * grid.height * grid.width
        flat = np.bincount(table.flat_pixels(grid), weights=table.n, minlength=size)
        return flat.reshape(grid.view_count, grid.height, grid.width)
    rng = np.random.default_rng([seed, int(budget)])
    seeds = [1 + seed * grid.view_count + view for view in range(grid.view_count)]
    mosaics = [rendered_mosaic(capture, view, samples, view_seed) for view, view_seed in enumerate(seeds)]
    return np.array([drawn_counts(mosaic, capture.cfa, budget, rng) for mosaic in mosaics])


def true_rates(capture: Capture, samples: int) -> Rates:
    """Rates by a long rendering in two halves, whose difference tells the noise that is left."""
    halves = np.empty((2, capture.grid.view_count, capture.grid.height, capture.grid.width))
    for half, view in np.ndindex(*halves.shape[:2]):
        halves[half, view] = rendered_mosaic(capture, view, samples // 2, 10_000 + 100 * half + view)
    light = halves.mean(axis=(0, 2, 3), keepdims=True)
    halves /= light * capture.grid.height * capture.grid.width
    return Rates(halves.mean(axis=0), (halves[0] - halves[1]) ** 2 / 4)


def distances(counts: np.ndarray, rates: Rates, budget: float) -> dict[str, Value]:
    """Distances of counts (R, V, H, W) of at least two repeats from Poisson counts; all are 1 for exact ones.

    The variance of the rates is no fault of the counts, and is taken into account. `dispersion`: variance
    over mean of the repeats, pooled over pixels; noise in the rates makes it larger. `tile_chi_square`: of
    tiles of `TILE_PX`, by degree of freedom, the mean over repeats. `rmse_of_mean`: the root mean square
    error of the mean over repeats, relative to that of exact counts.
    """
    repeats = len(counts)
    expected, variance = budget * rates.mean, budget**2 * rates.variance
    group = np.random.default_rng(0).integers(0, GROUPS, expected.shape).ravel()

    def by_group(values: np.ndarray) -> np.ndarray:
        return np.bincount(group, weights=values.ravel(), minlength=GROUPS)

    light = by_group(counts.mean(axis=0))
    spread = by_group(counts.var(axis=0, ddof=1))
    squares = by_group((counts.mean(axis=0) - expected) ** 2)
    exact = by_group(expected / repeats + variance)
    lit = light > 0
    return {
        "dispersion": mean_of(list(spread[lit] / light[lit])),
        "tile_chi_square": mean_of([_chi_square(one, expected, variance) for one in counts]),
        "rmse_of_mean": mean_of(list(np.sqrt(squares / exact))),
    }


def _chi_square(counts: np.ndarray, expected: np.ndarray, variance: np.ndarray) -> float:
    seen, wanted, doubt = (tile_sums(one.astype(np.float64)) for one in (counts, expected, variance))
    lit = wanted > 0
    return float(((seen - wanted)[lit] ** 2 / (wanted + doubt)[lit]).mean())


def tile_sums(images: np.ndarray) -> np.ndarray:
    """Sums over whole tiles of (V, H, W); what is left over at the ends is not counted."""
    V, H, W = images.shape
    h, w = H // TILE_PX, W // TILE_PX
    whole = images[:, : h * TILE_PX, : w * TILE_PX]
    return whole.reshape(V, h, TILE_PX, w, TILE_PX).sum(axis=(2, 4))


def draw(figure: "Figure", measured: Measured) -> None:
    """Time and dispersion of each scene by photons, a line for each way."""
    scenes = dict.fromkeys(str(row.parameters["scene"]) for row in measured.of(DISTANCES))
    panels = figure.subplots(2, len(scenes), sharex=True, squeeze=False)
    for (times, excesses), scene in zip(panels.T, scenes, strict=True):
        rows = measured.of(DISTANCES, scene=scene)
        ways = dict.fromkeys((row.name, row.parameters["samples"]) for row in rows)
        for number, (name, samples) in enumerate(ways):
            of_way = [row for row in rows if (row.name, row.parameters["samples"]) == (name, samples)]
            label = f"{name}, samples: {samples}" if samples else name
            curve(times, of_way, "photons_per_view", "time_ms", label, number)
            curve(excesses, of_way, "photons_per_view", _excess, "", number)
        excesses.axhline(EXCESS, color="#8a94a6", linewidth=0.8, linestyle=":")
        frame(times, "photons_per_view", "time_ms", scene)
        frame(excesses, "photons_per_view", "dispersion - 1", log="x")
        excesses.set_yscale("symlog", linthresh=EXCESS)


def _excess(row: Row) -> Value:
    """Dispersion above that of exact counts."""
    dispersion = row.values["dispersion"]
    assert dispersion.low is not None
    assert dispersion.high is not None
    return Value(dispersion.value - 1, dispersion.low - 1, dispersion.high - 1)


def reading(measured: Measured) -> str:
    """How to read it, with the figures of most photons of the first and the last scene."""
    rows = measured.of(DISTANCES)
    first, last = (str(row.parameters["scene"]) for row in (rows[0], rows[-1]))
    most = max(float(row.parameters["photons_per_view"]) for row in rows)
    samples = max(int(row.parameters["samples"]) for row in rows)

    def dispersion(way: str, scene: str, samples: int) -> float:
        row = measured.one(DISTANCES, way, scene=scene, photons_per_view=most, samples=samples)
        return row.values["dispersion"].value

    return (
        "Which way of making photon counts is exact, and what does it cost? Counts are exact where the"
        f" dispersion over repeats is 1: with {most:g} photons per view thinning has"
        f" {dispersion(THINNING, first, 0):.3f} in the {first} scene, while in the one of {last} a"
        f" rendering with 1 sample has {dispersion(DENSE, last, 1):.2f} and one with {samples} has"
        f" {dispersion(DENSE, last, samples):.2f}, since noise of the rendering is in its rates (points"
        " above the dotted line have more than the 1 % that is allowed). Thinning takes time with the"
        " photons and rendering with pixels and samples: on this small film thinning is"
        f" {next(iter(measured.ratios.values())).value:.2g} times as fast as {samples} samples at"
        f" {USUAL:g} photons per view in the {first} scene."
    )


STUDY = Study("photons", "Photon images", SIZES, measure, draw, reading, width_in=11.0, height_in=6.5)
