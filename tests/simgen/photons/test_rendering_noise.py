"""Samples for a dense rendering: the arithmetic, and the noise that it predicts against measured counts."""

from typing import Any

import numpy as np
import pytest
from lit_scenes import two_balls

from pcii.types import CameraGrid, sense
from simgen.photons import Capture, probe
from simgen.renderer import RenderScene, render_view

GRID = CameraGrid(rows=1, cols=1, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=1.0, height=64, width=64)
DRAWS = 30
MAX_NOISE_SHARE, PROBE_SAMPLES = 0.01, 64


@pytest.fixture(scope="module")
def scene() -> RenderScene:
    return two_balls()


def seen(built: RenderScene, samples: int, seed: int) -> np.ndarray:
    image = render_view(built, GRID, 0, 0, samples_per_pixel=samples, seed=seed)
    return sense(image, "GRBG").astype(np.float64)


@pytest.fixture(scope="module")
def radiance(scene: RenderScene) -> np.ndarray:
    """Mosaic (H, W) of 1024 samples: its own noise is one thousandth of what is measured against it."""
    return seen(scene, 1024, seed=99)


@pytest.mark.renders
def test_the_probe_sees_the_mean_and_repeats_itself(scene: RenderScene, radiance: np.ndarray) -> None:
    looked = probe(Capture(scene, GRID, "GRBG"), seed=1)
    spread = np.sqrt(looked.variance / (2 * PROBE_SAMPLES * radiance.size))
    assert abs(looked.mean - radiance.mean()) < 4 * spread
    assert probe(Capture(scene, GRID, "GRBG"), seed=1) == looked
    assert probe(Capture(scene, GRID, "GRBG"), seed=2) != looked


def looked_often(built: RenderScene, grid: CameraGrid) -> Any:
    """The mean of four probes: few paths find much light, and one probe's variance is good to 16 %."""
    found = [probe(Capture(built, grid, "GRBG"), seed) for seed in range(4)]
    mean, variance = (float(np.mean(values)) for values in zip(*(one[:2] for one in found), strict=True))
    return found[0]._replace(mean=mean, variance=variance)


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
