"""Frames of an exposure: exact small cases, the binomial law, independence; each with a planted fault."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from pcii.types import CameraGrid
from simgen.sensor import PhotonTable, counts_of, detector, joined, read_out
from simgen.spec import Sensor

FILM = CameraGrid(rows=1, cols=2, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.1, height=200, width=250)
PIXELS = 100_000


def arriving(n: np.ndarray, *, known: bool) -> PhotonTable:
    """Counts `n` of all pixels, of objects that are known (and so a row each) or not."""
    pixel = np.flatnonzero(n)
    k, l, i, j = np.unravel_index(pixel, FILM.shape_KLHW)
    table = PhotonTable(k, l, i, j, n[pixel])
    if not known:
        return table
    single = table.one_by_one()
    return replace(single, object_id=single.i % 7, z_mm=500.0 + single.j)


def poisson(rate: float, *, known: bool, seed: int = 1) -> PhotonTable:
    return arriving(np.random.default_rng(seed).poisson(rate, PIXELS), known=known)


def sums(table: PhotonTable) -> np.ndarray:
    """Counts of every pixel."""
    return np.bincount(table.flat_pixels(FILM), table.n, PIXELS).astype(np.int64)


def is_binomial(counts: np.ndarray, frames: int, chance: float) -> bool:
    """Whether these are so many binomial numbers, by the exact tails of their sum and by their histogram."""
    total = stats.binomtest(int(counts.sum()), counts.size * frames, chance).pvalue
    values = np.arange(frames + 1)
    expected = counts.size * stats.binom.pmf(values, frames, chance)
    group = np.minimum(np.cumsum(expected) // 10, (counts.size - 10) // 10)  # of 10 expected or more
    _, group = np.unique(group, return_inverse=True)
    seen, due = (np.bincount(group, part) for part in (np.bincount(counts, minlength=frames + 1), expected))
    fits = 1.0 if seen.size == 1 else stats.chisquare(seen, due * seen.sum() / due.sum()).pvalue
    return bool(min(total, fits) > 1e-4)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("frames", "rate"), [(1, 0.3), (16, 1e-3), (16, 10.0), (1000, 10.0)])
def test_sums_of_one_bit_frames_are_binomial(frames: int, rate: float, known: bool) -> None:
    arrivals = poisson(rate, known=known)
    read = read_out(arrivals, FILM, Sensor(frames=frames, bits=1), seed=2)
    chance = -np.expm1(-rate / frames)
    assert is_binomial(sums(read), frames, chance)
    together = np.minimum(sums(arrivals), frames)  # the fault: the exposure saturates, not its frames
    assert not is_binomial(together, frames, chance) or frames == 1 or rate < 10
    assert not is_binomial(np.minimum(sums(poisson(0.7 * rate + 1e-2, known=False)), frames), frames, chance)


def frame_images(table: PhotonTable, frames: int) -> np.ndarray:
    """Counts of each pixel in each frame, (pixels, T): for tests, which have few of both."""
    assert table.frame is not None
    cells = table.flat_pixels(FILM) * frames + table.frame
    return np.bincount(cells, table.n, PIXELS * frames).reshape(PIXELS, frames)


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """In standard errors of uncorrelated numbers."""
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1] * np.sqrt(one.size))


@pytest.mark.parametrize("known", [True, False])
def test_frames_are_independent_of_each_other_and_of_neighbours(known: bool) -> None:
    frames = 8
    read = read_out(poisson(3.0, known=known), FILM, Sensor(frames=frames, bits=1), 2, keeps_frames=True)
    bits = frame_images(read, frames)
    assert bits.max() == 1
    assert stats.chisquare(bits.sum(axis=0)).pvalue > 1e-4  # no frame has more light than the others
    assert abs(correlation(bits[:, :-1], bits[:, 1:])) < 4
    assert abs(correlation(bits[:, 0], bits[:, 5])) < 4
    assert abs(correlation(bits[:-1], bits[1:])) < 4
    assert abs(correlation(bits[:-1, :-1], bits[1:, 1:])) < 4
    evenly = arriving(np.full(PIXELS, 3), known=known)  # the fault: as many photons in every exposure
    fixed = frame_images(read_out(evenly, FILM, Sensor(frames=frames, bits=1), 2, keeps_frames=True), frames)
    assert abs(correlation(fixed[:, :-1], fixed[:, 1:])) > 40


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("bits", "rate"), [(1, 0.5), (3, 6.0)])
def test_every_pixel_and_frame_stops_by_itself(rate: float, bits: int, known: bool) -> None:
    arrivals = poisson(rate, known=known)
    unlimited = read_out(arrivals, FILM, Sensor(frames=6), 3, keeps_frames=True)
    expected = np.minimum(frame_images(unlimited, 6), 2**bits - 1)
    read = read_out(arrivals, FILM, Sensor(frames=6, bits=bits), 3, keeps_frames=True)
    np.testing.assert_array_equal(frame_images(read, 6), expected)
    np.testing.assert_array_equal(sums(unlimited), sums(arrivals))
    only_sums = read_out(arrivals, FILM, Sensor(frames=6, bits=bits), 3)
    np.testing.assert_array_equal(sums(only_sums), expected.sum(axis=1))


def test_lumps_of_a_pixel_stop_together() -> None:
    n = np.random.default_rng(1).poisson(6.0, PIXELS)
    lumps = joined([arriving(n // 2, known=False), arriving(n - n // 2, known=False)])
    np.testing.assert_array_equal(sums(read_out(lumps, FILM, Sensor(bits=2), seed=1)), np.minimum(n, 3))


def test_parts_of_the_work_are_one_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    arrivals, sensor = poisson(2.0, known=False), Sensor(frames=16, bits=1)
    monkeypatch.setattr(detector, "MAX_CELLS_AT_ONCE", 1000)
    read = read_out(arrivals, FILM, sensor, seed=2)
    assert read.flat_pixels(FILM).tolist() == np.flatnonzero(sums(arrivals)).tolist()
    assert is_binomial(sums(read), 16, -np.expm1(-2.0 / 16))


def test_counts_know_their_frames_in_the_order_of_their_events() -> None:
    sensor = Sensor(frames=9, bits=2)
    read: Any = read_out(poisson(4.0, known=True), FILM, sensor, seed=1, keeps_frames=True)
    counts = counts_of(read, FILM, None, sensor, keeps_frames=True)
    assert (counts.readout.frames, counts.readout.bits) == (9, 2)
    e: Any = counts.frame_events
    again = PhotonTable(e.k, e.l, e.i, e.j, np.ones_like(e.k), frame=e.frame)
    np.testing.assert_array_equal(frame_images(again, 9), frame_images(read, 9))
    pixel = again.flat_pixels(FILM)
    assert (np.diff(pixel * 9 + e.frame) >= 0).all()
    # Origins are written in this order, too.
    np.testing.assert_array_equal(read.object_id, e.i % 7)
