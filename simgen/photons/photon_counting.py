"""The photon counts of a dataset: which way they are made, what the sensor does to them, where they go."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.core.bayer import channel_count
from pcii.core.console import Report, silent
from pcii.core.errors import InputError
from pcii.core.photon_counts import PhotonCounts
from pcii.io.dataset_layout import COUNTS, COUNTS_LABELS, PHOTON_TRUTH, PHOTON_TRUTH_LABELS, nested_name
from pcii.io.zarr_groups import write_arrays_safely
from simgen.base import random_streams as seeds
from simgen.cameras.rig import rig_of
from simgen.photons.candidates import Setup
from simgen.photons.rendering_noise import NOISE_SHARE, Probe, depths_seen, probe
from simgen.photons.thinning import places, thin_photons
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.sensor.detector import detect, nested_subset, saturate
from simgen.sensor.exposure import photons_per_radiance
from simgen.sensor.mosaic import draw_counts, fixed_totals, photon_rates, scope_energies
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import MOST_PATHS, MOST_PHOTONS, Recipe

PHOTON_COST, SAMPLE_COST, PIXEL_COST = 1.5, 0.065, 0.015
"""Microseconds for a photon drawn by thinning, and for a sample and a pixel of a dense view, as measured by
`make bench` on two cores; only their ratios matter."""
SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST = 77.0, 0.3
"""The same without a compiled backend."""
PROBE_SEED = 0
"""The probe measures the scene, and its paths enter no data. With one seed for all, recipes that differ in
nothing else are made alike: all with the origins of photons or all without."""
MOST_SINGLE_PHOTONS = 1 << 25
"""So many photons are kept one by one at most; each takes some 200 bytes."""


@dataclass(frozen=True)
class Plan:
    """How the counts will be made, and what led to it."""

    thins: bool
    samples: int
    """Samples per pixel of the dense views, if the counts are drawn from such."""
    photons_per_view: float
    noise: float
    """Variance that rendering adds to dense counts, as a share of their Poisson variance."""
    normaliser_error: float
    """Standard error of the light that a dense view's budget is divided by, as a share of it."""
    depths_mm: tuple[float, ...] = ()
    """Some of the depths that the corner cameras see, if photons are thinned."""


