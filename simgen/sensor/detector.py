"""From light to counts: photons of a unit of radiance, counts of a pixel, frames of an exposure.

Photon by photon: each is detected with the quantum efficiency of its pixel's colour, dark counts and hot
pixels add counts of their own, dead pixels count nothing. All faults are off by default.

The exposure is T equal frames, and light is steady. So each count of an exposure falls into a frame evenly
and independently of all others, and the counts of the frames are independent Poisson numbers of a T-th of the
mean: the splitting of a Poisson process. What a pixel counts in a frame beyond 2^bits - 1 is lost. The work
follows the counts: no array has all pixels in all frames.

Full-light images: electrons up to the full well, the noise of reading them, and a converter's steps.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pcii.types import CameraGrid, PhotonCounts, mosaic
from simgen.base import random_streams as seeds
from simgen.sensor.photon_table import NO_OBJECT, PhotonTable, joined
from simgen.spec import Exposure, Photons, Sensor

PHOTONS_PER_LUMEN_SECOND = 555e-9 / (683 * 6.62607015e-34 * 299792458)
"""Photons of 555 nm; CODATA values of h and c, SI value of the luminous efficacy."""
MAX_CELLS_AT_ONCE = 1 << 22
"""Pixels times frames that are in memory at once, 32 bytes each."""


def photons_per_radiance(exposure: Exposure, pixel_mm: float) -> float:
    """Photons that arrive at a pixel during the exposure for each cd/m^2 that it looks at."""
    illuminance_per_luminance = math.pi / (4 * exposure.f_number**2)
    pixel_m2 = (pixel_mm * 1e-3) ** 2
    return PHOTONS_PER_LUMEN_SECOND * illuminance_per_luminance * pixel_m2 * exposure.time_s


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
    # Counts without a photon have the scope and the rank -1.
    return (counts.rank < 0) | (counts.rank < np.append(first, 0)[counts.scope])


def detect(
    arrivals: PhotonTable,
    grid: CameraGrid,
    cfa: str | None,
    sensor: Sensor,
    seed: int,
    dark_map: np.ndarray | None = None,
) -> PhotonTable:
    """Counts of the whole exposure that come of arriving photons, before a counter stops.

    `dark_map` has mean counts without light, (H, W) or (K, L, H, W), on top of `sensor.dark_counts`.
    """
    rng = seeds.generator(seed, stage="detection")
    efficiency = np.array(sensor.quantum_efficiency)[arrivals.colours(cfa)]
    if (efficiency < 1).any():
        arrivals = replace(arrivals, n=rng.binomial(arrivals.n, efficiency))
    parts = [arrivals]
    views, pixels = grid.view_count, grid.height * grid.width
    if sensor.dark_counts > 0:
        number = rng.poisson(sensor.dark_counts * views * pixels)
        parts.append(_without_photon(grid, rng.integers(0, views * pixels, number)))
    if dark_map is not None:
        # Counts of all views at once, each of which then falls into a view evenly.
        each = views if dark_map.ndim == 2 else 1
        n = rng.poisson(each * dark_map.ravel())
        dark = np.arange(n.size).repeat(n)
        dark += pixels * rng.integers(each, size=dark.size)
        parts.append(_without_photon(grid, dark))
    hot, dead = (round(share * pixels) for share in (sensor.hot_pixel_share, sensor.dead_pixel_share))
    # One camera takes all views, so the same pixels are faulty in each.
    order = seeds.generator(seed, stage="faulty pixels").permutation(pixels)
    if hot:
        n = rng.poisson(sensor.hot_pixel_counts, (views, hot))
        flat = (np.arange(views)[:, None] * pixels + order[:hot]).ravel()
        parts.append(_without_photon(grid, flat, n.ravel()))
    counts = joined(parts)
    if dead:
        works = np.ones(pixels, dtype=bool)
        works[order[pixels - dead :]] = False
        counts = counts.take(works.reshape(grid.shape_HW)[counts.i, counts.j])
    return counts if counts.n.all() else counts.take(counts.n > 0)


def _without_photon(grid: CameraGrid, flat: np.ndarray, n: np.ndarray | None = None) -> PhotonTable:
    """Counts at flat (view, row, column) indices that no photon made, each single without `n`."""
    k, l, i, j = np.unravel_index(flat, grid.shape_KLHW)
    n = np.ones(flat.size, np.int64) if n is None else n
    nowhere, no_object = np.full(flat.size, -1), np.full(flat.size, NO_OBJECT)
    return PhotonTable(k, l, i, j, n, nowhere, nowhere, no_object, np.full(flat.size, np.inf))


def in_frames(counts: PhotonTable, sensor: Sensor, seed: int) -> PhotonTable:
    """Counts one by one, each in a frame; as they are if there is one frame, or if theirs are known."""
    if sensor.frames == 1 or counts.frame is not None:
        return counts
    counts = counts.one_by_one()
    rng = seeds.generator(seed, stage="frames")
    return replace(counts, frame=rng.integers(sensor.frames, size=counts.k.size, dtype=np.int32))


def read_out(
    counts: PhotonTable, grid: CameraGrid, sensor: Sensor, seed: int, *, keeps_frames: bool = False
) -> PhotonTable:
    """What is read of counts, ordered by view and pixel: in each frame no more than the counter holds.

    Counts whose origin or frame is known are read one by one, and which of them come first in a frame is left
    to chance; of others only the sums are read. With `keeps_frames` rows are single counts in the order of
    their frames, which are known then, unless there is only one.
    """
    keeps_frames &= sensor.frames > 1
    if (sensor.bits is None and not keeps_frames) or not counts.k.size:
        return counts.by_pixel(grid)
    if counts.object_id is not None or counts.frame is not None:
        return _first_counts(in_frames(counts, sensor, seed).one_by_one(), grid, sensor, seed)
    return joined([*_summed(counts, grid, sensor, seed, keeps_frames)])


def counts_of(
    read: PhotonTable, grid: CameraGrid, cfa: str | None, sensor: Sensor, *, keeps_frames: bool
) -> PhotonCounts:
    """Photon counts of what was read, with the frames if they are to be kept and there are several."""
    columns = read.k, read.l, read.i, read.j, read.n
    frame, frames, bits = read.frame if keeps_frames else None, sensor.frames, sensor.bits
    return PhotonCounts.from_events(*columns, grid, cfa=cfa, frames=frames, bits=bits, frame=frame)


def _first_counts(counts: PhotonTable, grid: CameraGrid, sensor: Sensor, seed: int) -> PhotonTable:
    """The first counts of every pixel and frame, as many as the counter holds."""
    cell = counts.flat_pixels(grid)
    if counts.frame is not None:
        cell = cell * sensor.frames + counts.frame
    chance = seeds.generator(seed, stage="saturation").random(cell.size)
    order = np.lexsort((chance, cell))
    if sensor.readout.most_per_frame is None:
        return counts.take(order)
    cell = cell[order]
    place = np.arange(cell.size) - np.searchsorted(cell, cell)
    return counts.take(order[place < sensor.readout.most_per_frame])


def _summed(
    counts: PhotonTable, grid: CameraGrid, sensor: Sensor, seed: int, keeps_frames: bool
) -> Iterator[PhotonTable]:
    """What is read of counts of which only the sum of each pixel matters, some pixels at a time."""
    pixel, inverse = np.unique(counts.flat_pixels(grid), return_inverse=True)
    total = np.zeros(pixel.size, np.int64)
    np.add.at(total, inverse, counts.n)
    rng = seeds.generator(seed, stage="frames")
    work = np.cumsum(np.minimum(total, sensor.frames))
    limits = np.arange(MAX_CELLS_AT_ONCE, work[-1] + MAX_CELLS_AT_ONCE, MAX_CELLS_AT_ONCE)
    for part in np.split(np.arange(pixel.size), np.unique(np.searchsorted(work, limits, "right"))):
        if not part.size:
            continue
        owner, frame, n = _cells(total[part], sensor.frames, rng)
        if sensor.readout.most_per_frame is not None:
            n = np.minimum(n, sensor.readout.most_per_frame)
        if not keeps_frames:
            n, owner, frame = np.bincount(owner, n, part.size).astype(np.int64), np.arange(part.size), None
        k, l, i, j = np.unravel_index(pixel[part][owner], grid.shape_KLHW)
        table = PhotonTable(k, l, i, j, n, frame=frame)
        yield table.one_by_one() if keeps_frames else table


def _cells(
    total: np.ndarray, frames: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels and frames that have counts, in their order, and how many, if each pixel has `total` in all.

    Each array is (N,), and no longer than the smaller of counts and frames of all pixels.
    """
    is_few = total <= frames
    owner = np.flatnonzero(is_few).repeat(total[is_few])
    cell, n = np.unique(owner * frames + rng.integers(frames, size=owner.size), return_counts=True)
    if not is_few.all():
        many = np.flatnonzero(~is_few)
        split = rng.multinomial(total[many], np.full(frames, 1 / frames))
        row, frame = np.nonzero(split)
        cell = np.concatenate([cell, many[row] * frames + frame])
        n = np.concatenate([n, split[row, frame]])
        order = np.argsort(cell)
        cell, n = cell[order], n[order]
    return cell // frames, cell % frames, n


