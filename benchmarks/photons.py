"""What photon-limited images cost: thinning against dense rendering with Poisson draws.

The paper's recipe. Dense views are timed on a few views and scaled to all, since each costs the same.
"""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.drawn import KINDS, TUNING, write_recipe
from benchmarks.timing import timed
from pcii.core.photon_limit import photon_rates, scope_energies, sense
from simgen.base import random_streams as seeds
from simgen.dataset.generation import generate
from simgen.dataset.prepared import prepare
from simgen.photons.candidates import Setup
from simgen.photons.thinning import thin_photons
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.sensor.mosaic import draw_counts, sensitivities
from simgen.spec.recipe import Recipe, load_recipe
from simgen.spec.scene import load_scene

DENSE_VIEWS = 4


def setup_of(recipe: Recipe) -> Setup:
    """The recipe's scene and cameras, ready to draw from."""
    scene, folder = load_scene(recipe.scene)
    mi, curves = backend.load(spectral=recipe.is_spectral), sensitivities(recipe.sensor, Path())
    built = build(mi, scene, folder, recipe.render.max_depth, curves)
    return Setup(built, recipe.grid.camera_grid(), recipe.cfa, recipe.render.max_depth)


def thinned(recipe: Recipe) -> tuple[float, dict[str, Any]]:
    """Seconds to draw the photons of all views of a recipe, and the log of the last draw."""
    setup = setup_of(recipe)
    return timed(lambda seed: thin_photons(setup, recipe.photons, seed=seed)[1])


def dense(recipe: Recipe, samples_per_pixel: int) -> tuple[float, float]:
    """Seconds to render all views and draw their Poisson counts, and of these the draws alone."""
    setup = setup_of(recipe)
    drawing = 0.0

    def work(seed: int) -> None:
        nonlocal drawing
        drawing = 0.0
        for view in range(DENSE_VIEWS):
            image = render_view(
                setup.render_scene, setup.grid, 4, view, samples_per_pixel=samples_per_pixel, seed=seed
            )
            start = time.perf_counter()
            raw = sense(image, recipe.cfa)
            energies = scope_energies(raw, recipe.cfa, "view")
            rates = photon_rates(raw, recipe.cfa, recipe.photons.budget, "view", energies)
            draw_counts(rates, recipe.cfa, seeds.generator(seed, view=view, stage="photons"), None)
            drawing += time.perf_counter() - start

    seconds, _ = timed(work)
    scale = setup.grid.view_count / DENSE_VIEWS
    return seconds * scale, drawing * scale


def table() -> Iterator[str]:
    """The tables, line by line as they are measured."""
    recipe, _ = load_recipe("paper")
    yield f"photons of the paper's recipe, {backend.choose().line()}"
    yield ""
    yield "| what | seconds | against thinning | kept | overshoot |"
    yield "|---|---|---|---|---|"
    base, log = thinned(recipe)
    yield _row("thinning, 1000 photons per view", base, base, log)
    costs = {}
    for samples in (1, 16):
        seconds, costs[0] = dense(recipe, samples)
        costs[samples] = seconds
        yield f"| dense, {samples} samples + Poisson | {seconds:.2f} | {seconds / base:.1f} x | | |"
    larger, _ = load_recipe("paper", ["grid.height=4096", "grid.width=4096", "grid.pixel_mm=0.0088"])
    seconds, log = thinned(larger)
    yield _row("thinning, 4096 x 4096 pixels", seconds, base, log)
    brighter, _ = load_recipe("paper", ["photons.budget=10000"])
    seconds, log = thinned(brighter)
    yield _row("thinning, 10 000 photons per view", seconds, base, log)
    yield ""
    yield from _costs(recipe, (seconds - base) / 900_000, costs)
    yield ""
    yield from _growth()
    yield ""
    yield from _drawn(base)


def _costs(recipe: Recipe, per_photon: float, dense_s: dict[int, float]) -> Iterator[str]:
    """What `simgen.photons.counting_plan` chooses by."""
    grid = recipe.grid.camera_grid()
    pixels = grid.view_count * grid.height * grid.width
    yield "| cost | microseconds |"
    yield "|---|---|"
    yield f"| a photon more, by thinning | {1e6 * per_photon:.2f} |"
    yield f"| a sample of a dense view | {1e6 * (dense_s[16] - dense_s[1]) / (15 * pixels):.3f} |"
    yield f"| a pixel of a dense view, its counts drawn | {1e6 * dense_s[0] / pixels:.3f} |"


def _growth() -> Iterator[str]:
    """Time against photons, up to ten million of them in one view."""
    yield "| photons per view, 2 x 2 views | seconds | microseconds each |"
    yield "|---|---|---|"
    for budget in np.geomspace(1e4, 1e7, 4):
        recipe, _ = load_recipe("paper", ["grid.rows=2", "grid.cols=2", f"photons.budget={budget:g}"])
        setup = setup_of(recipe)
        start = time.perf_counter()
        drawn, _ = thin_photons(setup, recipe.photons, seed=1)
        seconds = time.perf_counter() - start
        yield f"| {budget:.0e} | {seconds:.2f} | {1e6 * seconds / drawn.k.size:.2f} |"


def _drawn(base_s: float) -> Iterator[str]:
    """Scenes drawn at random, four of each kind, against the paper's scene; and each as a new dataset."""
    yield "| drawn scenes 100 to 103 | against the paper's | kept | draws | above the rule | dataset, fresh |"
    yield "|---|---|---|---|---|---|"
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            shares, kept, draws, above, fresh = [], [], [], 0, []
            for number in range(TUNING, TUNING + 4):
                recipe, near = load_recipe(str(write_recipe(Path(folder), kind, number)))
                start = time.perf_counter()
                generate(recipe, near, Path(folder) / f"{kind}_{number}_data")
                fresh.append(time.perf_counter() - start)
                prepared = prepare(recipe, near)
                grid, depth = recipe.grid.camera_grid(), recipe.render.max_depth
                setup = Setup(prepared.render_scene(), grid, recipe.cfa, depth)
                seconds, log = timed(
                    lambda seed, setup=setup, photons=recipe.photons: thin_photons(setup, photons, seed=seed)[
                        1
                    ]
                )
                shares.append(seconds / base_s)
                kept.append(log["kept_share"])
                draws.append(log["attempts"])
                above += log["clump_pairs"] > log["clump_pairs_allowed"]
            yield (
                f"| {kind} | {np.mean(shares):.2f} x ({min(shares):.2f} to {max(shares):.2f}) "
                f"| {np.mean(kept):.0%} | {np.mean(draws):.1f} | {above} of 4 "
                f"| {np.mean(fresh):.1f} s ({max(fresh):.1f}) |"
            )


def _row(name: str, seconds: float, base: float, log: dict[str, Any]) -> str:
    over = log["overshoot_photons"] / max(log["kept"], 1)
    share = f"{log['kept_share']:.1%}"
    return f"| {name} | {seconds:.2f} | {seconds / base:.2f} x | {share} | {over:.1e} |"
