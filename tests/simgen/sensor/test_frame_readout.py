"""Exposures: photons by hand; frames by exact small cases and the binomial law, each beside a fault."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lit_scenes import build_scene
from photon_statistics import counted
from scipy import stats

from pcii.base import silent
from pcii.types import CameraGrid, colour_index, sense
from simgen.dataset import capture_of, draw_from_views
from simgen.photons import Plan, plan_counts, thin_photons
from simgen.renderer import RenderScene, render_view
from simgen.sensor import PhotonTable, counts_of, detector, joined, photons_per_radiance, read_out
from simgen.spec import Exposure, Recipe, Sensor

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


LUMINANCE_CD_M2, F_NUMBER, TIME_S, PIXEL_MM = 100.0, 4.0, 2e-6, 0.02
BY_HAND = math.pi / (4 * 4.0**2) * (20e-6) ** 2 * 2e-6 * 100 * 4.09e15
"""Photons per pixel: 16 of 555 nm. The 4.09e15 in a lumen second are rounded to 1 in 1000."""
Draw = Callable[[Recipe, RenderScene], PhotonTable]


def recipe(**changes: object) -> Recipe:
    grid = {"rows": 1, "cols": 2, "height": 64, "width": 80, "pixel_mm": PIXEL_MM}
    exposed = {"photons": {"scope": "exposure"}, "exposure": {"f_number": F_NUMBER, "time_s": TIME_S}}
    return Recipe.model_validate({"scene": "made up", "seed": 1, "grid": grid} | exposed | changes)


@pytest.fixture(scope="module")
def lit_evenly() -> RenderScene:
    return build_scene([], [{"type": "uniform", "luminance_cd_m2": LUMINANCE_CD_M2}])


def planned(thins: bool) -> Plan:
    return Plan(thins=thins, samples=1, photons_per_view=0.0, noise=0.0, normaliser_error=0.0)


def thinned(made: Recipe, built: RenderScene) -> PhotonTable:
    return thin_photons(capture_of(made, built, made.seed), planned(True))[0]


def dense(made: Recipe, built: RenderScene) -> PhotonTable:
    grid = made.grid.camera_grid()

    def view_of(k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        image = render_view(built, grid, k, l, samples_per_pixel=1, seed=1)
        return sense(image, made.cfa), np.zeros(3)

    capture = capture_of(made, built, made.seed)
    return draw_from_views(capture, view_of, planned(False), silent)[0]


@pytest.mark.renders
@pytest.mark.parametrize("draw", [thinned, dense])
@pytest.mark.parametrize("cfa", ["GRBG", "none"])
def test_an_even_light_gives_the_photons_by_hand(lit_evenly: RenderScene, draw: Draw, cfa: str) -> None:
    made = recipe(sensor={"cfa": cfa})
    counts = counted(draw(made, lit_evenly), made.grid.camera_grid())
    # 4 standard errors of mean and variance of n Poisson numbers, and what was rounded by hand.
    n = counts.size
    allowed = 4 * np.sqrt(BY_HAND / n) + 1e-3 * BY_HAND
    assert abs(counts.mean() - BY_HAND) < allowed
    assert abs(counts.var() - BY_HAND) < 4 * np.sqrt((BY_HAND + 2 * BY_HAND**2) / n)
    # The faults: pi is left out, a pixel's side taken for its area, an f-number off by a per cent.
    for wrong in (BY_HAND / math.pi, BY_HAND / 20e-6, BY_HAND * 1.01**2):
        assert abs(counts.mean() - wrong) > allowed
    colours = colour_index(64, 80, made.cfa)
    for colour in np.unique(colours):
        part = counts[..., colours == colour]
        assert abs(part.mean() - BY_HAND) < 4 * np.sqrt(BY_HAND / part.size) + 1e-3 * BY_HAND


@pytest.mark.renders
def test_the_plan_expects_the_photons_by_hand(lit_evenly: RenderScene) -> None:
    found = photons_per_radiance(Exposure(f_number=F_NUMBER, time_s=TIME_S), PIXEL_MM)
    assert LUMINANCE_CD_M2 * found == pytest.approx(BY_HAND, rel=1e-3)
    made = plan_counts(capture_of(recipe(), lit_evenly, 1), "llvm", may_explore=lambda _: False)
    assert made.photons_per_view == pytest.approx(64 * 80 * BY_HAND, rel=1e-3)
    assert made.noise == pytest.approx(0, abs=1e-6)  # single precision: an even light has no noise
    assert made.samples == 1