def plan(recipe: Recipe, render_scene: RenderScene, kind: str) -> Plan:
    """Thin, or render densely, whichever takes less time for counts without rendering noise.

    Thinning takes time with the photons. Dense rendering takes it with the pixels and with the samples that
    each needs, which are more the more light there is. Where it cannot take enough, photons are thinned
    as long as there is memory for them. The recipe's seed has no part in it (see `PROBE_SEED`).
    """
    grid = recipe.grid.camera_grid()
    pixels = grid.height * grid.width
    seen = probe(render_scene, grid, recipe.cfa, PROBE_SEED)
    per_view, gain = _photons(recipe, seen)
    scope_pixels = _scope_pixels(recipe)
    samples = seen.samples_for(gain, scope_pixels)
    if recipe.products.radiance != "none":
        samples = max(samples, recipe.render.samples_per_pixel)
    samples = min(samples, (MOST_PATHS - 1) // pixels)
    photon_cost, sample_cost = PHOTON_COST, SAMPLE_COST
    if kind == "scalar":
        photon_cost, sample_cost = SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST
    noise = seen.photon_noise(gain, samples)
    cheaper = photon_cost * per_view <= (sample_cost * samples + PIXEL_COST) * pixels
    few = per_view * grid.view_count <= MOST_SINGLE_PHOTONS
    if recipe.photons.nested and not few:
        raise InputError(
            f"photons.nested: {per_view * grid.view_count:.3g} photons are too many to be told apart; "
            f"at most {MOST_SINGLE_PHOTONS} can be"
        )
    # What the virtual centre sees no light of may be dark altogether, which dense views tell at once.
    thins = few and seen.mean > 0 and (cheaper or noise > NOISE_SHARE)
    return Plan(
        thins=thins,
        samples=samples,
        photons_per_view=per_view,
        noise=noise,
        normaliser_error=0.0 if scope_pixels is None else seen.light_error(samples * scope_pixels),
        depths_mm=depths_seen(render_scene, grid) if thins else (),
    )


def thin(
    recipe: Recipe, render_scene: RenderScene, made: Plan, report: Report = silent
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons of all views drawn one by one, and what the manifest says of them."""
    grid = recipe.grid.camera_grid()
    setup = Setup(render_scene, rig_of(recipe), recipe.cfa, recipe.render.max_depth)
    gain = absolute_gain(recipe)
    photons, log = thin_photons(
        setup, recipe.photons, seed=recipe.seed, photons_per_radiance=gain, report=report
    )
    return photons, log | {
        "dense_paths_instead": made.samples * grid.view_count * grid.height * grid.width,
        "normaliser_standard_error": 0.0,
    }


def draw_from_views(
    recipe: Recipe, mosaic_of: Callable[[int, int], np.ndarray], made: Plan, report: Report
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons of all views drawn from rendered ones, (H, W) each; and what the manifest says of them."""
    grid, cfa, photons = recipe.grid.camera_grid(), recipe.cfa, recipe.photons
    views = list(np.ndindex(grid.rows, grid.cols))
    gain = absolute_gain(recipe)
    energies = np.array([scope_energies(mosaic_of(k, l), cfa, photons.scope) for k, l in views])
    dark = int((energies <= 0).all(axis=1).sum())
    normalisers = np.tile(energies.sum(axis=0), (len(views), 1)) if photons.scope == "scene" else energies
    totals = fixed_totals(photons, energies, seeds.generator(recipe.seed, view=0, stage="totals"))
    columns: list[list[np.ndarray]] = []
    for number, (k, l) in enumerate(views):
        raw = mosaic_of(k, l)
        if gain is not None:
            rates = raw * gain
            if not np.nanmax(rates) <= MOST_PHOTONS:
                raise InputError(
                    f"exposure: more than {MOST_PHOTONS:g} photons in a pixel of view ({k}, {l})"
                )
        else:
            rates = photon_rates(raw, cfa, photons, normalisers[number])
        rng = seeds.generator(recipe.seed, view=number, stage="photons")
        counts = draw_counts(rates, cfa, rng, None if totals is None else totals[number])
        i, j = np.nonzero(counts)
        columns.append([np.full(i.size, k), np.full(i.size, l), i, j, counts[i, j]])
        report("counts", number + 1, len(views))
    k, l, i, j, n = (np.concatenate(part) for part in zip(*columns, strict=True))
    arrivals = PhotonTable(k, l, i, j, n)
    if photons.nested:
        arrivals = _one_by_one(arrivals, recipe)
    return arrivals, {
        "method": "dense",
        "samples_per_pixel": made.samples,
        "rendering_noise": made.noise,
        "rendering_noise_allowed": NOISE_SHARE,
        "views_without_light": dark,
        "normaliser_standard_error": made.normaliser_error,
    }


def write_counts(recipe: Recipe, arrivals: PhotonTable, out: Path) -> dict[str, Any]:
    """What the sensor counts of the arrivals, written; for the budget and for each that is nested in it."""
    grid, cfa, photons, sensor = recipe.grid.camera_grid(), recipe.cfa, recipe.photons, recipe.sensor
    counts = detect(arrivals, grid, cfa, sensor, recipe.seed)
    found: dict[str, Any] = {"arrived": int(arrivals.n.sum())}
    for budget in (None, *photons.nested):
        own = counts
        if budget is not None:
            own = counts.take(nested_subset(counts, arrivals, photons, budget, recipe.seed))
        if sensor.counter_bits is not None:
            own = saturate(own, grid, sensor.counter_bits, recipe.seed)
        own = own.by_pixel(grid)
        events = PhotonCounts.from_events(own.k, own.l, own.i, own.j, own.n, grid, cfa=cfa)
        _write_events(out / nested_name(COUNTS, budget), events)
        if recipe.products.truth and own.object_id is not None and own.z_mm is not None:
            origins = {"object_id": own.object_id.repeat(own.n), "z_mm": own.z_mm.repeat(own.n)}
            write_arrays_safely(out / nested_name(PHOTON_TRUTH, budget), origins, PHOTON_TRUTH_LABELS)
        told = {"total": events.total, "pixels_with_photons": int(events.events.n.size)}
        if budget is None:
            found |= told
        else:
            found.setdefault("nested", []).append({"budget": budget, **told})
    return found


def absolute_gain(recipe: Recipe) -> float | None:
    """Photons that a pixel catches of a unit of radiance, if the recipe tells by its exposure."""
    if recipe.photons.scope != "exposure":
        return None
    assert recipe.exposure is not None
    return photons_per_radiance(recipe.exposure, recipe.grid.pixel_mm)


def _photons(recipe: Recipe, seen: Probe) -> tuple[float, float]:
    """Photons that a view is expected to have, and those of a pixel and a unit of radiance.

    For a budget the second is estimated from what the virtual centre sees, for an exposure the first.
    """
    grid = recipe.grid.camera_grid()
    pixels = grid.height * grid.width
    gain = absolute_gain(recipe)
    if gain is not None:
        return gain * seen.mean * pixels, gain
    scopes = {"view": 1.0, "channel": float(channel_count(recipe.cfa)), "scene": 1 / grid.view_count}
    per_view = recipe.photons.budget * scopes[recipe.photons.scope]
    return per_view, per_view / (pixels * seen.mean) if seen.mean > 0 else 0.0


def _scope_pixels(recipe: Recipe) -> int | None:
    """Pixels over which a budget is counted, of the rarest colour at worst; None without a budget."""
    grid, pixels = recipe.grid.camera_grid(), recipe.grid.height * recipe.grid.width
    by_colour = max(pixels // 4, 1) if recipe.cfa is not None else pixels
    scopes = {"view": pixels, "channel": by_colour, "scene": pixels * grid.view_count}
    return scopes.get(recipe.photons.scope)


def _one_by_one(arrivals: PhotonTable, recipe: Recipe) -> PhotonTable:
    """A row for each photon, with its scope and a random rank there, so that budgets can be nested."""
    total = int(arrivals.n.sum())
    grid = recipe.grid.camera_grid()
    rows = arrivals.one_by_one()
    scope = rows.k * grid.cols + rows.l
    if recipe.photons.scope == "scene":
        scope = np.zeros_like(scope)
    elif recipe.photons.scope == "channel" and recipe.cfa is not None:
        scope = 3 * scope + rows.colours(recipe.cfa)
    order = np.lexsort((seeds.generator(recipe.seed, view=1, stage="nested").random(total), scope))
    rank = np.empty(total, dtype=np.int64)
    rank[order] = places(scope[order])
    return replace(rows, scope=scope, rank=rank)


def _write_events(path: Path, counts: PhotonCounts) -> None:
    index = np.uint16 if max(counts.grid.shape_KLHW) <= 1 << 16 else np.uint32
    small = {name: getattr(counts.events, name).astype(index) for name in "klij"}
    write_arrays_safely(path, {**small, "n": counts.events.n}, COUNTS_LABELS)
