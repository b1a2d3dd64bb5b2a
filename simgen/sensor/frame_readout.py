"""Frames of an exposure: in which of them a photon is counted, and where the pixel's counter stops.

The exposure is T equal frames, and light is steady. So each count of an exposure falls into a frame evenly
and independently of all others, and the counts of the frames are independent Poisson numbers of a T-th of the
mean: the splitting of a Poisson process. What a pixel counts in a frame beyond 2^bits - 1 is lost. The work
follows the counts: no array has all pixels in all frames.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.photon_counts import PhotonCounts
from simgen.base import random_streams as seeds
from simgen.sensor.photon_table import PhotonTable, joined
from simgen.spec.recipe import Sensor

CELLS_AT_ONCE = 1 << 22
"""Pixels times frames that are in memory at once, 32 bytes each."""


def in_frames(counts: PhotonTable, sensor: Sensor, seed: int) -> PhotonTable:
    """Counts one by one, each in a frame: as many rows as counts. Of one frame they stay as they are."""
    if sensor.frames == 1:
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
        single = counts if counts.frame is not None else in_frames(counts, sensor, seed)
        return _first_counts(single.one_by_one(), grid, sensor, seed)
    return joined([*_summed(counts, grid, sensor, seed, keeps_frames)])


def counts_of(
    read: PhotonTable, grid: CameraGrid, cfa: str | None, sensor: Sensor, *, keeps_frames: bool
) -> PhotonCounts:
    """Photon counts of what was read, with the frames if they are to be kept and there are several."""
    return PhotonCounts.from_events(
        read.k,
        read.l,
        read.i,
        read.j,
        read.n,
        grid,
        cfa=cfa,
        frames=sensor.frames,
        bits=sensor.bits,
        frame=read.frame if keeps_frames else None,
    )


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
    first = np.flatnonzero(np.diff(cell, prepend=-1))
    place = np.arange(cell.size) - first.repeat(np.diff(first, append=cell.size))
    return counts.take(order[place < sensor.readout.most_per_frame])


def _summed(
    counts: PhotonTable, grid: CameraGrid, sensor: Sensor, seed: int, keeps_frames: bool
) -> Iterator[PhotonTable]:
    """What is read of counts of which only the sum of each pixel matters, some pixels at a time."""
    pixel, inverse = np.unique(counts.flat_pixels(grid), return_inverse=True)
    total = np.zeros(pixel.size, np.int64)
    np.add.at(total, inverse, counts.n)
    most = sensor.readout.most_per_frame
    rng = seeds.generator(seed, stage="frames")
    work = np.cumsum(np.minimum(total, sensor.frames))
    ends = np.searchsorted(work, np.arange(CELLS_AT_ONCE, work[-1] + CELLS_AT_ONCE, CELLS_AT_ONCE), "right")
    for part in np.split(np.arange(pixel.size), np.unique(ends)):
        if not part.size:
            continue
        of, frame, n = _cells(total[part], sensor.frames, rng)
        if most is not None:
            n = np.minimum(n, most)
        if not keeps_frames:
            n, of, frame = np.bincount(of, n, part.size).astype(np.int64), np.arange(part.size), None
        k, l, i, j = np.unravel_index(pixel[part][of], grid.shape_KLHW)
        table = PhotonTable(k, l, i, j, n, frame=frame)
        yield table.one_by_one() if keeps_frames else table


def _cells(
    total: np.ndarray, frames: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels and frames that have counts, in their order, and how many, if each pixel has `total` in all.

    Each array is (N,), and no longer than the smaller of counts and frames of all pixels.
    """
    few = total <= frames
    of = np.flatnonzero(few).repeat(total[few])
    cell, n = np.unique(of * frames + rng.integers(frames, size=of.size), return_counts=True)
    if not few.all():
        many = np.flatnonzero(~few)
        split = rng.multinomial(total[many], np.full(frames, 1 / frames))
        row, frame = np.nonzero(split)
        cell = np.concatenate([cell, many[row] * frames + frame])
        n = np.concatenate([n, split[row, frame]])
        order = np.argsort(cell)
        cell, n = cell[order], n[order]
    return cell // frames, cell % frames, n
