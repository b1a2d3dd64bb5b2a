"""The photon counts of a dataset: drawn from rendered views, counted by the sensor, written."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, Report
from pcii.store import COUNTS, PHOTON_TRUTH, PHOTON_TRUTH_LABELS, nested_name, write_arrays_safely
from pcii.store import write_counts as save_counts
from pcii.types import Light, photon_rates, scope_energies
from simgen.base import random_streams as seeds
from simgen.photons import MAX_NOISE_SHARE, Capture, Plan, ranks_in_scopes
from simgen.sensor import PhotonTable, detector
from simgen.spec import MOST_PHOTONS, Sensor


def draw_from_views(
    capture: Capture,
    mosaic_of: Callable[[int, int], np.ndarray],
    variance_of: Callable[[int, int], np.ndarray],
    plan: Plan,
    report: Report,
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons of all views drawn from rendered ones, (H, W) each; and what the manifest says of them.

    `variance_of` is the noise (C,) of a view in each colour, summed over its pixels. Raises `InputError` for
    noise that adds more than `MAX_NOISE_SHARE` to the variance of the counts, and for too much light in a
    pixel.
    """
    cfa, photons, gain = capture.cfa, capture.photons, capture.photons_per_radiance
    views = list(np.ndindex(capture.grid.rows, capture.grid.cols))
    energies = np.array([scope_energies(mosaic_of(k, l), cfa, photons.scope) for k, l in views])
    normalisers, gains = energies, np.full_like(energies, 0.0 if gain is None else gain)
    if capture.has_one_budget:
        normalisers = np.broadcast_to(energies.sum(axis=0), energies.shape)
    if gain is None:
        np.divide(photons.budget, normalisers, out=gains, where=normalisers > 0)
    expected = float((gains * energies).sum())
    added = float((gains**2 * np.stack([variance_of(k, l) for k, l in views])).sum())
    noise = added / expected if expected > 0 else 0.0
    if noise > MAX_NOISE_SHARE:
        most = 0.95 * plan.photons_per_view * MAX_NOISE_SHARE / noise
        raise InputError(
            f"photons: the noise of views rendered with {plan.samples} samples per pixel adds {noise:.2g} of "
            f"their own variance to the counts, and {MAX_NOISE_SHARE:g} is allowed, as some light comes in "
            f"rare and bright paths; take at most {most:.2g} photons per view, larger lamps or rougher metals"
        )
    totals = detector.fixed_totals(photons, energies, seeds.generator(capture.seed, stage="budget totals"))
    columns = []
    for number, (k, l) in enumerate(views):
        rates = _photon_rates(capture, mosaic_of(k, l), normalisers[number], (k, l))
        rng = seeds.generator(capture.seed, view=number, stage="photons")
        counts = detector.draw_counts(rates, cfa, rng, None if totals is None else totals[number])
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
