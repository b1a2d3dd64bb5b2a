"""What photon-limited images cost: thinning against dense rendering with Poisson draws.

The paper's recipe. Dense views are timed on a few views and scaled to all, since each costs the same.
"""

import time
from collections.abc import Callable, Iterator
from statistics import median

from simgen import backend, seeds
from simgen.build import build
from simgen.candidates import Setup
from simgen.photons import PhotonList, draw_photons
from simgen.recipe import Recipe, load_recipe
from simgen.render import render_view
from simgen.scene import load_scene
from simgen.sensor import draw_counts, photon_rates, scope_energies, sense

REPEATS = 5
DENSE_VIEWS = 4


def timed(work: Callable[[int], object]) -> tuple[float, object]:
    """Median seconds of `REPEATS` runs after one that warms up, and the last result."""
    result, seconds = work(0), []
    for repeat in range(1, REPEATS + 1):
        start = time.perf_counter()
        result = work(repeat)
        seconds.append(time.perf_counter() - start)
    return median(seconds), result


def thinned(recipe: Recipe) -> tuple[float, PhotonList]:
    """Seconds to draw the photons of all views of a recipe, and the last draw."""
    scene, folder = load_scene(recipe.scene)
    built = build(backend.load(), scene, folder, recipe.render.max_depth)
    setup = Setup(built, recipe.grid.camera_grid(), recipe.cfa, recipe.render.max_depth)

    def work(seed: int) -> PhotonList:
        return draw_photons(setup, recipe.photons, seed=seed)

    seconds, drawn = timed(work)
    assert isinstance(drawn, PhotonList)
    return seconds, drawn


def dense(recipe: Recipe, samples_per_pixel: int) -> float:
    """Seconds to render all views and draw their Poisson counts."""
    scene, folder = load_scene(recipe.scene)
    built = build(backend.load(), scene, folder, recipe.render.max_depth)
    grid = recipe.grid.camera_grid()

    def work(seed: int) -> None:
        for view in range(DENSE_VIEWS):
            image = render_view(built, grid, 4, view, samples_per_pixel=samples_per_pixel, seed=seed)
            raw = sense(image, recipe.cfa)
            energies = scope_energies(raw, recipe.cfa, "view")
            rates = photon_rates(raw, recipe.cfa, recipe.photons, energies)
            draw_counts(rates, recipe.cfa, seeds.generator(seed, view=view, stage="photons"), None)

    seconds, _ = timed(work)
    return seconds * grid.view_count / DENSE_VIEWS


def table() -> Iterator[str]:
    """The table, line by line as it is measured."""
    recipe, _ = load_recipe("paper")
    yield f"photons of the paper's recipe, {backend.choose().line()}"
    yield ""
    yield "| what | seconds | against thinning | kept | overshoot |"
    yield "|---|---|---|---|---|"
    base, drawn = thinned(recipe)
    yield _row("thinning, 1000 photons per view", base, base, drawn)
    for samples in (1, 16):
        seconds = dense(recipe, samples)
        yield f"| dense, {samples} samples + Poisson | {seconds:.2f} | {seconds / base:.1f} x | | |"
    larger, _ = load_recipe("paper", ["grid.height=4096", "grid.width=4096", "grid.pixel_mm=0.0088"])
    yield _row("thinning, 4096 x 4096 pixels", *thinned_against(larger, base))
    brighter, _ = load_recipe("paper", ["photons.budget=10000"])
    yield _row("thinning, 10 000 photons per view", *thinned_against(brighter, base))


def thinned_against(recipe: Recipe, base: float) -> tuple[float, float, PhotonList]:
    """Seconds, seconds to compare with, and the draw of another recipe."""
    seconds, drawn = thinned(recipe)
    return seconds, base, drawn


def _row(name: str, seconds: float, base: float, drawn: PhotonList) -> str:
    log = drawn.log
    over = log["overshoot_photons"] / max(log["kept"], 1)
    share = f"{log['kept_share']:.1%}"
    return f"| {name} | {seconds:.2f} | {seconds / base:.2f} x | {share} | {over:.1e} |"