def full_light_image(
    radiance: np.ndarray,
    cfa: str | None,
    photons_per_unit: float,
    sensor: Sensor,
    rng: np.random.Generator,
    dark_map: np.ndarray | None = None,
) -> np.ndarray:
    """Radiance (H, W, C) as a camera would measure it, float32, in the same unit.

    Photons arrive at random and are detected with the quantum efficiency; a pixel holds no more than
    its full well, reading adds noise, the converter has steps. What it reads is divided by the
    efficiency and by `photons_per_unit`, the photons that a unit of radiance gives. `C` is 1 behind a
    filter, or 3. `dark_map` (H, W) has mean counts on top of `sensor.dark_counts`.
    """
    light = sensor.full_light
    assert light is not None
    efficiency = np.array(sensor.quantum_efficiency)
    if radiance.shape[2] == 1:
        flat = np.broadcast_to(efficiency, (*radiance.shape[:2], 3))
        efficiency = (mosaic(flat, cfa) if cfa else flat[..., 1])[..., None]
    per_unit = efficiency * photons_per_unit
    dark = sensor.dark_counts + (0.0 if dark_map is None else dark_map[..., None])
    electrons = rng.poisson(radiance * per_unit + dark).astype(np.float64)
    electrons = np.minimum(electrons, light.full_well_e)
    electrons += rng.normal(0, light.read_noise_e, electrons.shape)
    steps = (1 << light.adc_bits) - 1
    digits = np.clip(np.rint(electrons * (steps / light.full_well_e)), 0, steps)
    return (digits * (light.full_well_e / steps) / per_unit).astype(np.float32)
