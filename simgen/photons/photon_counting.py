"""The photon counts of a dataset: thinned or drawn from views, counted by the sensor, written."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.photon_limit import Light, photon_rates, scope_energies
from pcii.io.dataset_layout import COUNTS, PHOTON_TRUTH, nested_name
from pcii.io.dataset_writer import write_counts as save_counts
from pcii.io.dataset_writer import write_photon_truth
from simgen.base import random_streams as seeds
from simgen.photons.candidates import Setup
from simgen.photons.counting_plan import ROUNDING, Capture, Plan, two_digits
from simgen.photons.rendering_noise import NOISE_SHARE
from simgen.photons.thinning import places, thin_photons
from simgen.sensor.detector import detect, nested_subset
from simgen.sensor.frame_readout import counts_of, in_frames, read_out
from simgen.sensor.mosaic import draw_counts, fixed_totals
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import MOST_PHOTONS, Sensor


def thin(
    capture: Capture,
    setup: Setup,
    made: Plan,
    report: Report = silent,
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons of all views drawn one by one, and what the manifest says of them; see `thin_photons`."""
    grid = capture.grid
    photons, log = thin_photons(
        setup,
        capture.photons,
        seed=capture.seed,
        photons_per_radiance=capture.photons_per_radiance,
        explored=made.explored,
        keeps_origins=made.keeps_origins,
        report=report,
    )
    return photons, log | {
        "dense_paths_instead": made.samples * grid.view_count * grid.height * grid.width,
        "normaliser_standard_error": 0.0,
    }


def draw_from_views(
    capture: Capture,
    mosaic_of: Callable[[int, int], np.ndarray],
    variance_of: Callable[[int, int], np.ndarray],
    made: Plan,
    report: Report,
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons of all views drawn from rendered ones, (H, W) each; and what the manifest says of them.

    `variance_of` is the noise (C,) of a view in each colour, summed over its pixels. Raises `InputError` for
    noise that adds more than `NOISE_SHARE` to the variance of the counts, and for too much light in a pixel.
    """
    grid, cfa, photons, gain = capture.grid, capture.cfa, capture.photons, capture.photons_per_radiance
    views = list(np.ndindex(grid.rows, grid.cols))
    energies = np.array([scope_energies(mosaic_of(k, l), cfa, photons.scope) for k, l in views])
    dark = int((energies <= 0).all(axis=1).sum())
    normalisers = np.tile(energies.sum(axis=0), (len(views), 1)) if photons.scope == "scene" else energies
    noise = _measured_noise(capture, energies, normalisers, [variance_of(k, l) for k, l in views])
    if noise > NOISE_SHARE:
        most = two_digits(made.photons_per_view * NOISE_SHARE / noise / ROUNDING)
        raise InputError(
            f"photons: the noise of views rendered with {made.samples} samples per pixel adds {noise:.2g} of "
            f"their own variance to the counts, and {NOISE_SHARE:g} is allowed, since some light comes in "
            f"rare and bright paths; take at most {most} photons per view, larger lamps or rougher metals"
        )
    totals = fixed_totals(photons, energies, seeds.generator(capture.seed, stage="budget totals"))
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
            light = Light(photons.budget, photons.scope)
            rates = photon_rates(raw, cfa, light, normalisers[number])
        rng = seeds.generator(capture.seed, view=number, stage="photons")
        counts = draw_counts(rates, cfa, rng, None if totals is None else totals[number])
        i, j = np.nonzero(counts)
        columns.append([np.full(i.size, k), np.full(i.size, l), i, j, counts[i, j]])
        report("counts", number + 1, len(views))
    k, l, i, j, n = (np.concatenate(part) for part in zip(*columns, strict=True))
    arrivals = PhotonTable(k, l, i, j, n)
    if photons.nested:
        arrivals = _one_by_one(arrivals, capture)
    return arrivals, {
        "method": "dense",
        "samples_per_pixel": made.samples,
        "rendering_noise": float(f"{noise:.3g}"),
        "rendering_noise_forecast": made.noise,
        "rendering_noise_allowed": NOISE_SHARE,
        "views_without_light": dark,
        "normaliser_standard_error": made.normaliser_error,
    }


def _measured_noise(
    capture: Capture, energies: np.ndarray, normalisers: np.ndarray, variances: Sequence[np.ndarray]
) -> float:
    """Variance that the noise of all views adds to counts, as a share of their own.

    Energies and what they are divided by are (V, S), of each view and scope; variances are (C,) of each view.
    """
    if capture.photons_per_radiance is not None:
        gain = np.full_like(energies, capture.photons_per_radiance)
    else:
        lit = normalisers > 0
        gain = np.divide(capture.photons.budget, normalisers, out=np.zeros_like(energies), where=lit)
    photons = float((gain * energies).sum())
    added = float((gain**2 * np.stack(variances)).sum()) if photons > 0 else 0.0
    return added / photons if photons > 0 else 0.0


def write_counts(
    capture: Capture,
    sensor: Sensor,
    arrivals: PhotonTable,
    out: Path,
    *,
    with_origins: bool,
    keeps_frames: bool = False,
) -> dict[str, Any]:
    """What the sensor counts of the arrivals, written; for the budget and for each that is nested in it.

    With where each photon came from, if that is asked for and known, and its frame, if that is asked for.
    What the manifest says of them.
    """
    grid, cfa, photons = capture.grid, capture.cfa, capture.photons
    counts = detect(arrivals, grid, cfa, sensor, capture.seed)
    found: dict[str, Any] = {"arrived": int(arrivals.n.sum()), "detected": int(counts.n.sum())}
    if photons.nested and (sensor.bits is not None or keeps_frames):
        counts = in_frames(counts, sensor, capture.seed)  # the same ones in each budget
    for budget in (None, *photons.nested):
        kept = counts
        if budget is not None:
            kept = counts.take(nested_subset(counts, arrivals, photons, budget, capture.seed))
        kept = read_out(kept, grid, sensor, capture.seed, keeps_frames=keeps_frames)
        events = counts_of(kept, grid, cfa, sensor, keeps_frames=keeps_frames)
        save_counts(out / nested_name(COUNTS, budget), events)
        if with_origins and kept.object_id is not None and kept.z_mm is not None:
            origins = kept.object_id.repeat(kept.n), kept.z_mm.repeat(kept.n)
            write_photon_truth(out / nested_name(PHOTON_TRUTH, budget), *origins)
        totals_here = {"total": events.total, "pixels_with_photons": int(events.events.n.size)}
        if budget is None:
            found |= totals_here
        else:
            found.setdefault("nested", []).append({"budget": budget, **totals_here})
    return found


def _one_by_one(arrivals: PhotonTable, capture: Capture) -> PhotonTable:
    """A row for each photon, with its scope and a random rank there, so that budgets can be nested."""
    total = int(arrivals.n.sum())
    rows = arrivals.one_by_one()
    scope = rows.k * capture.grid.cols + rows.l
    if capture.photons.scope == "scene":
        scope = np.zeros_like(scope)
    elif capture.photons.scope == "channel" and capture.cfa is not None:
        scope = 3 * scope + rows.colours(capture.cfa)
    order = np.lexsort((seeds.generator(capture.seed, stage="nested ranks").random(total), scope))
    rank = np.empty(total, dtype=np.int64)
    rank[order] = places(scope[order])
    return replace(rows, scope=scope, rank=rank)
