"""What a real sensor makes of the photons that arrive: losses, false counts. All off by default.

Photon by photon: each is detected with the quantum efficiency of its pixel's colour, dark counts and hot
pixels add counts of their own, dead pixels count nothing. In which frames they are counted, and where a
counter stops, is the matter of `frame_readout`.

Full-light images: electrons up to the full well, the noise of reading them, and a converter's steps.
"""

from dataclasses import replace

import numpy as np

from pcii.core.bayer import mosaic
from pcii.core.camera_grid import CameraGrid
from simgen.base import random_streams as seeds
from simgen.sensor.photon_table import NO_OBJECT, PhotonTable, joined
from simgen.spec.recipe import Photons, Sensor


def nested_subset(
    counts: PhotonTable, arrivals: PhotonTable, photons: Photons, budget: float, seed: int
) -> np.ndarray:
    """Which `counts`, made of `arrivals`, belong to a smaller budget, (N,) bool: an exact draw of that.

    They are the first of a scope's photons, as many as the smaller budget gives it: that many exactly
    for multinomial statistics, for Poisson each with the ratio of the budgets. Those of a smaller
    budget are among those of a larger one; counts that no photon made belong to all.
    """
    assert arrivals.scope is not None
    assert counts.scope is not None
    assert counts.rank is not None
    totals = np.bincount(arrivals.scope)
    if photons.statistics == "multinomial":
        first = np.minimum(totals, round(budget))
    else:
        first, larger = totals, photons.budget
        for part, smaller in enumerate(sorted(photons.nested, reverse=True)):
            rng = seeds.generator(seed, stage="nested totals", part=part)
            first, larger = rng.binomial(first, smaller / larger), smaller
            if smaller == budget:
                break
    belongs = np.ones(counts.k.size, dtype=bool)
    known = counts.rank >= 0
    belongs[known] = counts.rank[known] < first[counts.scope[known]]
    return belongs


def detect(
    arrivals: PhotonTable, grid: CameraGrid, cfa: str | None, sensor: Sensor, seed: int
) -> PhotonTable:
    """Counts of the whole exposure that come of arriving photons, before a counter stops."""
    rng = seeds.generator(seed, stage="detection")
    efficiency = np.array(sensor.quantum_efficiency)[arrivals.colours(cfa)]
    if (efficiency < 1).any():
        arrivals = replace(arrivals, n=rng.binomial(arrivals.n, efficiency))
    parts = [arrivals]
    views, pixels = grid.view_count, grid.height * grid.width
    if sensor.dark_counts > 0:
        number = rng.poisson(sensor.dark_counts * views * pixels)
        parts.append(
            _without_photon(grid, rng.integers(0, views * pixels, number), np.ones(number, np.int64))
        )
    # One camera takes all views, so its faulty pixels are the same in each.
    faulty = seeds.generator(seed, stage="faulty pixels")
    shuffled = faulty.permutation(pixels) if sensor.hot_pixel_share or sensor.dead_pixel_share else None
    if shuffled is not None and sensor.hot_pixel_share > 0:
        hot = shuffled[: round(sensor.hot_pixel_share * pixels)]
        n = rng.poisson(sensor.hot_pixel_counts, (views, hot.size))
        parts.append(_without_photon(grid, (np.arange(views)[:, None] * pixels + hot).ravel(), n.ravel()))
    counts = joined(parts)
    if shuffled is not None and sensor.dead_pixel_share > 0:
        dead = np.zeros(pixels, dtype=bool)
        dead[shuffled[pixels - round(sensor.dead_pixel_share * pixels) :]] = True
        counts = counts.take(~dead.reshape(grid.height, grid.width)[counts.i, counts.j])
    return counts if counts.n.all() else counts.take(counts.n > 0)


def full_light_image(
    radiance: np.ndarray,
    cfa: str | None,
    photons_per_radiance: float,
    sensor: Sensor,
    rng: np.random.Generator,
) -> np.ndarray:
    """Radiance (H, W, C) as a camera would measure it, float32, in the same unit.

    Photons arrive at random and are detected with the quantum efficiency; a pixel holds no more than
    its full well, reading adds noise, the converter has steps. What it reads is divided by the
    efficiency and by the photons that a unit of radiance gives. `C` is 1 behind a filter, or 3.
    """
    light = sensor.full_light
    assert light is not None
    efficiency = np.array(sensor.quantum_efficiency)
    if radiance.shape[2] == 1:
        height, width = radiance.shape[:2]
        flat = np.broadcast_to(efficiency, (height, width, 3))
        per_unit = (mosaic(flat, cfa) if cfa else flat[..., 1])[..., None] * photons_per_radiance
    else:
        per_unit = efficiency * photons_per_radiance
    electrons = rng.poisson(radiance * per_unit + sensor.dark_counts).astype(np.float64)
    electrons = np.minimum(electrons, light.full_well_e)
    electrons += rng.normal(0, light.read_noise_e, electrons.shape)
    steps = (1 << light.adc_bits) - 1
    read = np.clip(np.rint(electrons * (steps / light.full_well_e)), 0, steps)
    return (read * (light.full_well_e / steps) / per_unit).astype(np.float32)


def _without_photon(grid: CameraGrid, flat: np.ndarray, n: np.ndarray) -> PhotonTable:
    """Counts at flat (view, row, column) indices that no photon made."""
    k, l, i, j = np.unravel_index(flat, grid.shape_KLHW)
    nowhere = np.full(flat.size, -1)
    nothing = np.full(flat.size, NO_OBJECT)
    return PhotonTable(k, l, i, j, n, nowhere, nowhere, nothing, np.full(flat.size, np.inf))
