"""Samples for a dense rendering: the arithmetic, and the noise that it predicts against measured counts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lit_scenes import two_balls

from pcii.types import CameraGrid, sense
from simgen.photons import MAX_NOISE_SHARE, Capture, probe
from simgen.photons.light_probe import PROBE_SAMPLES, Probe
from simgen.renderer import RenderScene, render_view

GRID = CameraGrid(rows=1, cols=1, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=1.0, height=64, width=64)
DRAWS = 30


@pytest.fixture(scope="module")
def scene() -> RenderScene:
    return two_balls()


def seen(built: RenderScene, samples: int, seed: int, independent: bool = False) -> np.ndarray:
    image = render_view(built, GRID, 0, 0, samples_per_pixel=samples, seed=seed, independent=independent)
    return sense(image, "GRBG").astype(np.float64)


@pytest.fixture(scope="module")
def radiance(scene: RenderScene) -> np.ndarray:
    """Mosaic (H, W) of 1024 samples: its own noise is one thousandth of what is measured against it."""
    return seen(scene, 1024, seed=99)


def test_samples_are_as_many_as_are_needed() -> None:
    eight = Probe(mean=2.0, variance=8.0)
    assert eight.samples_for(0.00875) == 4  # a share of 0.035 at one sample
    assert eight.samples_for(1e-9) == 1
    assert eight.samples_for(1e9) == 400_000_000_000
    assert Probe(mean=2.0, variance=0.0).samples_for(1e9) == 1


AMOUNT = st.floats(min_value=1e-6, max_value=1e6)


@given(mean=AMOUNT, variance=AMOUNT, gain=AMOUNT)
def test_one_sample_less_would_be_too_few(mean: float, variance: float, gain: float) -> None:
    looked = Probe(mean, variance)
    samples = looked.samples_for(gain)
    tiny = 1 + 1e-12  # rounding of a quotient
    assert looked.photon_noise(gain, samples) <= MAX_NOISE_SHARE * tiny
    if samples > 1:
        assert looked.photon_noise(gain, samples - 1) * tiny >= MAX_NOISE_SHARE


@pytest.mark.renders
def test_paths_that_are_spread_evenly_have_the_error_of_four_times_as_many(
    scene: RenderScene, radiance: np.ndarray
) -> None:
    def error(samples: int, independent: bool) -> float:
        images = [seen(scene, samples, seed, independent) for seed in range(5)]
        return float(np.sqrt(np.mean((np.array(images) - radiance) ** 2)))

    assert error(4, independent=False) < error(16, independent=True)


@pytest.mark.renders
def test_the_probe_sees_the_mean_and_repeats_itself(scene: RenderScene, radiance: np.ndarray) -> None:
    looked = probe(Capture(scene, GRID, "GRBG"), seed=1)
    spread = np.sqrt(looked.variance / (2 * PROBE_SAMPLES * radiance.size))
    assert abs(looked.mean - radiance.mean()) < 4 * spread
    assert probe(Capture(scene, GRID, "GRBG"), seed=1) == looked
    assert probe(Capture(scene, GRID, "GRBG"), seed=2) != looked


def looked_often(built: RenderScene, grid: CameraGrid) -> Probe:
    """The mean of four probes: few paths find much light, and one probe's variance is good to 16 %."""
    found = [probe(Capture(built, grid, "GRBG"), seed) for seed in range(4)]
    return Probe(float(np.mean([one.mean for one in found])), float(np.mean([one.variance for one in found])))


def excess(scene: RenderScene, radiance: np.ndarray, gain: float, samples: int) -> float:
    """By how much counts drawn from noisy views are more dispersed than Poisson ones, as a share of that."""
    rng = np.random.default_rng(1)
    rates = gain * radiance
    squares = [
        (rng.poisson(gain * seen(scene, samples, seed)) - rates) ** 2 / rates.sum() for seed in range(DRAWS)
    ]
    return float(np.sum(squares) / DRAWS - 1)


@pytest.mark.renders
def test_counts_are_as_noisy_as_the_probe_tells(scene: RenderScene, radiance: np.ndarray) -> None:
    looked = looked_often(scene, GRID)
    close = 1.4  # 4 standard errors: 8 % of four probes and 6 % of the counts
    for share in (1.0, 4.0):
        gain = share * looked.mean / looked.variance
        ratio = looked.photon_noise(gain, samples=1) / excess(scene, radiance, gain, samples=1)
        assert 1 / close < ratio < close
        # The faults: a difference's variance for that of one of the two, a mean's for a sample's.
        for wrong in (2, 1 / PROBE_SAMPLES, 2 / PROBE_SAMPLES):
            assert not 1 / close < ratio * wrong < close


@pytest.mark.renders
def test_a_coarse_look_at_a_larger_film_sees_no_less_noise(scene: RenderScene) -> None:
    fine = CameraGrid(
        rows=3, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25, height=256, width=256
    )
    coarse, same = looked_often(scene, fine), looked_often(scene, GRID)
    assert coarse.mean == pytest.approx(same.mean, rel=0.05)  # the same picture, in as many pixels
    assert coarse.variance == pytest.approx(same.variance, rel=0.45)  # 4 standard errors of 11 %
    first, second = (
        sense(render_view(scene, fine, 1, 1, samples_per_pixel=8, seed=seed, independent=True), "GRBG")
        for seed in (5, 6)
    )
    own = 8 * ((first.astype(np.float64) - second) ** 2).mean() / 2
    assert coarse.variance > own / 1.45


@pytest.mark.renders
def test_planned_samples_keep_rendering_noise_out_of_the_counts(
    scene: RenderScene, radiance: np.ndarray
) -> None:
    looked = probe(Capture(scene, GRID, "GRBG"), seed=1)
    gain = 0.295 * looked.mean / looked.variance
    samples = looked.samples_for(gain)
    assert samples == 30
    # The mean of n squared standard Poisson deviates, weighted by their rates, spreads by this.
    rates = gain * radiance
    spread = np.sqrt((2 * rates**2 + rates).sum() / DRAWS) / rates.sum()
    assert excess(scene, radiance, gain, samples) < MAX_NOISE_SHARE + 4 * spread
    assert excess(scene, radiance, gain, samples=1) > MAX_NOISE_SHARE + 4 * spread
