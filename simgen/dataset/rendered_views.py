"""Radiance images of views, on disk as products of a dataset or as what its photon counts are drawn from; and
the counts: drawn from such views, counted by the sensor, written."""

import json
import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import starmap
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pcii.base import InputError, Report, write_json_safely
from pcii.store import (
    COUNTS,
    PHOTON_TRUTH,
    PHOTON_TRUTH_LABELS,
    RADIANCE,
    nested_name,
    radiance_name,
    read_exr,
    write_arrays_safely,
    write_exr_safely,
)
from pcii.store import write_counts as save_counts
from pcii.types import Light, channel_count, colour_index, photon_rates, scope_energies, sense
from simgen.base import random_streams as seeds
from simgen.photons import MAX_NOISE_SHARE, Capture, Plan, ranks_in_scopes
from simgen.renderer import render_view, windows_of_objects
from simgen.sensor import PhotonTable, detector, full_light_image, photons_per_radiance
from simgen.spec import MOST_PHOTONS, Exposure, Photons, Render, Sensor

RENDERED = ".rendered"
"""Folder of exact views that are no product in themselves; gone when the dataset is finished."""


def exact_view(
    capture: Capture,
    k: int,
    l: int,
    samples_per_pixel: int,
    background_samples: int | None = None,
    *,
    part: int = 0,
) -> np.ndarray:
    """Radiance (H, W, C), float32, of camera (k, l), with noise of its own and of this `part`."""
    seed = seeds.integer(capture.seed, view=k * capture.grid.cols + l, stage="radiance", part=part)
    samples = {"samples_per_pixel": samples_per_pixel, "background_samples": background_samples}
    return render_view(capture.render_scene, capture.rig, k, l, seed=seed, **samples)


def halved_view(capture: Capture, k: int, l: int, samples_per_pixel: int) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (H, W, C), float32, of camera (k, l) as the mean of two halves of its samples, and its noise.

    It has as many samples per pixel, or one more. The noise (C,), which follows from the difference of the
    halves, is the variance of the mean in the sensor's colours, summed over the pixels of each.
    """
    samples = math.ceil(samples_per_pixel / 2)
    halves = (exact_view(capture, k, l, samples, part=part) for part in (0, 1))
    one, other = (half.astype(np.float64) for half in halves)
    apart = sense(one - other, capture.cfa)
    colours = colour_index(apart.shape[0], apart.shape[1], capture.cfa).ravel()
    variance = np.bincount(colours, (apart**2).ravel() / 4, minlength=channel_count(capture.cfa))
    return ((one + other) / 2).astype(np.float32), variance


def background_paths_saved(capture: Capture, render: Render) -> int:
    """Light paths that all views take less than with `render.samples_per_pixel` everywhere."""
    samples, fewer = render.samples_per_pixel, render.background_samples_per_pixel
    if fewer is None:
        return 0
    cameras = (capture.rig.camera(k, l) for k, l in np.ndindex(capture.grid.rows, capture.grid.cols))
    return sum(max(windows_of_objects(capture.render_scene, each, samples, fewer)[1], 0) for each in cameras)


@dataclass(frozen=True, eq=False)
class RenderedViews:
    """The rendered views of the dataset in the folder `out`.

    `radiance` is the product: "rgb" is all colours, "mosaic" the pixel's own. With `sensor.full_light` it is
    what a camera with this `exposure` reads, else exact radiance. A view has as many samples as `settings`
    say or, if counts are drawn from it, `samples_for_counts` in two halves, so that its noise is known.
    """

    capture: Capture
    sensor: Sensor
    exposure: Exposure | None
    radiance: Literal["none", "mosaic", "rgb"]
    settings: Render
    samples_for_counts: int | None
    out: Path

    def render(self, report: Report) -> None:
        """Write every view that is not on disk yet; the next one is rendered while one is compressed."""
        grid, stage = self.capture.grid, "views"
        if self.samples_for_counts is not None:
            stage = f"views of {self.samples_for_counts} samples per pixel, for the counts"
        with ThreadPoolExecutor(1, "views") as writer:
            writes: list[Future[None]] = []
            for k, l in np.ndindex(grid.rows, grid.cols):
                view = self._rendered(k, l)
                for write in writes[-1:]:
                    write.result()
                writes.append(writer.submit(self._write, k, l, view))
                report(stage, len(writes), grid.view_count)
            writes[-1].result()

    def view(self, k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        """Of a view on disk the radiance that each of the sensor's pixels gets (H, W), and its noise (C,)."""
        image = read_exr(self._exact_file(k, l))
        mosaic = sense(image, self.capture.cfa) if image.shape[2] == 3 else image[..., 0]
        return mosaic, np.array(json.loads(self._noise_file(k, l).read_bytes()))

    def _rendered(self, k: int, l: int) -> tuple[np.ndarray, np.ndarray | None] | None:
        """Radiance of a view and, if counts are drawn from it, its noise; None if they are on disk."""
        samples, settings = self.samples_for_counts, self.settings
        if self._exact_file(k, l).is_file() and (samples is None or self._noise_file(k, l).is_file()):
            return None
        if samples is not None:
            return halved_view(self.capture, k, l, samples)
        both = settings.samples_per_pixel, settings.background_samples_per_pixel
        return exact_view(self.capture, k, l, *both), None

    def _write(self, k: int, l: int, view: tuple[np.ndarray, np.ndarray | None] | None) -> None:
        """Write the exact radiance of a view, unless it is there, and what a camera reads, if asked for."""
        capture, exact = self.capture, self._exact_file(k, l)
        if view is not None:
            image, variance = view
            write_exr_safely(exact, image if self.radiance == "rgb" else sense(image, capture.cfa)[..., None])
            if variance is not None:
                write_json_safely(self._noise_file(k, l), variance.tolist())
        if self.sensor.full_light is not None and self.radiance != "none":
            assert self.exposure is not None
            gain = photons_per_radiance(self.exposure, capture.grid.pixel_mm)
            rng = seeds.generator(capture.seed, view=k * capture.grid.cols + l, stage="full light")
            dark_map = capture.dark_map
            if dark_map is not None:
                dark_map = np.broadcast_to(dark_map, capture.grid.shape_KLHW)[k, l]
            measured = full_light_image(read_exr(exact), capture.cfa, gain, self.sensor, rng, dark_map)
            write_exr_safely(self.out / radiance_name(k, l), measured)

    def _noise_file(self, k: int, l: int) -> Path:
        return self.out / radiance_name(k, l).replace(RADIANCE, RENDERED, 1).replace(".exr", ".json")

    def _exact_file(self, k: int, l: int) -> Path:
        """Where a view's exact radiance is kept while the dataset is made; in the end, if it is a product."""
        name = radiance_name(k, l)
        is_product = self.radiance != "none" and self.sensor.full_light is None
        return self.out / (name if is_product else name.replace(RADIANCE, RENDERED, 1))


def draw_from_views(
    capture: Capture, view_of: Callable[[int, int], tuple[np.ndarray, np.ndarray]], plan: Plan, report: Report
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons of all views drawn from rendered ones; and what the manifest says of them.

    `view_of` a camera (k, l) is what its pixels get (H, W), and the noise (C,) of that in each colour, summed
    over the pixels. Raises `InputError` for noise that adds more than `MAX_NOISE_SHARE` to the variance of
    the counts, and for too much light in a pixel.
    """
    cfa, photons, gain = capture.cfa, capture.photons, capture.photons_per_radiance
    views = list(np.ndindex(capture.grid.rows, capture.grid.cols))
    rendered = (
        (scope_energies(mosaic, cfa, photons.scope), noise) for mosaic, noise in starmap(view_of, views)
    )
    energies, variances = (np.array(part) for part in zip(*rendered, strict=True))
    normalisers, gains = energies, np.full_like(energies, 0.0 if gain is None else gain)
    if capture.has_one_budget:
        normalisers = np.broadcast_to(energies.sum(axis=0), energies.shape)
    if gain is None:
        np.divide(photons.budget, normalisers, out=gains, where=normalisers > 0)
    expected = float((gains * energies).sum())
    added = float((gains**2 * variances).sum())
    noise = added / expected if expected > 0 else 0.0
    if noise > MAX_NOISE_SHARE:
        most = 0.95 * plan.photons_per_view * MAX_NOISE_SHARE / noise
        raise InputError(
            f"photons: the noise of views rendered with {plan.samples} samples per pixel adds {noise:.2g} of "
            f"their own variance to the counts, and {MAX_NOISE_SHARE:g} is allowed, as some light comes in "
            f"rare and bright paths; take at most {most:.2g} photons per view, larger lamps or rougher metals"
        )
    totals = fixed_totals(photons, energies, seeds.generator(capture.seed, stage="budget totals"))
    columns = []
    for number, (k, l) in enumerate(views):
        rates = _photon_rates(capture, view_of(k, l)[0], normalisers[number], (k, l))
        rng = seeds.generator(capture.seed, view=number, stage="photons")
        counts = draw_counts(rates, cfa, rng, None if totals is None else totals[number])
        i, j = np.nonzero(counts)
        columns.append([np.full(i.size, k), np.full(i.size, l), i, j, counts[i, j]])
        report("counts", number + 1, len(views))
    arrivals = PhotonTable(*(np.concatenate(part) for part in zip(*columns, strict=True)))
    if photons.nested:
        arrivals = _rank(arrivals, capture)
    return arrivals, {
        "method": "dense",
        "samples_per_pixel": plan.samples,
        "rendering_noise": float(f"{noise:.3g}"),
        "rendering_noise_forecast": plan.noise,
        "rendering_noise_allowed": MAX_NOISE_SHARE,
        "views_without_light": int((energies <= 0).all(axis=1).sum()),
        "normaliser_standard_error": plan.normaliser_error,
        "bright_light_forecast": [light.log for light in plan.bright_light],
    }


def fixed_totals(photons: Photons, energies: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
    """Photons of each view (V, C or 1) for multinomial statistics, None for Poisson.

    `energies` (V, C or 1) are those of `scope_energies`. With scope "scene" the budget is shared
    among the views at random in proportion to their light; else each scope gets it exactly. A scope
    without light gets none.
    """
    if photons.statistics == "poisson":
        return None
    budget = round(photons.budget)
    if photons.scope == "scene":
        total = energies.sum()
        share = rng.multinomial(budget, energies[:, 0] / total) if total > 0 else energies[:, 0] * 0
        return share[:, None].astype(np.int64)
    return np.where(energies > 0, budget, 0)


def draw_counts(
    rates: np.ndarray, cfa: str | None, rng: np.random.Generator, totals: np.ndarray | None
) -> np.ndarray:
    """Photon counts (H, W), int64: Poisson with mean `rates`, or multinomial with fixed `totals`.

    `totals` holds one number for the view, or one for each colour.
    """
    if totals is None:
        return rng.poisson(rates)
    counts, colours = np.zeros(rates.shape, dtype=np.int64), np.zeros(rates.shape, np.uint8)
    if totals.size > 1:
        colours = colour_index(rates.shape[0], rates.shape[1], cfa)
    for colour, total in enumerate(totals):
        mask = colours == colour
        if total > 0:
            counts[mask] = rng.multinomial(total, rates[mask] / rates[mask].sum())
    return counts


def _photon_rates(
    capture: Capture, mosaic: np.ndarray, normaliser: np.ndarray, view: tuple[int, int]
) -> np.ndarray:
    """Mean photons (H, W) of each pixel of a view, of which the scopes' light (C,) is the `normaliser`."""
    gain, photons = capture.photons_per_radiance, capture.photons
    if gain is None:
        assert photons.scope != "exposure"  # which has a gain
        return photon_rates(mosaic, capture.cfa, Light(photons.budget, photons.scope), normaliser)
    rates = mosaic * gain
    if not np.nanmax(rates) <= MOST_PHOTONS:
        raise InputError(f"exposure: more than {MOST_PHOTONS:g} photons in a pixel of view {view}")
    return rates


def write_counts(
    capture: Capture,
    sensor: Sensor,
    arrivals: PhotonTable,
    out: Path,
    *,
    with_origins: bool,
    keeps_frames: bool = False,
) -> dict[str, Any]:
    """Write what the sensor counts of the arrivals, for the budget and for each that is nested in it.

    `with_origins` also where each photon came from, if that is known; with `keeps_frames` also its frame.
    Returns what the manifest says of them.
    """
    grid, cfa, photons = capture.grid, capture.cfa, capture.photons
    counts = detector.detect(arrivals, grid, cfa, sensor, capture.seed, capture.dark_map)
    log: dict[str, Any] = {"arrived": int(arrivals.n.sum()), "detected": int(counts.n.sum())}
    if photons.nested and (sensor.bits is not None or keeps_frames):
        counts = detector.in_frames(counts, sensor, capture.seed)  # the same ones in each budget
    for budget in (None, *photons.nested):
        of_budget = counts
        if budget is not None:
            of_budget = counts.take(detector.nested_subset(counts, arrivals, photons, budget, capture.seed))
        of_budget = detector.read_out(of_budget, grid, sensor, capture.seed, keeps_frames=keeps_frames)
        events = detector.counts_of(of_budget, grid, cfa, sensor, keeps_frames=keeps_frames)
        save_counts(out / nested_name(COUNTS, budget), events)
        if with_origins and of_budget.object_id is not None and of_budget.z_mm is not None:
            each_photon = {"object_id": of_budget.object_id, "z_mm": of_budget.z_mm}
            origins = {name: values.repeat(of_budget.n) for name, values in each_photon.items()}
            write_arrays_safely(out / nested_name(PHOTON_TRUTH, budget), origins, PHOTON_TRUTH_LABELS)
        totals = {"total": events.total, "pixels_with_photons": int(events.events.n.size)}
        if budget is None:
            log |= totals
        else:
            log.setdefault("nested", []).append({"budget": budget, **totals})
    return log


def _rank(arrivals: PhotonTable, capture: Capture) -> PhotonTable:
    """A row for each photon, with its scope and a random rank there, so that budgets can be nested."""
    rows = arrivals.one_by_one()
    scope = capture.scope_of(rows)
    order = np.lexsort((seeds.generator(capture.seed, stage="nested ranks").random(scope.size), scope))
    rank = np.empty(scope.size, dtype=np.int64)
    rank[order] = ranks_in_scopes(scope[order])
    return replace(rows, scope=scope, rank=rank)
